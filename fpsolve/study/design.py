"""Designs: the values of parameters of a case with which a quantity has a wanted value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from fpsolve.analysis.inverse import Design, design, units_of
from fpsolve.analysis.target import Target, target_of
from fpsolve.analysis.zero import Axis
from fpsolve.case.case import Case
from fpsolve.case.sections import DesignSection
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

    def expectation(self, case: Case) -> dict[str, Any] | None:
        """What a case with these values expects, as its file states it; None where its p are others."""
        if self.found is None or (self.target.kind == "moment" and not case.moments.has(self.target.p)):
            return None
        order = {"p": self.target.p} if self.target.kind == "moment" else {}
        scale = max(self.found.found.scale, abs(self.target.value))
        least = max(10 * self.found.found.error_estimate, case.rtol * scale)
        return {
            "quantity": self.target.kind, **order, "value": self.target.value, "atol": float(f"{least:.1g}"),
            "source": "the design that this case is",
        }  # fmt: skip


def designed(case: Case) -> DesignSection:
    """What is wanted of a case. Raises `FpsolveError` where nothing is."""
    if case.design is not None:
        return case.design
    raise FpsolveError(
        f"{case.path}: design: missing; name what is wanted and by which parameter, as with "
        '--for "stability_index = 1" --by oscillator.c1 --from -2 --to 0'
    )


def refuse_no_design(case: Case) -> None:
    """Refuse a case without a design, or with several curves. Raises `FpsolveError`."""
    designed(case)
    if case.vary:
        raise FpsolveError(
            f"{case.path}: vary: a design starts from one set of parameters; remove [vary], or write --set vary={{}}"
        )


def solve_design(case: Case, progress: Callable[[], None] = lambda: None) -> DesignOutcome:
    """The design of a case, see `refuse_no_design`; or why there is none.

    Args:
        progress: called after each solve.
    """
    wanted, problem = designed(case), case.problem
    axes = tuple(Axis(each.key, *ends, each.scale) for each in wanted.by if (ends := each.ends(problem)) is not None)
    units = units_of(problem, axes, {each.key: each.unit for each in wanted.by if each.unit is not None})
    begun = DesignOutcome(target_of(wanted.target), axes, units)
    try:
        found = design(problem, wanted.target, axes, units=units, budget=case.budget, progress=progress)
    except FpsolveError as failure:
        return replace(begun, reason=failure.message)
    return replace(begun, reason=found.reason) if isinstance(found, Absent) else replace(begun, found=found)
