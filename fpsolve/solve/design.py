"""Designs: the parameters with which a number has a wanted value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from fpsolve.analysis.axis import Axis
from fpsolve.analysis.inverse import Design, axes_of, start_and_stop, units_of
from fpsolve.analysis.inverse import design as nearest_design
from fpsolve.analysis.target import Target, target_of
from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Absent
from fpsolve.messages import Code, Message


@dataclass(frozen=True, eq=False)
class DesignOutcome:
    """What became of the design of a case.

    Attributes:
        target: what is wanted.
        by: the ranges of the parameters.
        units: what their changes are measured by.
        found: the design; None where there is none.
        reason: why there is none.
    """

    target: Target
    by: tuple[Axis, ...]
    units: dict[str, float]
    found: Design | None = None
    reason: Message | None = None

    @property
    def is_out_of_reach(self) -> bool:
        """Whether there is none, and that is known."""
        return self.reason is not None and self.reason.code is Code.UNREACHED

    def expectation(self, case: Case) -> dict[str, object] | None:
        """What a case with these values expects, as its file states it; None where its p are others."""
        if self.found is None or (self.target.kind == "moment" and not case.moments.has(self.target.p)):
            return None
        order = {"p": self.target.p} if self.target.kind == "moment" else {}
        scale = max(self.found.found.scale, abs(self.target.value))
        least = max(10 * self.found.found.error_estimate, case.rtol * scale)
        return {
            "quantity": self.target.name, **order, "value": self.target.value, "atol": float(f"{least:.1g}"),
            "source": "fpsolve design",
        }  # fmt: skip


def wanted_of(
    case: Case, target: str | None, by: Sequence[str], start: Sequence[float], stop: Sequence[float]
) -> tuple[str, tuple[Axis, ...]]:
    """What is wanted of a case, and the ranges of the parameters that may change for it.

    Args:
        target: such as "stability_index = 1".
        by: the keys of these parameters.
        start, stop: the ends of their ranges, one for each or none; from half to twice the value without them.

    Raises:
        FpsolveError: nothing is wanted, it is none of this case, or the case has several parameter sets.
    """
    if target is None or not by:
        text = '--for "stability_index = 1" --by oscillator.c1 --from -2 --to 0'
        raise FpsolveError(f"{case.path}: name what is wanted and by which parameter, as with {text}")
    for option, values in (("--from", start), ("--to", stop)):
        if len(values) not in (0, len(by)):
            raise FpsolveError(f"got {len(values)} {option} for {len(by)} --by; must be one for each --by, or none")
    if case.vary:
        raise FpsolveError(
            f"{case.path}: vary: a design starts from one set of parameters; remove [vary], or write --set vary={{}}"
        )
    problem, ranges = case.problem, list[str | Axis]()
    try:
        wanted = target_of(target)
        if told := case.method.reason(wanted.order, wanted.quantity.symbol):
            raise ValueError(told)
        for i, key in enumerate(by):
            if start and stop:
                ranges.append(Axis(key, start[i], stop[i]))
            elif key in problem.differentiable and (usual := start_and_stop(problem, key)):
                ranges.append(Axis(key, start[i] if start else usual.start, stop[i] if stop else usual.stop))
            else:
                ranges.append(key)  # which is refused
        return target, axes_of(problem, ranges)
    except ValueError as failure:
        raise FpsolveError(f"{case.path}: {failure}") from None


def solve_design(case: Case, target: str, by: tuple[Axis, ...], progress: Callable[[], None]) -> DesignOutcome:
    """The design of a case, see `wanted_of`; or why there is none.

    Args:
        progress: called after each solve.
    """
    outcome = DesignOutcome(target_of(target), by, units_of(case.problem, by))
    try:
        found = nearest_design(case.problem, target, by, budget=case.budget, progress=progress)
    except FpsolveError as failure:
        return replace(outcome, reason=failure.message)
    return replace(outcome, reason=found.reason) if isinstance(found, Absent) else replace(outcome, found=found)
