"""The range of a parameter: a side of a chart, or what a design may change."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import TableError, accepted, bounds_in, nearest, shown, strict_dataclass
from fpsolve.model.parameters import parameter
from fpsolve.model.problem import Problem, checked_problem

Scale = Literal["linear", "log"]


def check_range(start: float, stop: float, scale: Scale, more: str = "") -> None:
    """Refuse a range that does not increase, or cannot be logarithmic.

    Args:
        start, stop, scale: of the range.
        more: what else may be done about ends that do not increase.

    Raises:
        TableError: of `start` alone where it is not positive.
    """
    if not 0 < stop - start < math.inf:
        must = f"must be start < stop, with a finite difference; exchange the two{more}"
        raise TableError(f"got start = {start}, stop = {stop}; {must}")
    if scale == "log" and start <= 0:
        remedy = 'must be > 0 where scale = "log"; use a positive start, or scale = "linear"'
        raise TableError(f"got {start}; {remedy}", "start")


@strict_dataclass
class Axis:
    """One side of a chart.

    Args:
        key: of a parameter, such as "oscillator.omega".
        start, stop: its smallest and its largest value.
        scale: "linear" or "log".
        at: values at which the points of a line are wanted exactly.

    Raises:
        pydantic.ValidationError: start ≥ stop, or not positive on a log scale, or an `at` is not between them.
    """

    key: Annotated[str, parameter("the parameter", 'key = "oscillator.omega"')]
    start: Annotated[float, parameter("its smallest value", "start = 0.3")]
    stop: Annotated[float, parameter("its largest value", "stop = 5.0")]
    scale: Annotated[Scale, parameter("whether it is linear or logarithmic", 'scale = "log"')] = "linear"
    at: Annotated[
        tuple[float, ...],
        parameter("values at which lines have a point exactly", "at = [1.0, 2.0]", strict=False, max_length=1000),
    ] = ()

    def __post_init__(self) -> None:
        check_range(self.start, self.stop, self.scale)
        for i, value in enumerate(self.at):
            if not self.start <= value <= self.stop:
                known = f"must be from start = {self.start} to stop = {self.stop}; remove it, or widen the frame"
                raise TableError(f"got {value}; {known}", "at", i)

    def value(self, share: ArrayLike) -> FloatArray:
        """The parameter at a share of the way from start to stop."""
        if self.scale == "log":
            value = self.start * (self.stop / self.start) ** np.asarray(share)
        else:
            value = self.start + (self.stop - self.start) * np.asarray(share)
        found: FloatArray = np.clip(value, self.start, self.stop)[()]
        return found

    def share(self, value: float) -> float:
        """The inverse of `value`."""
        if self.scale == "log":
            return math.log(value / self.start) / math.log(self.stop / self.start) if value > 0 else -math.inf
        return (value - self.start) / (self.stop - self.start)

    def slope(self, share: float) -> float:
        """d value/d share."""
        if self.scale == "log":
            return float(self.value(share)) * math.log(self.stop / self.start)
        return self.stop - self.start


def bounds_of(problem: Problem, key: str) -> tuple[float, float]:
    """The least and the largest value that a parameter may have."""
    low, high = -math.inf, math.inf
    field = problem.parameters[key].field
    for name, limit in bounds_in(field).items() if field else ():
        if name in ("ge", "gt"):
            low = limit if name == "ge" else math.nextafter(limit, math.inf)
        else:
            high = limit if name == "le" else math.nextafter(limit, -math.inf)
    return low, high


def check_key(problem: Problem, key: object, *place: str) -> None:
    """Refuse what is no key of a parameter by which Λ can be differentiated.

    Args:
        place: where it stands in a table, such as ("x", "key").

    Raises:
        TableError: with this place.
    """
    problem = checked_problem(problem)
    if key not in (known := problem.differentiable):
        inert = [name for half in problem.sections.values() for name in half.inert]
        is_inert = isinstance(key, str) and key.rpartition(".")[2] in inert
        told = f"; {' and '.join(inert)} are not in the linear theory" if is_inert else ""
        text = f"got {shown(key)};{nearest(key, known)} must be one of {', '.join(known) or 'none'}{told}"
        raise TableError(f"{text}; choose one of them", *place)


def check_axes(problem: Problem, x: Axis, y: Axis) -> None:
    """Refuse axes that span no frame. Raises `TableError` with the axis."""
    for name, axis in (("x", x), ("y", y)):
        if not isinstance(axis, Axis):
            raise TableError(f"got {shown(axis)} as an axis; must be an Axis", name)
        check_key(problem, axis.key, name, "key")
        check_ends(problem, axis, name)
    if x.key == y.key:
        text = f'got "{y.key}" for both axes; must be two parameters; choose another for one of them'
        raise TableError(text, "y", "key")


def check_ends(problem: Problem, axis: Axis, *place: str) -> None:
    """Refuse an axis that ends where its parameter may not be. Raises `TableError` with a place around it."""
    low, high = bounds_of(problem, axis.key)
    for name, value in (("start", axis.start), ("stop", axis.stop)):
        if (field := problem.parameters[axis.key].field) and not low <= value <= high:
            text = f"got {value}; {axis.key} must be {accepted(field)}; choose another value"
            raise TableError(text, *place, name)
