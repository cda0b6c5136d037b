"""A function of φ and ξ as a surface: in space by pyvista where this machine can render, in the plane by matplotlib."""

from __future__ import annotations

import math
import subprocess
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.drawing import COLOURS, MOST_LINES, QUARTERS, SIZE, STYLE, add_legend, draw_colours, label_axes
from fpsolve.signals import signals_held

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROBE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True)
plotter.add_mesh(pyvista.Sphere())
raise SystemExit(not plotter.screenshot(return_img=True).std())
"""
PATIENCE = 60.0
"""Seconds that a first picture may take."""
BOX = (1.0, 0.75, 0.4)
"""Edges of the surface's box along φ, ξ and the values."""
LENGTH, SWELL = 2.0, 0.5
"""Length of the cylinder, whose radius is 1, and by how much the largest value adds to that."""
LINES = (
    ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0)),
    ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 0, 1), (1, 0, 0)),
    ((1, 1, 0), (1, 1, 1)),
)
"""Of the floor of the box, and of its edges behind the surface, in its edges."""
RIM = ("0", "π/2", "π", "3π/2", "2π")
"""Words at the quarters of the rim."""
RED = "#C8102E"
NEXT_TO_ZERO = 0.05
"""A least value below this share of the maximum is drawn as 0, which rounding and small errors miss."""
DECADES = 2
"""So many powers of ten of T, which is positive, are drawn on a logarithmic scale."""
Label = tuple[str, FloatArray, str]
"""Words, their place, and on which side of them this is."""


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
        name: of the function, in letters that VTK has.
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

    def placed(self, phi: Any, xi: Any, values: Any, *, cylinder: bool) -> FloatArray:
        """Points of space for φ, ξ and values, which broadcast: in a box, or with φ around an axis and ξ along it."""
        low, high = self.limits
        along, known = (xi - self.xi[0]) / (self.xi[-1] - self.xi[0]), np.nan_to_num(values, nan=low)
        up = np.log(known / low) / math.log(high / low) if self.is_log else (known - low) / (high - low)
        radius = 1 + SWELL * up
        wrapped = radius * np.cos(phi), radius * np.sin(phi), LENGTH * along
        flat = BOX[0] * phi / (2 * math.pi), BOX[1] * along, BOX[2] * up
        return np.stack(np.broadcast_arrays(*(wrapped if cylinder else flat)), axis=-1)

    def label(self, of: str) -> str:
        """A coordinate or the function, with its unit."""
        unit = self.about[of]["units"]
        words = self.name if of == "values" else f"{self.about[of]['long_name']} {'φ' if of == 'phi' else 'ξ'}"
        return words if unit == "1" else f"{words} ({unit})"


@lru_cache(maxsize=1)
def can_render() -> bool:
    """Whether this machine can render; a child process finds out, as without OpenGL that ends in a crash."""
    command = [sys.executable or "python", "-P", "-c", PROBE]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def picture_of(surface: Surface, cmap: str = "viridis", *, cylinder: bool = False) -> Picture:
    """The function in space where this machine can render it, which lines need not; else in the plane."""
    if not surface.is_lines and can_render():
        return picture_in_space(surface, cmap, cylinder=cylinder)
    if cylinder and not surface.is_lines:
        warnings.warn(
            "this machine cannot render, so that the plane is drawn; to draw a cylinder install OpenGL, as "
            "by apt-get install libegl1 libgl1-mesa-dri",
            stacklevel=3,
        )
    return flat_picture(surface, cmap)


def flat_picture(surface: Surface, cmap: str) -> Picture:
    """The function in colours over the plane, or as lines, by matplotlib."""
    content = BytesIO()
    flat_figure(surface, cmap).savefig(content, format="png", dpi=150)
    return Picture(content.getvalue())


def flat_figure(surface: Surface, cmap: str) -> Figure:
    """The figure of `flat_picture`, which belongs to no window."""
    from matplotlib import rc_context
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.figure import Figure

    about, (low, high) = surface.about, surface.limits
    style: dict[str, Any] = {"shading": "gouraud", "cmap": cmap}
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        axes = figure.add_subplot()
        if surface.is_lines:
            _draw_lines(axes, surface)
        else:
            style["norm"] = (LogNorm if surface.is_log else Normalize)(low, high)
            draw_colours(axes, surface.phi.ravel(), surface.xi, surface.values.T, about["values"], **style)
        for impact in surface.impacts:
            axes.axvline(impact, color=RED, linewidth=1.2)
        axes.set_xticks(*QUARTERS)
        label_axes(axes, about["phi"], about["values" if surface.is_lines else "xi"])
        figure.suptitle(surface.title, parse_math=False)
        axes.set_title("\n".join(surface.lines), fontsize=9, parse_math=False)
    return figure


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


def picture_in_space(surface: Surface, cmap: str, *, cylinder: bool) -> Picture:
    """The function as a surface over the plane or around a cylinder, by pyvista; only where `can_render` says so."""
    from matplotlib.font_manager import findfont
    from matplotlib.image import imsave

    with signals_held():
        import pyvista
        from vtkmodules.vtkCommonCore import vtkLogger
    before, content = vtkLogger.GetCurrentVerbosityCutoff(), BytesIO()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # it complains of a display that is not there
    plotter: Any = pyvista.Plotter(off_screen=True, notebook=False, window_size=[1200, 800])
    try:
        plotter.set_background("white")
        plotter.enable_anti_aliasing("ssaa")
        phi, rows = surface.phi.ravel(), np.arange(surface.phi.size).reshape(surface.phi.shape)
        points = surface.placed(phi[:, None], surface.xi, surface.values, cylinder=cylinder)
        corners = rows[:, :-1].reshape(-1, 1) * surface.xi.size + np.arange(surface.xi.size - 1)
        sides = [corners, corners + surface.xi.size, corners + surface.xi.size + 1, corners + 1]
        mesh = pyvista.PolyData(points.reshape(-1, 3), np.stack([np.full_like(corners, 4), *sides], axis=-1).ravel())
        mesh.point_data["values"] = surface.values.ravel()
        bar: dict[str, Any] = {"title": f"{surface.label('values')}\n", "vertical": True, "color": "black"}
        bar |= {"position_x": 0.88, "position_y": 0.25, "height": 0.5, "width": 0.06, "n_labels": 5, "fmt": "%.3g"}
        bar |= {"title_font_size": 20, "label_font_size": 20}
        look: dict[str, Any] = {"cmap": cmap, "clim": surface.limits, "log_scale": surface.is_log}
        plotter.add_mesh(mesh, smooth_shading=True, ambient=0.45, scalar_bar_args=bar, **look)
        for row in (row for impact in surface.impacts for row in np.flatnonzero(np.abs(phi - impact) < 1e-9)):
            edge = pyvista.lines_from_points(points[row])
            plotter.add_mesh(edge, color=RED, line_width=4, render_lines_as_tubes=True, lighting=False)
        for edges in () if cylinder else LINES:
            plotter.add_lines(np.multiply(edges, BOX), color="black", width=1, connected=True)
        plain: dict[str, Any] = {"shape": None, "show_points": False, "always_visible": True, "bold": False}
        letters = {"font_file": findfont("DejaVu Sans"), "color": "black"}  # those of VTK are Latin
        for words, place, side in (_labels_of_cylinder if cylinder else _labels_of_box)(surface):
            style = {"text_color": RED if "impact" in words else "black", "justification_horizontal": side}
            style |= {"font_file": letters["font_file"]}
            plotter.add_point_labels([place], [words], font_size=22, **plain, **style)
        plotter.add_text(surface.title, position="upper_edge", font_size=12, **letters)
        plotter.add_text("\n".join(surface.lines), position="lower_edge", font_size=8, **letters)
        seen_from = (-1.5, -1.5, 1.3) if cylinder else (-1.2, -2.0, 1.6)
        plotter.camera_position = [seen_from, (0, 0, 0), (0, 0, 1)]
        plotter.reset_camera()
        plotter.camera.zoom(0.95 if cylinder else 0.85)  # so that words fit around it
        imsave(content, plotter.screenshot(return_img=True), format="png")
    finally:
        plotter.close()
        vtkLogger.SetStderrVerbosity(before)
    return Picture(content.getvalue())


def _labels_of_box(surface: Surface) -> Iterator[Label]:
    """Ticks and names of φ along the front and of ξ along the left side, and the impacts at the back."""
    from matplotlib.ticker import MaxNLocator

    (low, high), start, end = surface.limits, float(surface.xi[0]), float(surface.xi[-1])

    def at(phi: float, xi: float, value: float, *shift: float) -> FloatArray:
        return surface.placed(phi, xi, value, cylinder=False) + shift

    for k, words in enumerate(RIM):
        yield words, at(k * math.pi / 2, start, low, 0, -0.05, 0), "left"
    yield surface.label("phi"), at(1.1 * math.pi, start, low, 0, -0.17, 0), "left"
    for xi in MaxNLocator(4).tick_values(start, end):
        if start < xi < end:
            yield f"{xi:g}", at(0, xi, low, -0.03, 0, 0), "right"
    yield surface.label("xi"), at(0, (start + end) / 2, low, -0.12, 0, 0), "right"
    for impact in surface.impacts:
        yield "impact", at(impact, end, high, 0, 0, 0.03), "center"


def _labels_of_cylinder(surface: Surface) -> Iterator[Label]:
    """φ around the upper rim, and ξ at both ends, on the side that has no colour bar."""
    high, phi, start, end = surface.limits[1], surface.phi.ravel(), float(surface.xi[0]), float(surface.xi[-1])
    impacts = {round(impact / (math.pi / 2), 9) for impact in surface.impacts}
    for k, (words, side) in enumerate(zip(RIM[:4], ("left", "right", "right", "left"), strict=True)):
        rim = surface.values[np.argmin(np.abs(phi - k * math.pi / 2)), -1] if k < 2 else high
        place = surface.placed(k * math.pi / 2, end, rim, cylinder=True) * (1.1, 1.1, 1)
        text = f"{words}: impact" if k in impacts else words
        yield surface.label("phi").replace("φ", f"φ = {text}") if k == 0 else text, place, side
    for xi in (start, end):
        words = surface.label("xi").replace("ξ", f"ξ = {xi:.3g}")
        yield words, surface.placed(0.75 * math.pi, xi, high, cylinder=True) * (1.1, 1.1, 1), "right"
