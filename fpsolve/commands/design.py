"""`fpsolve design`: the parameters with which a number has a wanted value."""

from __future__ import annotations

from collections.abc import Sequence
from json import dumps
from time import monotonic
from typing import Annotated

from cyclopts import Parameter

from fpsolve.commands.options import CHECK_FAILED, NOT_CONVERGED, OPTIONS_OF_FILES, Cases, Writing
from fpsolve.errors import FpsolveError


def design(
    cases: Cases,
    *,
    target: Annotated[
        str | None,
        Parameter(
            name="--for",
            help="What is wanted: 'stability_index = 1', 'lyapunov_exponent = -0.01' or 'moment(2) = 0'; as [design] "
            "target of the case states it if omitted.",
        ),
    ] = None,
    by: Annotated[
        list[str] | None,
        Parameter(
            help="A parameter that may change, such as oscillator.c1. With several the nearest point is found: that "
            "with the smallest relative changes.",
            negative="",
        ),
    ] = None,
    start: Annotated[
        list[float] | None,
        Parameter(
            name="--from", help="Its smallest value, one for each --by; half of its value if omitted.", negative=""
        ),
    ] = None,
    stop: Annotated[
        list[float] | None,
        Parameter(name="--to", help="Its largest value, one for each --by; twice its value if omitted.", negative=""),
    ] = None,
    json: Annotated[bool, Parameter(help="Print design.json, one line for each case.", negative="")] = False,
    options: Writing = OPTIONS_OF_FILES,
) -> int:
    """Find the values of parameters with which λ, Λ(p) or δ_p has a wanted value.

    Write design.toml, the case with these values, and design.json into OUT/<case>/.

    Exit codes: 0 found, 1 it cannot be reached in the range, 2 bad input, 3 not converged.

    Example: fpsolve design cases/theorem.toml --for "stability_index = 1" --by oscillator.c1 --from -1 --to 1
    """
    from fpsolve.page.page import Note
    from fpsolve.page.terminal import print_blocks
    from fpsolve.workflow.design import design_case, found_of, refuse_no_design, show

    code, loaded = 0, options.load(cases, design_options(target, by, start, stop))
    for case in loaded:
        refuse_no_design(case)
    for case in loaded:
        begun = monotonic()
        outcome = design_case(case, options.out, watch=options.watch(is_json=json))
        if json:
            lines = (options.out / case.name / "design.json").read_text(encoding="utf-8").splitlines()
            print(" ".join(line.strip() for line in lines))
        is_short = options.quiet or json
        print_blocks(each for each in show(case, outcome) if isinstance(each, Note) or not is_short)
        if not json:
            options.print_written(case, found_of(outcome), monotonic() - begun)
        if outcome.is_out_of_reach:
            code = max(code, CHECK_FAILED)
        elif outcome.found is None:
            code = NOT_CONVERGED
    return code


def design_options(
    target: str | None, by: Sequence[str] | None, start: Sequence[float] | None, stop: Sequence[float] | None
) -> dict[str, str]:
    """The keys of [design] that options state, by what was typed."""
    stated = (
        {f"--for {dumps(target, ensure_ascii=False)}": f"design.target={dumps(target)}"} if target is not None else {}
    )
    ends = {"--from": ("start", start or ()), "--to": ("stop", stop or ())}
    for option, (_, values) in ends.items():
        if len(values) not in (0, len(by or ())):
            raise FpsolveError(
                f"got {len(values)} {option} for {len(by or ())} --by; must be one for each --by, or none"
            )
    if by:
        entries = []
        for i, key in enumerate(by):
            own = [f"{name} = {values[i]!r}" for name, values in ends.values() if values]
            entries.append(f"{{ {', '.join([f'key = {dumps(key)}', *own])} }}")
        typed = [f"--by {key}" for key in by] + [
            f"{option} {each:g}" for option, (_, some) in ends.items() for each in some
        ]
        stated[" ".join(typed)] = f"design.by=[{', '.join(entries)}]"
    return stated
