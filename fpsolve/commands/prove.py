"""Prove rigorous bounds on the exponents."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from operator import call
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fpsolve import __version__
from fpsolve.case.case import Case
from fpsolve.commands.errors import CHECK_FAILED, NOT_CONVERGED, print_error
from fpsolve.commands.options import (
    FLAGS,
    Done,
    Flags,
    Options,
    kept,
    on_cases,
    saying_if_interrupted,
)
from fpsolve.errors import FpsolveError
from fpsolve.files import writable, write_text
from fpsolve.messages import escaped
from fpsolve.pool import SERIAL, Pool
from fpsolve.proofs.claims import Claims, SetClaims, StabilityIndexBound, bound_of, moment_of
from fpsolve.proofs.questions import StabilityIndexEnclosure
from fpsolve.results.folders import own_folder
from fpsolve.solve.prove import (
    PROVEN_BOUNDS,
    PROVEN_RECORDS,
    Answer,
    SetProof,
    asked_of,
    check_proof,
    gathered,
    is_kept,
    key_of_bounds,
    questions,
    refuse_unprovable_case,
)
from fpsolve.solve.records import Records, answered
from fpsolve.tell.progress import BOUNDS, SILENT, Phase, Watch
from fpsolve.tell.prove import show
from fpsolve.tell.reports import shown_at_the_end, write_report
from fpsolve.tell.solved import done_of
from fpsolve.tell.terminal import print_blocks

PROOF = "proof.json"
"""The file of proven bounds."""


def prove_case(
    case: Case,
    out: str | Path = "results",
    *,
    width: float | None = None,
    pool: Pool = SERIAL,
    watch: Watch = SILENT,
) -> list[SetProof]:
    """Prove bounds on Λ at every p of every parameter set, and on λ and δ_p; write proof.json into `out`/<case>/.

    Args:
        width: wanted upper − lower; 1e-7 of the scale of each number if None.
        pool: who proves.

    Raises:
        FpsolveError: a parameter set cannot be proven, or the width is none; nothing is written.
        OutputError: the folder cannot be made or written to, or another run writes into it.
        KeyboardInterrupt: its text says what is kept.
    """
    refuse_unprovable_case(case, width)
    answers, proofs, total = list[Answer](), list[SetProof](), len(asked_of(case)) * case.planned
    folder, started = Path(out) / case.name, datetime.now(UTC)

    def finish() -> None:
        proofs[:], is_whole = gathered(case, answers), len(answers) == total
        if proofs:
            with writable(folder):
                write_proof(case, proofs, folder, is_whole=is_whole)
            blocks = show(case, proofs)
            write_report(
                case, folder, watch, blocks, started=started, files=[PROOF], complete=is_whole, name="proof.html"
            )

    with (
        own_folder(folder, "prove", case=case),
        saying_if_interrupted(lambda: kept(len(answers), f"of {total} bounds", folder)),
        watch.bar(Phase(case.name, "proving", total, BOUNDS)) as progress,
        pool,
        shown_at_the_end(finish),
    ):
        records, asked = Records(folder / PROVEN_RECORDS), questions(case, width)
        of_all = answered(records, pool, call, asked, kind=PROVEN_BOUNDS, key=key_of_bounds, keeps=is_kept)
        for _, found, is_known in of_all:
            answers.append(found)
            progress(failed=not found.is_proven, known=is_known)
    return proofs


def write_proof(case: Case, proofs: Sequence[SetProof], folder: Path, *, is_whole: bool) -> None:
    """proof.json: for each parameter set its parameters, and every bound with the certificate from which it follows."""
    sets = [
        SetClaims(
            parameters=dict(proof.parameter_set.parameters),
            moments=[moment_of(p, found) for p, found in proof.moments],
            lyapunov_exponent=bound_of(proof.exponent) if proof.exponent else None,
            stability_index=_index(proof.stability_index) if proof.stability_index else None,
            verdicts=proof.verdicts,
        )
        for proof in proofs
    ]
    claims = Claims(fpsolve=__version__, case=case.name, complete=is_whole, sets=sets)
    write_text(folder / PROOF, claims.model_dump_json(indent=1) + "\n")


def _index(found: StabilityIndexEnclosure) -> StabilityIndexBound:
    """Bounds on δ_p, and Λ at two p beside it."""
    lower, upper = (found.lower, found.upper) if found.is_proven else (None, None)
    return StabilityIndexBound(lower=lower, upper=upper, moments=[moment_of(p, each) for p, each in found.moments])


ProvenCases = Annotated[list[Path] | None, Parameter(help="Case files.", consume_multiple=True)]


def prove(
    cases: ProvenCases = None,
    *,
    width: float | None = None,
    check: Path | None = None,
    flags: Flags = FLAGS,
) -> int:
    """Prove rigorous bounds on the exponents; write them with certificates into OUT/<case>/proof.json.

    A bound takes at most two thirds of [budget] seconds of processor time;
    the bounds on δ_p together twice that.
    Needs python-flint: pip install 'fpsolve[proof]'.

    Exit codes: 0 proven, 3 bounds are farther apart than wanted; with --check 0 accepted, 1 rejected, 2 malformed.

    Example: fpsolve prove cases/fig1.toml --width 1e-9

    Args:
        width: Wanted distance of the bounds, in 1/time; if omitted, 1e-7 of the scale of a number.
        check: Prove nothing, but verify a proof.json from its certificates alone.
    """

    if (check is None) == (not cases):
        raise FpsolveError("name either cases to prove, or with --check a proof.json to verify")
    if check is not None:
        if width is not None or flags != Flags(Options(flags.options.quiet)):
            raise FpsolveError("--check takes a proof.json and no other option")
        return verify(check)

    def work(case: Case, pool: Pool) -> Done:
        proofs = prove_case(case, flags.out, width=width, pool=pool, watch=flags.watch())
        if not flags.options.quiet:
            print_blocks(show(case, proofs))
        unmet = sum(not each.is_met for each in proofs)
        what = done_of(case, len(proofs), unmet, "not as close as wanted")
        return Done(what, NOT_CONVERGED if unmet else 0)

    refuse = partial(refuse_unprovable_case, width=width)
    return on_cases(cases or [], flags.options, work, refuse=refuse, workers=flags.workers, out=flags.out)


def verify(path: Path) -> int:
    """Say whether a proof.json follows from its certificates; the exit code."""
    checked = check_proof(path)
    for text in checked.objections:
        print_error(f"{path}: {text}")
    bounds = f"bounds on {checked.claims.count} number{'s' * (checked.claims.count != 1)}"
    if checked.objections:
        objections = f"{len(checked.objections)} objection{'s' * (len(checked.objections) > 1)}"
        print(f"rejected: {escaped(str(path))} ({objections}, {bounds})")
        return CHECK_FAILED
    unfinished = "" if checked.claims.complete else "; the run that proved them was interrupted"
    print(f"accepted: {escaped(str(path))} ({bounds} follow from their certificates{unfinished})")
    print("note: the parameters are labels; the bounds hold for the matrices and rates in the certificates")
    return 0
