"""Results as data: labelled arrays of xarray, tables of pandas, pictures, and what notebooks show."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from html import escape
from textwrap import fill
from typing import TYPE_CHECKING, Any

from fpsolve import __version__
from fpsolve.errors import FpsolveError
from fpsolve.pictures import canvas_of, draw

if TYPE_CHECKING:  # each takes some tenths of a second to import
    import pandas
    import xarray
    from matplotlib.axes import Axes

LONGEST = 100
"""Characters of a `repr`."""
Variable = tuple[str | Sequence[str], Any, Mapping[str, str]]
"""The dimensions of a variable of xarray, its values and its attributes."""
Parameters = Mapping[str, float | str]
"""Parameters of a problem by their keys, such as "noise.D0"."""


def described(long_name: str, symbol: str = "", units: str = "1", **more: str) -> dict[str, str]:
    """The attributes of a variable of xarray: what it is, its symbol in LaTeX, its units, and more; no empty ones."""
    known = {"long_name": long_name, "symbol": symbol, "units": units, **more}
    return {name: text for name, text in known.items() if text}


def brief(thing: object, text: str) -> str:
    """The class of a thing with a text about it, as a `repr` of one line."""
    line = f"{type(thing).__name__}({' '.join(text.split())})"
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]}...)"


def dataset(
    title: str,
    method: str,
    variables: Mapping[str, Variable],
    coordinates: Mapping[str, Variable],
    parameters: Parameters,
    **more: float | str | Sequence[str],
) -> xarray.Dataset:
    """Labelled arrays, the main variable first, that can be written as netCDF.

    Args:
        title: what the numbers are.
        method: what they come from, such as "finite elements".
        variables, coordinates: each with its dimensions and its attributes.
        parameters: of the problem, as far as they are known.
        more: what else is known; of sentences that are none nothing is kept.
    """
    import xarray

    joined = {name: value if isinstance(value, int | float | str) else "\n".join(value) for name, value in more.items()}
    known = {name: value for name, value in joined.items() if value != ""}
    about = {"title": f"{title} by {method}", "method": method, **parameters, **known, "fpsolve_version": __version__}
    return xarray.Dataset(dict(variables), dict(coordinates), about)


class Result(ABC):
    """Something that was computed, as data and as a picture; a mixin of frozen dataclasses with `repr=False`."""

    @abstractmethod
    def to_xarray(self) -> xarray.Dataset:
        """The numbers as labelled arrays, with errors by `<name>_error`, units, equations, and the parameters."""

    @abstractmethod
    def _said(self) -> str:
        """What `repr` says, in short."""

    def _table(self) -> xarray.Dataset:
        """Of `to_xarray` what a table holds."""
        return self.to_xarray()

    def to_pandas(self) -> pandas.DataFrame:
        """The numbers as a table, one row for each place of the main variable. Raises `FpsolveError` without pandas."""
        try:
            import pandas
        except ImportError as missing:
            raise FpsolveError("tables need pandas; install it: pip install 'fpsolve[pandas]'") from missing
        whole = self._table()
        full = whole.drop_dims([name for name, size in whole.sizes.items() if not size])
        main = next(iter((full if full.data_vars else whole).data_vars.values()))
        names = [name for name, each in whole.data_vars.items() if set(each.dims) <= set(main.dims)]
        if not main.dims:
            return pandas.DataFrame({name: [whole[name].item()] for name in names})
        return whole[names].to_dataframe(dim_order=main.dims)

    def plot(self, ax: Axes | None = None, **line_kwargs: Any) -> Axes:
        """Draw the main variable with its error, into `ax` or a new figure.

        Args:
            ax: where; None for a figure of its own.
            line_kwargs: for matplotlib, such as color or label.
        """
        found = self.to_xarray()
        with canvas_of(ax) as axes:
            self._draw(found, axes, **line_kwargs)
            if ax is None:
                axes.set_title(fill(found.attrs["title"], 60), parse_math=False)
        return axes

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        """Draw what `to_xarray` gives."""
        draw(found, axes, **kwargs)

    def __repr__(self) -> str:
        return brief(self, self._said())

    def _repr_html_(self) -> str:
        """What a notebook shows: the numbers, with their units, and the parameters."""
        return f"<p>{escape(repr(self))}</p>{self.to_xarray()._repr_html_()}"
