"""The range of a parameter: a side of a chart, or what a design may change."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.target import said
from fpsolve.arrays import shown
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.problem import Problem, checked_problem


def axis_faults(
    start: float, stop: float, scale: str, at: Sequence[float]
) -> Iterator[tuple[tuple[str | int, ...], float | None, str]]:
    """What is wrong with the numbers of an axis: where, which value, and a sentence."""
    if not start < stop:
        yield (), None, f"got start = {start}, stop = {stop}; must be start < stop; exchange the two"
        return
    if scale == "log" and start <= 0:
        remedy = 'must be > 0 where scale = "log"; use a positive start, or scale = "linear"'
        yield ("start",), start, f"got {start}; {remedy}"
    for i, value in enumerate(at):
        if not start <= value <= stop:
            known = f"must be from start = {start} to stop = {stop}; remove it, or widen the frame"
            yield ("at", i), value, f"got {value}; {known}"


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

    key: str
    start: float
    stop: float
    scale: Literal["linear", "log"] = "linear"
    at: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for place, _, text in axis_faults(self.start, self.stop, self.scale, self.at):
            raise ValueError(f"{place[0]}: {text}" if place else text)

    def value(self, share: Any) -> Any:
        """The parameter at a share of the way from start to stop."""
        if self.scale == "log":
            value = self.start * (self.stop / self.start) ** np.asarray(share)
        else:
            value = self.start + (self.stop - self.start) * np.asarray(share)
        return np.clip(value, self.start, self.stop)[()]

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
    for limit in () if field is None else field.metadata:
        low = max(low, getattr(limit, "ge", low), math.nextafter(getattr(limit, "gt", -math.inf), math.inf))
        high = min(high, getattr(limit, "le", high), math.nextafter(getattr(limit, "lt", math.inf), -math.inf))
    return low, high


def check_key(problem: Problem, key: Any) -> None:
    """Refuse what is no key of a parameter by which Λ can be differentiated. Raises `ValueError`."""
    known = checked_problem(problem).differentiable
    if key not in known:
        raise ValueError(f"got {shown(key)} as a parameter; must be one of {', '.join(known) or 'none'}")


def check_axes(problem: Problem, x: Axis, y: Axis) -> None:
    """Refuse axes that span no frame. Raises `ValueError`."""
    known = checked_problem(problem).differentiable
    for axis in (x, y):
        if not isinstance(axis, Axis):
            raise ValueError(f"got {shown(axis)} as an axis; must be an Axis")
        if axis.key not in known:
            raise ValueError(f"got {axis.key} as an axis; the parameters are {', '.join(known) or 'none'}")
        check_ends(problem, axis)
    if x.key == y.key:
        raise ValueError(f"both axes are {x.key}; choose another parameter for one of them")


def check_ends(problem: Problem, axis: Axis) -> None:
    """Refuse an axis that ends where its parameter may not be. Raises `ValueError`."""
    for name, value in (("start", axis.start), ("stop", axis.stop)):
        try:
            problem.at({axis.key: value})
        except ValidationError as failure:
            if failure.errors()[0]["loc"]:  # of this parameter alone
                raise ValueError(f"got {axis.key} with {name} = {value:g}: {said(failure)}") from failure
        except ValueError:  # with other values of the other parameters it may be one
            continue
