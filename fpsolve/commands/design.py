"""Find parameters with which λ, Λ(p) or δ_p has a wanted value."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import Annotated

from cyclopts import Parameter

from fpsolve.analysis.axis import Axis
from fpsolve.case.case import Case
from fpsolve.commands.interrupts import ANEW, saying_if_interrupted
from fpsolve.commands.options import CHECK_FAILED, NOT_CONVERGED, OPTIONS_OF_FILES, Cases, Writing
from fpsolve.files import writable
from fpsolve.results.csv_json import facts_of
from fpsolve.results.design import write_design
from fpsolve.results.folders import DESIGNED, own_folder
from fpsolve.solve.design import DesignOutcome, solve_design, wanted_of
from fpsolve.tell.blocks import Note
from fpsolve.tell.design import found_of, show
from fpsolve.tell.progress import SOLVES, Phase, Watch
from fpsolve.tell.terminal import print_blocks


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


def design(
    cases: Cases,
    *,
    target: Annotated[str | None, Parameter(name="--for")] = None,
    by: Annotated[
        list[str] | None,
        Parameter(
            help="A parameter that may change, such as oscillator.c1. With several the nearest point is found: that "
            "with the smallest relative changes."
        ),
    ] = None,
    start: Annotated[list[float] | None, Parameter(name="--from")] = None,
    stop: Annotated[list[float] | None, Parameter(name="--to")] = None,
    json: bool = False,
    options: Writing = OPTIONS_OF_FILES,
) -> int:
    """Find the values of parameters with which λ, Λ(p) or δ_p has a wanted value.

    Write design.toml, the case with these values, and design.json into OUT/<case>/.

    Exit codes: 0 found, 1 it cannot be reached in the range, 2 bad input, 3 not converged.

    Example: fpsolve design cases/theorem.toml --for "stability_index = 1" --by oscillator.c1 --from -1 --to 1

    Args:
        target: What is wanted: 'stability_index = 1', 'lyapunov_exponent = -0.01' or 'moment(2) = 0'.
        start: Its smallest value, one for each --by; half of its value if omitted.
        stop: Its largest value, one for each --by; twice its value if omitted.
        json: Print design.json, one line for each case.
    """

    code, loaded = 0, options.load(cases)
    wanted = [wanted_of(case, target, by or (), start or (), stop or ()) for case in loaded]
    for case, (what, ranges) in zip(loaded, wanted, strict=True):
        started = monotonic()
        outcome = design_case(case, what, ranges, options.out, watch=options.watch(is_json=json))
        if json:
            lines = (options.out / case.name / "design.json").read_text(encoding="utf-8").splitlines()
            print(" ".join(line.strip() for line in lines))
        is_short = options.quiet or json
        print_blocks(each for each in show(case, outcome) if isinstance(each, Note) or not is_short)
        if not json:
            options.print_written(case, found_of(outcome), monotonic() - started)
        if outcome.is_out_of_reach:
            code = max(code, CHECK_FAILED)
        elif outcome.found is None:
            code = NOT_CONVERGED
    return code
