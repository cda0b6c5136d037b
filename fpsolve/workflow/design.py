"""Designs: the parameters with which a number has a wanted value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fpsolve.analysis.inverse import Design, units_of
from fpsolve.analysis.inverse import design as nearest_design
from fpsolve.analysis.target import Target, target_of
from fpsolve.analysis.zero import Axis
from fpsolve.case.case import Case
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.rewrite import rewritten
from fpsolve.case.sections import DesignSection
from fpsolve.data import plain_unit, short_names
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Absent, digits
from fpsolve.files import writable, write_json, write_text
from fpsolve.messages import Code, Message
from fpsolve.output.tables import head
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.results.text import plural
from fpsolve.show.notes import note_on
from fpsolve.workflow.folders import ANEW, DESIGNED, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import SILENT, SOLVES, Phase, Watch
from fpsolve.workflow.reports import facts_since


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
        found = nearest_design(problem, wanted.target, axes, units=units, budget=case.budget, progress=progress)
    except FpsolveError as failure:
        return replace(begun, reason=failure.message)
    return replace(begun, reason=found.reason) if isinstance(found, Absent) else replace(begun, found=found)


def write_design(case: Case, outcome: DesignOutcome, folder: Path, facts: Mapping[str, Any]) -> None:
    """design.json, and where there is a design, design.toml: the case with its values."""
    write_json(folder / "design.json", summary(case, outcome, facts))
    found = outcome.found
    if found is not None:
        values = {key: each.value for key, each in found.values.items()}
        write_text(folder / "design.toml", rewritten(case, values, outcome.expectation(case), folder))


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
                "key": axis.key,
                "start": axis.start,
                "stop": axis.stop,
                "scale": axis.scale,
                "unit": outcome.units[axis.key],
            }
            | {"before": before[axis.key]}
            | {"after": changed[axis.key].value if found else None}
            | {"error_estimate": changed[axis.key].error_estimate if found else None}
            for axis in outcome.by
        ],
        "found": found and {"value": found.found.value, "error_estimate": found.found.error_estimate},
        "distance": found and found.distance,
        "solves": found and found.solves,
        "parameters": dict(case.curve({}).parameters),
        "message": outcome.reason and outcome.reason.words(CASE_WORDS),
        **facts,
    }


def design_case(case: Case, out: str | Path = "results", *, watch: Watch = SILENT) -> DesignOutcome:
    """Find the design of a case, and write design.json and, where there is one, design.toml into `out`/<case>/.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: the case has no design, or several curves; nothing is written.
        KeyboardInterrupt: nothing is kept.
    """
    refuse_no_design(case)
    started = datetime.now(UTC)
    with (
        own_folder(case, out, (DESIGNED,)) as folder,
        saying_if_interrupted(lambda: "; nothing is kept", ANEW),
        writable(folder),
    ):
        with watch.bar(Phase(case.name, "design", unit=SOLVES)) as progress:
            found = solve_design(case, progress)
        write_design(case, found, folder, facts_since(case, started))
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
        value, unit = found.values[key], case.about(key).unit
        numbers = digits(value.value, value.error_estimate), f"{value.error_estimate:.0e}"
        unit = "" if unit in ("1", "unknown") else plain_unit(unit)
        grid.rows.append([name, f"{found.start.values[key]:.10g}", *numbers, unit])
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
