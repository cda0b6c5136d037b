"""Results as data: the quantities that they hold, labelled arrays of xarray, tables of pandas, pictures."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from textwrap import fill
from typing import TYPE_CHECKING, Self

from fpsolve import __version__
from fpsolve.arrays import ReadOnly
from fpsolve.drawing import canvas_of, draw, title_of, typeset

if TYPE_CHECKING:  # each takes some tenths of a second to import
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

LETTERS = 60
"""Those of a line above a picture."""
LONGEST = 100
"""Largest number of characters of a `repr`."""
Parameters = Mapping[str, float | str]
"""Parameters of a problem by their keys, such as "noise.D0"."""


def written(value: float | str, style: str = "g") -> str:
    """The value of a parameter for the eye: a number in a format, a text as it is."""
    return value if isinstance(value, str) else f"{value:{style}}"


def short_names(keys: Iterable[str]) -> list[str]:
    """Keys without their sections, but for those that would then be alike."""
    keys = list(keys)
    last = [key.rpartition(".")[2] for key in keys]
    return [key if last.count(name) > 1 else name for key, name in zip(keys, last, strict=True)]


@dataclass(frozen=True)
class Quantity:
    """Something that is computed of a problem, or that this depends on: a row of the table in `model.quantity`.

    Attributes:
        name: in case files, JSON, CSV and labelled arrays.
        symbol: in sentences and terminal tables.
        words: what it is, in small letters.
        latex: its symbol on an axis, with dollars.
        unit: "1" for none, "unknown" where it depends on a motion of which nothing more is known.
        dims: the names of the quantities that it is a function of.
        equation: what defines it: the number of an equation of the paper, or an equation.
        closed_form: the number of its perturbation theory in the paper; empty where there is none.
        error_source: what its error is estimated from; empty where there is no estimate.
        comment: more, for who reads the numbers.
    """

    name: str
    symbol: str
    words: str
    latex: str = ""
    unit: str = "1"
    dims: tuple[str, ...] = ()
    equation: str = ""
    closed_form: str = ""
    error_source: str = ""
    comment: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """Those of a variable of xarray: long_name, symbol, units, equation and comment; no empty ones."""
        is_key = "." in self.name and self.words == self.name
        words = f"parameter {'' if self.latex else self.shown}".rstrip() if is_key else self.words
        about = {"symbol": self.latex, "units": self.unit, "equation": self.equation, "comment": self.comment}
        return {name: text for name, text in {"long_name": words, **about}.items() if text}

    @property
    def title(self) -> str:
        """The label of an axis, in LaTeX, with the unit."""
        return title_of(self.attributes)

    @property
    def shown(self) -> str:
        """Its symbol in a figure, or else its name, of a parameter without the section."""
        return self.latex or self.name.rpartition(".")[2]

    @property
    def unit_in_words(self) -> str:
        """Its unit in a sentence; empty where it has none, or that is not known."""
        return "" if self.unit in ("1", "unknown") else plain_unit(self.unit)

    def in_words(self, symbol: str = "") -> str:
        """Its words, a symbol, and in brackets its unit, if it has one."""
        return f"{self.words}{symbol}{f' ({self.unit_in_words})' if self.unit_in_words else ''}"

    def timed(self, unit: str) -> Self:
        """The quantity with a unit of time: "1/s" instead of "1/time"."""
        return replace(self, unit=re.sub(r"\btime(?=\b|²)", unit, self.unit))

    def stated(self, value: float | str) -> str:
        r"""A value of it in a figure: "$D_0$ = 0.1/time", "impact = delta"."""
        unit = "" if self.unit in ("1", "unknown") else f" {typeset(self.unit)}"
        return f"{self.shown} = {written(value)}{unit.removeprefix(' 1')}"

    def error(self, kind: str = "estimated error") -> Quantity:
        """Its error, of a kind such as "standard error"; where it is estimated, the comment says from what."""
        comment = f"from {self.error_source}" if kind == "estimated error" and self.error_source else ""
        return replace(self, name=f"{self.name}_error", words=f"{kind} of the {self.words}", comment=comment)

    def end(self, which: str, level: float) -> Quantity:
        """The "low" or the "high" end of an interval that holds it with a probability."""
        words = f"{which} end of the interval that holds the {self.words} with {level:.0%}"
        return replace(self, name=f"{self.name}_{which}", words=words)

    @property
    def perturbation(self) -> Quantity:
        """What perturbation theory makes of it."""
        name, words = f"{self.name}_perturbation", f"{self.words} by perturbation theory"
        return replace(self, name=name, words=words, equation=self.closed_form)

    def by(self, other: Quantity) -> Quantity:
        """Its partial derivative by another one."""
        divisor = other.unit if other.unit.isidentifier() else f"({other.unit})"
        unit = self.unit if other.unit == "1" else "1" if self.unit == other.unit else f"{self.unit}/{divisor}"
        if "unknown" in (self.unit, other.unit):
            unit = "unknown"
        return Quantity(
            name=f"{self.name}_by_{other.name}",
            symbol=f"∂{self.symbol}/∂{other.symbol}",
            words=f"derivative of the {self.words} by {other.name}",
            latex=rf"$\partial {self.latex.strip('$')}/\partial {other.latex.strip('$')}$" if other.latex else "",
            unit=unit,
            dims=(*self.dims, *other.dims),
        )


def plain_unit(unit: str) -> str:
    """A unit in a sentence, without powers in parentheses: "1/sqrt(time)", "1/time^1.5"."""
    return re.sub(r"(\w+)\^\(1/2\)", r"sqrt(\1)", unit).replace("^(3/2)", "^1.5")


def brief(thing: object, text: str) -> str:
    """The class of a thing with a text about it, as a `repr` of one line."""
    line = f"{type(thing).__name__}({' '.join(text.split())})"
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]}...)"


def dataset(
    title: str,
    method: str,
    numbers: Mapping[Quantity, ArrayLike | None],
    coordinates: Mapping[Quantity, ArrayLike],
    parameters: Parameters,
    **more: float | str | Sequence[str],
) -> xarray.Dataset:
    """Labelled arrays, the main variable first, that can be written as netCDF.

    Args:
        title: what the numbers are.
        method: what they come from, such as "finite elements".
        numbers, coordinates: the values of each quantity, over its `dims`.
        parameters: of the problem, as far as they are known.
        more: what else is known; of sentences that are none nothing is kept.
    """
    import xarray

    joined = {
        name: value if isinstance(value, int | float) else str(value) if isinstance(value, str) else "\n".join(value)
        for name, value in more.items()
    }  # a message is a text and more, which no file can hold
    known = {name: value for name, value in joined.items() if value != ""}
    about = {"title": f"{title} by {method}", "method": method, **parameters, **known, "fpsolve_version": __version__}
    variables, places = (
        {each.name: (each.dims, values, each.attributes) for each, values in some.items()}
        for some in (numbers, coordinates)
    )
    return xarray.Dataset(variables, places, about)


class Result(ReadOnly, ABC):
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
        """The numbers as a table, one row for each place of the main variable."""
        import pandas  # 160 ms

        whole = self._table()
        full = whole.drop_dims([name for name, size in whole.sizes.items() if not size])
        main = next(iter((full if full.data_vars else whole).data_vars.values()))
        names = [name for name, each in whole.data_vars.items() if set(each.dims) <= set(main.dims)]
        if not main.dims:
            return pandas.DataFrame({name: [whole[name].item()] for name in names})
        return whole[names].to_dataframe(dim_order=main.dims)

    def plot(self, ax: Axes | None = None, **line_kwargs: object) -> Axes:
        """Draw the main variable with its error, into `ax` or a new figure.

        Args:
            ax: where; None for a figure of its own.
            line_kwargs: for matplotlib, such as color or label.
        """
        found = self.to_xarray()
        with canvas_of(ax) as axes:
            self._draw(found, axes, **line_kwargs)
            if ax is None:
                known = {key: written(value) for key, value in found.attrs.items() if "." in key}
                told = (f"{name}\xa0=\xa0{known[key]}" for key, name in zip(known, short_names(known), strict=True))
                about = fill(", ".join(told), LETTERS, max_lines=3, placeholder=" …")
                lines = [fill(found.attrs["title"], LETTERS), about]
                axes.set_title("\n".join(filter(None, lines)), parse_math=False)
        return axes

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        draw(found, axes, **kwargs)

    def __repr__(self) -> str:
        return brief(self, self._said())

    def _repr_html_(self) -> str:
        """What a notebook shows: the numbers, with their units, and the parameters."""
        return f"<p>{escape(repr(self))}</p>{self.to_xarray()._repr_html_()}"
