"""F of a target over a frame of two parameters, with its exact gradient."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal, Protocol

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.scan import Sample
from fpsolve.analysis.target import Distance, Target, line_of_value, said
from fpsolve.arrays import FloatArray, shown
from fpsolve.budget import Meter, OverBudget
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget
from fpsolve.messages import Code, Message
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


def is_none(reason: Message) -> bool:
    """Whether there is no F for a reason, and it is not only not resolved."""
    return reason.tells_of(Code.NO_PROBLEM) or reason.code in (Code.TAILS, Code.INFINITE_VARIANCE)


class Known(Protocol):
    """The points of a line that were solved, also by an earlier run."""

    def find(self, rtol: float, at: FloatArray) -> Sample | Message | None:
        """F at (u, v), or why there is none."""

    def keep(self, rtol: float, at: FloatArray, found: Sample | Message) -> None:
        """Keep it."""


class ZeroField:
    """F of a target over the unit square, with its gradient.

    Args:
        target: what F is.
        problem: the problem with the values of all other parameters.
        axes: the parameters.
        budget: for a solve.
        rtol: of F, relative to its scale.
        seconds: of the processor for all values together.
        spent: what is said where they do not suffice.
        known: points that need not be solved again.

    Attributes:
        stopped: what was said, or None.
    """

    def __init__(
        self,
        target: Target,
        problem: Problem,
        axes: tuple[Axis, Axis],
        budget: Budget,
        rtol: float,
        seconds: float,
        spent: Message,
        known: Known | None,
    ) -> None:
        self._axes, self._rtol, self._known = axes, rtol, known
        settings = {"rtol": rtol, "of_value": line_of_value(choose(problem), target), "budget": budget}
        self._distance = Distance(problem, target, [axis.key for axis in axes], **settings)
        self._meter, self._spent = Meter(seconds, number=target.symbol), spent
        self.stopped: Message | None = None

    def __call__(self, at: FloatArray) -> Sample:
        """F at (u, v).

        Raises:
            FpsolveError: there is none, or the time does not suffice.
        """
        found = self._known.find(self._rtol, at) if self._known else None
        if found is None:
            found = self._solved(at)
            if self._known:
                self._known.keep(self._rtol, at, found)
        if isinstance(found, Message):
            raise NotConverged(found)
        return found

    def _solved(self, at: FloatArray) -> Sample | Message:
        """F, or why there is none."""
        try:
            with self._meter.running():
                return self._at(at)
        except OverBudget:
            self.stopped = self._spent
            return self.stopped
        except FpsolveError as failure:
            return failure.message

    @property
    def seconds(self) -> float:
        """Of the processor, so far."""
        return self._meter.spent

    def _at(self, at: FloatArray) -> Sample:
        """F at (u, v), from a solve. Raises `FpsolveError`."""
        places = list(zip(self._axes, at.tolist(), strict=True))
        found = self._distance(np.array([axis.value(share) for axis, share in places]))
        slopes = [axis.slope(share) for axis, share in places]
        return found._replace(at=at, gradient=found.gradient * slopes, rtol=self._rtol)
