"""Designs: the parameters with which a number has a wanted value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import tomlkit

from fpsolve.analysis.axis import Axis
from fpsolve.analysis.inverse import Design, axes_of, start_and_stop, units_of
from fpsolve.analysis.inverse import design as nearest_design
from fpsolve.analysis.target import Target, target_of
from fpsolve.case.case import Case
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.rewrite import rewritten
from fpsolve.data import short_names
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Absent, digits
from fpsolve.files import writable, write_json, write_text
from fpsolve.messages import Code, Message
from fpsolve.output.tables import facts_of, head
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.results.text import plural
from fpsolve.show.notes import note_on
from fpsolve.workflow.folders import ANEW, DESIGNED, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import SOLVES, Phase, Watch


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


def wanted_of(
    case: Case, target: str | None, by: Sequence[str], start: Sequence[float], stop: Sequence[float]
) -> tuple[str, tuple[Axis, ...]]:
    """What is wanted of a case, and the ranges of the parameters that may change for it.

    Args:
        target: such as "stability_index = 1".
        by: the keys of these parameters.
        start, stop: the ends of their ranges, one for each or none; from half to twice the value without them.

    Raises:
        FpsolveError: nothing is wanted, it is none of this case, or the case has several curves.
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
        p = wanted.p if wanted.kind == "moment" else 0.0
        if told := case.method.reason(p, wanted.quantity.symbol):
            raise ValueError(told.words(CASE_WORDS))
        for i, key in enumerate(by):
            if start and stop:
                ranges.append(Axis(key, start[i], stop[i]))
            elif key not in problem.differentiable:
                ranges.append(key)  # which is refused
            elif (usual := start_and_stop(problem, key)) is None:
                raise ValueError(f"{key} is 0, so that its range must be stated; write --from and --to")
            else:
                ranges.append(Axis(key, start[i] if start else usual.start, stop[i] if stop else usual.stop))
        return target, axes_of(problem, ranges)
    except ValueError as failure:
        raise FpsolveError(f"{case.path}: {failure}") from None


def solve_design(case: Case, target: str, by: tuple[Axis, ...], progress: Callable[[], None]) -> DesignOutcome:
    """The design of a case, see `wanted_of`; or why there is none.

    Args:
        progress: called after each solve.
    """
    outcome = DesignOutcome(target_of(target), by, units_of(case.problem, by, {}))
    try:
        found = nearest_design(case.problem, target, by, budget=case.budget, progress=progress)
    except FpsolveError as failure:
        return replace(outcome, reason=failure.message)
    return replace(outcome, reason=found.reason) if isinstance(found, Absent) else replace(outcome, found=found)


def write_design(case: Case, outcome: DesignOutcome, folder: Path, facts: Mapping[str, Any]) -> None:
    """design.json, and where there is a design, design.toml: the case with its values."""
    write_json(folder / "design.json", summary(case, outcome, facts))
    found = outcome.found
    if found is not None:
        values = {key: each.value for key, each in found.values.items()}
        expected = outcome.expectation(case)
        more = f"\n{tomlkit.dumps({'expect': [expected]})}" if expected else ""
        write_text(folder / "design.toml", rewritten(case, folder, values, without=["expect"], more=more))


def summary(case: Case, outcome: DesignOutcome, facts: Mapping[str, Any]) -> dict[str, Any]:
    """What became of a design."""
    found, target, before = outcome.found, outcome.target, case.problem.values
    changed = found.values if found else {}
    return {
        **head(case),
        "complete": found is not None,
        "target": {"quantity": target.kind, "p": target.p if target.kind == "moment" else None, "value": target.value},
        "by": [
            {
                **{name: getattr(axis, name) for name in ("key", "start", "stop", "scale")},
                "unit": outcome.units[axis.key],
                "before": before[axis.key],
                "after": changed[axis.key].value if found else None,
                "error_estimate": changed[axis.key].error_estimate if found else None,
            }
            for axis in outcome.by
        ],
        "found": found and {"value": found.found.value, "error_estimate": found.found.error_estimate},
        "distance": found and found.distance,
        "solves": found and found.solves,
        "parameters": dict(before),
        "message": outcome.reason and outcome.reason.words(CASE_WORDS),
        **facts,
    }


def design_case(case: Case, target: str, by: tuple[Axis, ...], out: Path, *, watch: Watch) -> DesignOutcome:
    """Find the design of a case, see `wanted_of`; write design.json and, where there is one, design.toml.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        KeyboardInterrupt: nothing is kept.
    """
    started = datetime.now(UTC)
    with (
        own_folder(case, out, (DESIGNED,)) as folder,
        saying_if_interrupted(lambda: "; nothing is kept", ANEW),
        writable(folder),
    ):
        with watch.bar(Phase(case.name, "design", unit=SOLVES)) as progress:
            found = solve_design(case, target, by, progress)
        write_design(case, found, folder, facts_of(case, started))
    return found


def show(case: Case, outcome: DesignOutcome) -> Iterator[Block]:
    """The parameters, and how near the wanted value is; or the reason."""
    found, keys = outcome.found, [axis.key for axis in outcome.by]
    if outcome.reason is not None:
        yield note_on(case.name, outcome.reason)
    if found is None:
        return
    columns = [Column("parameter"), Column("before"), Column("after"), Column("± error", 1), Column("unit", 2)]
    grid = Grid(case.headline, columns)
    for key, name in zip(keys, short_names(keys), strict=True):
        value = found.values[key]
        numbers = digits(value.value, value.error_estimate), f"{value.error_estimate:.0e}"
        grid.rows.append([name, f"{found.start.values[key]:.10g}", *numbers, case.about(key).unit_in_words])
    yield grid
    symbol, value = outcome.target.quantity.symbol, found.found
    met = digits(value.value, value.error_estimate)
    solves = f"{found.solves} {plural('solve', found.solves)}"
    yield Sentence(f"{symbol} = {met} ± {value.error_estimate:.0e}; wanted {outcome.target.value:.10g}; {solves}")
    if len(keys) > 1:
        measures = ", ".join(f"{key} / {outcome.units[key]:.6g}" for key in keys)
        told = f"the square root of the sum of the squares of the changes of {measures}"
        yield Sentence(f"the nearest such point, at a distance of {found.distance:.6g}: {told}")


def found_of(outcome: DesignOutcome) -> str:
    """What was written: "design.toml, 4 solves"."""
    found = outcome.found
    return "no design" if found is None else f"design.toml, {found.solves} {plural('solve', found.solves)}"
