"""What is zero on a line of stability: λ, or Λ(p)/p, over a frame of two parameters, with its exact gradient."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.scan import Sample
from fpsolve.analysis.sensitivity import SMALL_P, Changed, held_by
from fpsolve.arrays import FloatArray, real_number, shown
from fpsolve.budget import Countdown, OverBudget, one_number
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.eigen import PairDerivatives
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.problem import Problem, checked_problem, refuse_infinite

RTOL = 1e-10
"""Error of F that is wanted of two variables, relative to its scale."""
RTOL_OF_CLOSED = 1e-7
"""Error of F that is wanted where even moments are all, relative to its scale."""
RTOL_OF_DEAR = 1e-3
"""Error of F that is wanted where it is dear, relative to its scale."""
RTOL_AT_STOP = 3e-3
"""The same of four variables with a stop, where the error falls slowly."""
ITS_SIGN = 0.3
"""Largest error of a dear F, over F, where its sign is sure."""
HALF = 0.5
"""Share of the time that is left for one value."""
NEAR = 0.1
"""Distance, in sides of the square, up to which a solve starts from that before; farther away its mesh fits no more."""


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


@dataclass(frozen=True)
class Zero:
    """What is zero on a line.

    Attributes:
        kind: of the quantity.
        p: the order of the moment, or the value of δ_p; 0 for λ.
    """

    kind: Literal["lyapunov_exponent", "moment", "stability_index"]
    p: float = 0.0

    @property
    def name(self) -> str:
        """ "lyapunov_exponent", "moment 2", "stability_index -1"."""
        return self.kind if self.kind == "lyapunov_exponent" else f"{self.kind} {self.p:g}"

    @property
    def symbol(self) -> str:
        """F, as a sentence has it."""
        return "λ" if self.p == 0 else f"Λ({self.p:g})" if self.kind == "moment" else f"Λ({self.p:g})/({self.p:g})"

    def side(self, value: float) -> str:
        """What F of this sign means: Λ(2) < 0, δ_p > -1."""
        if self.kind == "stability_index":  # Λ(p)/p increases from −∞ through 0 at δ_p
            return f"δ_p {'>' if value < 0 else '<'} {self.p:g}"
        return f"{self.symbol} {'<' if value * (self.p or 1.0) < 0 else '>'} 0"

    @property
    def equation(self) -> str:
        """What holds on the line: λ = 0, Λ(2) = 0, δ_p = -1."""
        return f"δ_p = {self.p:g}" if self.kind == "stability_index" else f"{self.symbol} = 0"

    @property
    def latex(self) -> str:
        """`equation` in LaTeX, with dollars."""
        if self.kind == "stability_index":
            return rf"$\delta_p = {self.p:g}$"
        return rf"$\Lambda({self.p:g}) = 0$" if self.p else r"$\lambda = 0$"


def zero_of(value: str | Mapping[str, float]) -> Zero:
    """What "lyapunov_exponent", {"moment": 2.0} or {"stability_index": -1.0} says. Raises `ValueError`."""
    if value == "lyapunov_exponent":
        return Zero("lyapunov_exponent")
    if isinstance(value, Mapping) and len(value) == 1:
        [(kind, p)] = value.items()
        with suppress(ValueError):
            if kind in ("moment", "stability_index") and real_number(p, kind) != 0:
                return Zero(kind, float(p))  # type: ignore[arg-type]
    raise ValueError(
        f'got {shown(value)}; must be "lyapunov_exponent", {{"moment": p}} or {{"stability_index": v}}, with a number '
        "!= 0"
    )


def said(failure: Exception) -> str:
    """What is wrong with the parameters of a problem, in one line."""
    if not isinstance(failure, ValidationError):
        return str(failure)
    texts = []
    for fault in failure.errors():
        text = str(fault.get("ctx", {}).get("error", fault["msg"]))
        texts.append(": ".join(filter(None, (".".join(map(str, fault["loc"])), text))))
    return "; ".join(texts)


def check_axes(problem: Problem, x: Axis, y: Axis) -> None:
    """Refuse axes that span no frame. Raises `ValueError`."""
    known = checked_problem(problem).differentiable
    for axis in (x, y):
        if not isinstance(axis, Axis):
            raise ValueError(f"got {shown(axis)} as an axis; must be an Axis")
        if axis.key not in known:
            raise ValueError(f"got {axis.key} as an axis; the parameters are {', '.join(known) or 'none'}")
        for name, value in (("start", axis.start), ("stop", axis.stop)):
            try:
                problem.at({axis.key: value})
            except ValidationError as failure:
                if failure.errors()[0]["loc"]:  # of this parameter alone
                    raise ValueError(f"got {axis.key} with {name} = {value:g}: {said(failure)}") from failure
            except ValueError:  # elsewhere in the frame it may be one
                continue
    if x.key == y.key:
        raise ValueError(f"both axes are {x.key}; choose another parameter for one of them")


def line_rtol(problem: Problem, zero: Zero) -> float:
    """The error of F that is wanted on a line, over its scale."""
    if problem.dimension > 2 and problem.system.stop:
        return RTOL_AT_STOP
    return RTOL_OF_CLOSED if problem.is_closed_only else RTOL_OF_DEAR if is_dear(problem, zero) else RTOL


def line_of_value(problem: Problem, zero: Zero) -> float:
    """The error of F that is enough away from a line, over F."""
    return ITS_SIGN if is_dear(problem, zero) else 0.0


def is_none(reason: Message) -> bool:
    """Whether there is no F for a reason, and it is not only not resolved."""
    return reason.tells_of(Code.NO_PROBLEM) or reason.code in (Code.TAILS, Code.INFINITE_VARIANCE)


def is_dear(problem: Problem, zero: Zero) -> bool:
    """Whether F takes elements of three axes or more, and so seconds for each point."""
    if problem.dimension > 2:
        return not (problem.is_closed_only or (zero.p > 0 and zero.p % 2 == 0))
    return len(problem.coloured.parts) > 1


@one_number("Λ at p = {:g}, and its slopes")
def ratio_with_slopes(solver: ExponentSolver, p: float, keys: Sequence[str]) -> tuple[float, float, FloatArray]:
    """Λ(p)/p, at p = 0 λ, with its error, and its derivatives by some parameters.

    Raises:
        NotConverged: it is not resolved, or see `held_by`.
        NoSuchExponent: see `held_by`.
    """
    value, error = solver.ratio_alone(p)
    if known := solver.by_moments(p):
        return value, error, known.gradient(keys) / p
    held, by_key = held_by(solver, p, {key: solver.problem.derivative(key) for key in keys})
    along = [by_key[key] for key in keys]
    around = PairDerivatives(held.whole.solution(p).pair) if abs(p) >= SMALL_P else held.around_zero
    changed = [Changed(around, by) for by in along]
    if abs(p) >= SMALL_P:
        return value, error, np.array([each.value.value / p for each in changed])
    more = [0.5 * p * each.curvature.value if p else 0.0 for each in changed]
    return value, error, np.array([each.slope.value for each in changed]) + more


class Ratio:
    """Λ(p)/p, at p = 0 λ, over some parameters θ, with its gradient; each solve starts from the one before.

    Args:
        problem: with the values of all other parameters.
        p: the order of the moment; 0 for λ.
        keys: of the parameters.
        budget: for a solve.
        rtol: of Λ(p)/p, relative to its scale.
        of_value: see `ExponentSolver`.
    """

    def __init__(
        self, problem: Problem, p: float, keys: Sequence[str], budget: Budget, rtol: float, of_value: float = 0.0
    ) -> None:
        self.problem, self.p, self.keys = problem, p, tuple(keys)
        self._own: Any = {"rtol": rtol, "of_value": of_value, "budget": budget}
        self._starts: Mapping[float, Any] = {}

    def at(self, theta: FloatArray) -> Problem:
        """The problem at θ. Raises `FpsolveError` where there is none."""
        try:
            return self.problem.at(dict(zip(self.keys, theta.tolist(), strict=True)))
        except ValueError as failure:
            raise FpsolveError(Message(Code.NO_PROBLEM, reason=said(failure))) from failure

    def solver(self, theta: FloatArray, *, is_near: bool = True) -> ExponentSolver:
        """A solver at θ; its starts are those of the last θ if this is near."""
        return ExponentSolver(self.at(theta), starts=self._starts if is_near else {}, **self._own)

    def __call__(self, theta: FloatArray, *, is_near: bool = True) -> Sample:
        """Λ(p)/p at θ. Raises `FpsolveError` where there is none."""
        p, solver = self.p, self.solver(theta, is_near=is_near)
        refuse_infinite(solver.problem, p)
        value, error, slopes = ratio_with_slopes(solver, p, self.keys)
        self._starts = solver.known
        return Sample(theta, value, slopes, error, solver.scale(p) / abs(p) if p else solver.scales.linear)


class Known(Protocol):
    """The points of a line that were solved, also by an earlier run."""

    def find(self, rtol: float, at: FloatArray) -> Sample | Message | None:
        """F at (u, v), or why there is none."""

    def keep(self, rtol: float, at: FloatArray, found: Sample | Message) -> None:
        """Keep it."""


class ZeroField:
    """F over the unit square: λ or Λ(p)/p, with its gradient.

    Args:
        zero: which of them.
        problem: the problem with the values of all other parameters.
        axes: the parameters.
        budget: for a solve.
        rtol: of F, relative to its scale; `line_rtol` if None.
        seconds: of the processor for all values together; each may take half of what is left.
        spent: what is said where they do not suffice.
        known: points that need not be solved again.

    Attributes:
        spent_seconds: of the processor, so far.
        stopped: what was said, or None.
    """

    def __init__(
        self,
        zero: Zero,
        problem: Problem,
        axes: tuple[Axis, Axis],
        budget: Budget,
        rtol: float | None = None,
        seconds: float = math.inf,
        spent: Message | None = None,
        known: Known | None = None,
    ) -> None:
        rtol = line_rtol(problem, zero) if rtol is None else rtol
        keys = [axis.key for axis in axes]
        self._axes, self._ratio = axes, Ratio(problem, zero.p, keys, budget, rtol, line_of_value(problem, zero))
        self._seconds, self._spent = seconds, spent or Message(Code.LINE_SPENT, most=seconds)
        self.spent_seconds, self.stopped = 0.0, None if seconds > 0 else self._spent
        self._before, self._rtol, self._known = np.full(2, math.inf), rtol, known

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
        left = self._seconds - self.spent_seconds
        if left <= 0:
            return self._stop()
        share = Countdown(HALF * left)
        try:
            with share.running():
                return self._at(at)
        except OverBudget as failure:
            if failure.countdown is not share:
                raise
            return self._stop()
        except FpsolveError as failure:
            return failure.message
        finally:
            self.spent_seconds += share.spent

    def _stop(self) -> Message:
        self.stopped = self._spent
        return self.stopped

    def _at(self, at: FloatArray) -> Sample:
        """F at (u, v), from a solve. Raises `FpsolveError`."""
        places = list(zip(self._axes, at.tolist(), strict=True))
        theta = np.array([axis.value(share) for axis, share in places])
        slopes = np.array([axis.slope(share) for axis, share in places])
        found = self._ratio(theta, is_near=bool(np.linalg.norm(at - self._before) <= NEAR))
        self._before = at
        return found._replace(at=at, gradient=found.gradient * slopes, rtol=self._rtol)
