"""Prove bounds on the exponents that hold with certainty."""

from __future__ import annotations

from pathlib import Path
from time import monotonic
from typing import Annotated

from cyclopts import Parameter

from fpsolve.commands.errors import print_error
from fpsolve.commands.options import ALL_OPTIONS, CHECK_FAILED, NOT_CONVERGED, Reporting
from fpsolve.errors import FpsolveError
from fpsolve.messages import escaped

ProvenCases = Annotated[list[Path] | None, Parameter(help="Case files.", consume_multiple=True)]


def prove(
    cases: ProvenCases = None,
    *,
    width: float | None = None,
    check: Path | None = None,
    options: Reporting = ALL_OPTIONS,
) -> int:
    """Prove bounds on the exponents that hold with certainty; write them with certificates into OUT/<case>/proof.json.

    A bound takes at most half of [budget] seconds of processor time and a third more.
    The bounds on δ_p together take at most twice as much.
    Needs python-flint: pip install 'fpsolve[proof]'.

    Exit codes: 0 proven, 3 bounds are farther apart than wanted; with --check 0 accepted, 1 rejected, 2 malformed.

    Example: fpsolve prove cases/fig1.toml --width 1e-9

    Args:
        width: Wanted distance of the bounds, in 1/time; if omitted, 1e-7 of the scale of each number.
        check: Prove nothing, but verify a proof.json from its certificates alone.
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.results import done_of
    from fpsolve.workflow.prove import check_proof, prove_case, refuse_unprovable_case, show

    if (check is None) == (not cases):
        raise FpsolveError("name either cases to prove, or with --check a proof.json to verify")
    if check is not None:
        if width is not None or options != Reporting(quiet=options.quiet):
            raise FpsolveError("--check takes a proof.json and nothing else, as that says all that is verified")
        checked = check_proof(check)
        for text in checked.objections:
            print_error(f"{check}: {text}")
        bounds = f"bounds on {checked.claims.count} number{'s' * (checked.claims.count != 1)}"
        if checked.objections:
            objections = f"{len(checked.objections)} objection{'s' * (len(checked.objections) > 1)}"
            print(f"rejected: {escaped(str(check))} ({objections}, {bounds})")
            return CHECK_FAILED
        unfinished = "" if checked.claims.complete else "; what proved them was interrupted"
        print(f"accepted: {escaped(str(check))} ({bounds} follow from their certificates{unfinished})")
        print("note: parameters are labels; the bounds are of the matrices and rates that the certificates state")
        return 0
    code, loaded = 0, options.load(cases or [])
    for case in loaded:
        refuse_unprovable_case(case, width)
    pool = options.pool()
    for case in loaded:
        start = monotonic()
        proofs = prove_case(case, options.out, width=width, pool=pool, watch=options.watch())
        if not options.quiet:
            print_blocks(show(case, proofs))
        unmet = sum(not each.is_met for each in proofs)
        what = done_of(case, len(proofs), unmet, "not as close as wanted")
        options.print_written(case, what, monotonic() - start)
        if unmet:
            code = NOT_CONVERGED
    return code
