"""[figure]: what figure.png shows over what, and how it is set."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, model_validator

from fpsolve.arrays import is_log_spaced
from fpsolve.case.messages import Refusal, nearest, refuse, repeated_or_unknown, shown, shown_with_kind
from fpsolve.case.sections import Section, Text, is_number
from fpsolve.case.vary import Vary
from fpsolve.exponent.quantities import MOMENT, QUANTITIES, DrawnName
from fpsolve.model.parameters import parameter
from fpsolve.model.quantity import Quantity, moment_at

MOST_NAMED = 8
"""Curves that a legend can tell apart; of more, and of a map, colours tell the value of a key."""
MarkedName = Literal["stability_index", "lyapunov_exponent"]
Width = Literal["single column", "double column"]
_LARGEST = 1e30
_APART = 1e-9
"""How far the ends of an axis are from each other at least, relative to their size."""


class MomentAt(Section):
    """{ moment = p }: Λ at one p."""

    moment: Annotated[float, parameter("order of the moment", "moment = 2.0")]


def _ordinate(value: Any) -> Any:
    """The name of a quantity, or Λ at one p."""
    names = get_args(DrawnName)
    if isinstance(value, MomentAt) or (isinstance(value, str) and value in names):
        return value
    if isinstance(value, dict) and value.keys() == {"moment"} and is_number(value["moment"]):
        return MomentAt(moment=float(value["moment"]))
    known = ", ".join(f'"{name}"' for name in names)
    got, guess = (shown(value), nearest(value, names)) if isinstance(value, str) else (shown_with_kind(value), "")
    text = f"got {got}; must be one of {known}, or {{ moment = p }} with a finite p;{guess} write, for example, "
    refuse([((), value, text + "y = { moment = 2.0 }")])
    return value


def _limits(value: Any) -> Any:
    """The two ends of an axis."""
    if value is None:
        return value
    if isinstance(value, list | tuple) and len(value) == 2 and all(map(is_number, value)):
        start, stop = value
        if max(abs(start), abs(stop)) <= _LARGEST and stop - start > _APART * max(abs(start), abs(stop)):
            return float(start), float(stop)
    text = (
        f"got {shown_with_kind(value)}; must be a list of two numbers, the smaller one first, from -1e30 to 1e30 and "
        "not equal to 9 digits; write, for example, [0.0, 4.0]"
    )
    refuse([((), value, text)])
    return value


def _marks(value: Any) -> Any:
    """Names of what is marked, each known and there once."""
    names = get_args(MarkedName)
    known = ", ".join(f'"{name}"' for name in names)
    if not isinstance(value, list | tuple):
        text = f"got {shown_with_kind(value)}; must be a list of some of {known}; write, for example, [{known}]"
        refuse([((), value, text)])
    refuse(
        repeated_or_unknown(
            value, names, lambda name, guess: f"got {name}; must be one of {known};{guess} rename or remove it"
        )
    )
    return tuple(value)


def _time_unit(value: Any) -> Any:
    """Letters that stand for a unit of time."""
    if not isinstance(value, str) or not re.fullmatch(r"[^\W\d_]{1,12}", value):
        text = f'got {shown_with_kind(value)}; must be a unit of 1 to 12 letters; write, for example, time_unit = "s"'
        refuse([((), value, text)])
    return value


class FigureSection(Section):
    """[figure]: the axes, what is marked, and how it is set; x is "p" or a varied key."""

    x: Annotated[Text, parameter("the abscissa", 'x = "p"')] = "p"
    y: Annotated[DrawnName | MomentAt, BeforeValidator(_ordinate), parameter("the ordinate", 'y = "moment"')] = "moment"
    map: Annotated[bool | None, parameter("whether colours show it over two keys", "map = true")] = None
    title: Annotated[Text | None, parameter("the heading instead of that of the case", 'title = "Stability"')] = None
    width: Annotated[Width, parameter("how wide it is printed", 'width = "single column"')] = "double column"
    xlim: Annotated[
        tuple[float, float] | None, BeforeValidator(_limits), parameter("ends of the abscissa", "xlim = [0.0, 4.0]")
    ] = None
    ylim: Annotated[
        tuple[float, float] | None, BeforeValidator(_limits), parameter("ends of the ordinate", "ylim = [-0.1, 0.1]")
    ] = None
    mark: Annotated[
        tuple[MarkedName, ...], BeforeValidator(_marks), parameter("what is marked", 'mark = ["stability_index"]')
    ] = ("stability_index",)
    time_unit: Annotated[
        str, BeforeValidator(_time_unit), parameter("what the unit of time is called", 'time_unit = "s"')
    ] = "time"

    @property
    def moment(self) -> float | None:
        """The p whose Λ(p) is drawn over a parameter; None where another quantity is drawn."""
        return self.y.moment if isinstance(self.y, MomentAt) else None

    @property
    def needed(self) -> str:
        """The name of the quantity that must be computed for it."""
        return MOMENT.name if isinstance(self.y, MomentAt) else self.y

    @property
    def quantity(self) -> Quantity:
        """What is drawn."""
        return QUANTITIES[self.needed] if self.moment is None else moment_at(self.moment)

    @model_validator(mode="after")
    def _fits_x(self) -> Self:
        written = self.y.model_dump() if isinstance(self.y, MomentAt) else self.y
        names = '{ moment = 2.0 }, "lyapunov_exponent" or "stability_index"'
        if self.x == "p" and self.y != "moment":
            remedy = 'must be "moment" where x = "p"; write y = "moment", or set x to a key of [vary]'
            refuse([(("y",), written, f"got {shown(written)}; {remedy}")])
        if self.x != "p" and self.y == "moment":
            text = f'got {shown(written)}; must be {names} where x is not "p"; write one of these'
            refuse([(("y",), self.y, text)])
        if self.x == "p" and self.map:
            text = "got true; a map is drawn over two keys of [vary]; set x to one of them, or remove it"
            refuse([(("map",), self.map, text)])
        if self.x != "p" and self.mark and "mark" in self.model_fields_set:
            text = f'got {shown(self.mark)}; only Λ(p) over p has marks; write x = "p", or remove it'
            refuse([(("mark",), self.mark, text)])
        return self


def other_key(x: str, vary: Vary) -> str | None:
    """The second key of a map over x: of a product over two keys of numbers the other one."""
    several = [key for key in vary.keys if len(vary.values(key)) > 1]
    is_plane = vary.mode == "product" and len(several) == 2 and x in several and not any(map(vary.is_text, several))
    return next((key for key in several if key != x), None) if is_plane else None


def map_key(figure: FigureSection, vary: Vary) -> str | None:
    """The second key of the map that is drawn; None where curves are."""
    key = other_key(figure.x, vary)
    if key is None or figure.map is False:
        return None
    return key if figure.map or len(vary.values(key)) > MOST_NAMED else None


def figure_refusals(figure: FigureSection, valid: Mapping[str, Any]) -> Iterator[Refusal]:
    """What of a figure the other sections do not allow."""
    if figure.moment is not None and "moments" in valid and not valid["moments"].has(figure.moment):
        values = valid["moments"].values
        among = f"moments.p ({values.size} values, {values[0]:g} to {values[-1]:g})"
        text = f"got {figure.moment}; must be among {among}; add it there, or choose one of them"
        yield ("y", "moment"), figure.moment, text
    if "vary" not in valid:
        return
    vary = valid["vary"]
    known = ["p", *(key for key in vary.keys if not vary.is_text(key))]
    if figure.x not in known:
        text = f";{nearest(figure.x, known)} must be p or a key of [vary]: {', '.join(known)}; add it to [vary]"
        if figure.x in vary.keys:
            text = f", whose values are texts; must be one of {', '.join(known)}; choose one of them"
        yield ("x",), figure.x, f"got {shown(figure.x)}{text}"
        return
    if figure.map and other_key(figure.x, vary) is None:
        text = (
            "got true; a map needs a [vary] of all combinations of two keys of numbers and no others, each with two "
            "values or more; vary these, or remove it"
        )
        yield ("map",), figure.map, text
    for name, key, limits in (("xlim", figure.x, figure.xlim), ("ylim", map_key(figure, vary), figure.ylim)):
        if key in vary.keys and limits and limits[0] <= 0 and is_log_spaced(vary.values(key)):
            text = f"got {shown(limits)}; must be > 0, as the values of {key} are spread by factors, on a "
            yield (name,), limits, f"{text}logarithmic axis; raise the smaller one"
