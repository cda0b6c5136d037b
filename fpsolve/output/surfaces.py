"""A picture of a function of φ and ξ, by matplotlib."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.drawing import COLOURS, MOST_LINES, QUARTERS, SIZE, STYLE, add_legend, draw_colours, label_axes

RED = "#C8102E"
NEXT_TO_ZERO = 0.05
"""A least value below this share of the maximum is drawn as 0, which rounding and small errors miss."""
DECADES = 2
"""So many powers of ten of T, which is positive, are drawn on a logarithmic scale."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that notebooks show.

    Attributes:
        png: the content of its file.
    """

    png: bytes

    def save(self, path: str | Path) -> Path:
        """Write it as a PNG file."""
        Path(path).write_bytes(self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png


@dataclass(frozen=True, eq=False)
class Surface:
    """A function on the full circle and an interval of the noise, with its words.

    Attributes:
        phi: φ of the nodes, shape (blocks, nodes of a block); neighbours share their ends, each with its own values.
        xi: ξ of the nodes, shape (n,).
        values: shape (blocks · nodes, n).
        about: long_name, symbol and units of the function and of "phi" and "xi", as for xarray.
        name: of the function.
        title: in which p and Λ(p) are.
        lines: of parameters.
        impacts: the phases at which the function jumps.
        is_lines: whether ξ has these values alone, so that there is a line for each and no surface.
    """

    phi: FloatArray
    xi: FloatArray
    values: FloatArray
    about: Mapping[str, Mapping[str, str]]
    name: str
    title: str
    lines: Sequence[str]
    impacts: Sequence[float]
    is_lines: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """The range of the values; it begins at 0 where the least is next to it, or all are the same."""
        low, high = float(np.nanmin(self.values)), float(np.nanmax(self.values))
        is_next = abs(low) < NEXT_TO_ZERO * high or high - low < 1e-6 * high
        return (0.0 if is_next and not self.is_log else low, high)

    @property
    def is_log(self) -> bool:
        """Whether the scale of the values is logarithmic."""
        return self.name == "T" and 0 < 10**DECADES * float(np.nanmin(self.values)) < float(np.nanmax(self.values))


def painted(draw: Callable[[Any], object], title: str, lines: Sequence[str]) -> Picture:
    """What is drawn into axes, with a title and lines of parameters, in a figure that belongs to no window."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    content = BytesIO()
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        axes = figure.add_subplot()
        draw(axes)
        figure.suptitle(title, parse_math=False)
        axes.set_title("\n".join(lines), fontsize=9, parse_math=False)
    figure.savefig(content, format="png", dpi=150)
    return Picture(content.getvalue())


def picture_of(surface: Surface, cmap: str = "viridis") -> Picture:
    """The function in colours over the plane, or as lines, by matplotlib."""
    return painted(partial(_draw, surface, cmap), surface.title, surface.lines)


def _draw(surface: Surface, cmap: str, axes: Any) -> None:
    from matplotlib.colors import LogNorm, Normalize

    about = surface.about
    if surface.is_lines:
        _draw_lines(axes, surface)
    else:
        norm = (LogNorm if surface.is_log else Normalize)(*surface.limits)
        style = {"shading": "gouraud", "cmap": cmap, "norm": norm}
        draw_colours(axes, surface.phi.ravel(), surface.xi, surface.values.T, about["values"], **style)
    for impact in surface.impacts:
        axes.axvline(impact, color=RED, linewidth=1.2)
    axes.set_xticks(*QUARTERS)
    label_axes(axes, about["phi"], about["values" if surface.is_lines else "xi"])


def _draw_lines(axes: Any, surface: Surface) -> None:
    """A line over φ for each value of the noise, with a gap where the function jumps."""
    phi = np.pad(surface.phi, ((0, 0), (0, 1)), constant_values=math.nan).ravel()
    for number, xi in enumerate(surface.xi):
        blocks = surface.values[:, number].reshape(surface.phi.shape)
        values = np.pad(blocks, ((0, 0), (0, 1)), constant_values=math.nan).ravel()
        axes.plot(phi, values, color=COLOURS[number % len(COLOURS)], linewidth=1.6, label=rf"$\xi$ = {xi:g}")
    axes.set_xlim(0, 2 * math.pi)
    if surface.is_log:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    if 1 < surface.xi.size <= MOST_LINES:
        add_legend(axes)
