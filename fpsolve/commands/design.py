"""Find parameters with which λ, Λ(p) or δ_p has a wanted value."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import tomlkit
from cyclopts import Parameter

from fpsolve.analysis.axis import Axis
from fpsolve.case.case import Case
from fpsolve.case.rewrite import rewritten
from fpsolve.commands.errors import CHECK_FAILED, NOT_CONVERGED
from fpsolve.commands.options import (
    ANEW,
    OPTIONS,
    Cases,
    Done,
    Options,
    on_cases,
    print_in_one_line,
    saying_if_interrupted,
)
from fpsolve.exponent.error import Estimate
from fpsolve.files import writable, write_json, write_text
from fpsolve.pool import Pool
from fpsolve.results.csv_json import Content, facts_of, head
from fpsolve.results.folders import own_folder
from fpsolve.solve.design import DesignOutcome, solve_design, wanted_of
from fpsolve.tell.blocks import Note
from fpsolve.tell.design import found_of, show
from fpsolve.tell.progress import SOLVES, Phase
from fpsolve.tell.terminal import print_blocks


def write_design(case: Case, outcome: DesignOutcome, folder: Path, facts: Content) -> None:
    """design.json, and where there is a design, design.toml: the case with its values."""
    found, target, before = outcome.found, outcome.target, case.problem.values
    changed: Mapping[str, Estimate] = found.values if found else {}
    content = {
        **head(case),
        "complete": found is not None,
        "target": {"quantity": target.kind, "p": target.p if target.kind == "moment" else None, "value": target.value},
        "by": [
            {
                **{name: vars(axis)[name] for name in ("key", "start", "stop", "scale")},
                "unit": outcome.units[axis.key],
                "before": before[axis.key],
                "after": after and after.value,
                "error_estimate": after and after.error_estimate,
            }
            for axis in outcome.by
            for after in [changed.get(axis.key)]
        ],
        "found": found and {"value": found.found.value, "error_estimate": found.found.error_estimate},
        "distance": found and found.distance,
        "solves": found and found.solves,
        "parameters": dict(before),
        "message": outcome.reason,
        **facts,
    }
    write_json(folder / "design.json", content)
    if found is not None:
        values = {key: each.value for key, each in changed.items()}
        expected = outcome.expectation(case)
        more = f"\n{tomlkit.dumps({'expect': [expected]})}" if expected else ""
        write_text(folder / "design.toml", rewritten(case, folder, values, without=["expect"], more=more))


def design(
    cases: Cases,
    *,
    target: Annotated[str | None, Parameter(name="--for")] = None,
    by: Annotated[
        list[str] | None,
        Parameter(
            help="A parameter that may change, such as oscillator.c1. With several, fpsolve finds the point with the "
            "smallest relative changes."
        ),
    ] = None,
    start: Annotated[list[float] | None, Parameter(name="--from")] = None,
    stop: Annotated[list[float] | None, Parameter(name="--to")] = None,
    json: bool = False,
    options: Options = OPTIONS,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("results"),
) -> int:
    """Find the values of parameters with which λ, Λ(p) or δ_p has a wanted value.

    Write design.toml, the case with these values, and design.json into OUT/<case>/.

    Exit codes: 0 found, 1 not within reach in the range, 2 bad input, 3 not converged.

    Example: fpsolve design cases/theorem.toml --for "stability_index = 1" --by oscillator.c1 --from -1 --to 1

    Args:
        target: What is wanted: 'stability_index = 1', 'lyapunov_exponent = -0.01',
            'moment(2) = 0', or 'square(x) = 0.01' of a forced motion.
        start: Smallest value of each --by; if omitted, half of its value.
        stop: Largest value of each --by; if omitted, twice its value.
        json: Print design.json, one line for each case.
    """

    def wanted(case: Case) -> tuple[str, tuple[Axis, ...]]:
        return wanted_of(case, target, by or (), start or (), stop or ())

    def work(case: Case, _: Pool) -> Done:
        folder, started = out / case.name, datetime.now(UTC)
        with (
            own_folder(folder, "design", case=case),
            saying_if_interrupted(lambda: "; nothing is kept", ANEW),
            writable(folder),
        ):
            with options.watch(is_json=json).bar(Phase(case.name, "design", unit=SOLVES)) as progress:
                outcome = solve_design(case, *wanted(case), progress)
            write_design(case, outcome, folder, facts_of(case, started))
        if json:
            print_in_one_line(folder / "design.json")
        is_short = options.quiet or json
        print_blocks(each for each in show(case, outcome) if isinstance(each, Note) or not is_short)
        code = CHECK_FAILED if outcome.is_out_of_reach else NOT_CONVERGED if outcome.found is None else 0
        return Done("" if json else found_of(outcome), code)

    return on_cases(cases, options, work, refuse=wanted, out=out)
