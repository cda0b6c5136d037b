"""Proving the bounds of a case, and checking those of a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from fpsolve.case.case import Case
from fpsolve.files import writable
from fpsolve.output.proofs import write_proof
from fpsolve.pool import Pool, serial
from fpsolve.proofs.certificate import MalformedProof
from fpsolve.proofs.claims import Claims, claims_from
from fpsolve.reading import Unreadable, Words, read_text
from fpsolve.study.prove import Answer, CurveProof, Plan, answer, refuse_unprovable_case
from fpsolve.workflow.folders import ANEW, PROVEN, kept, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import BOUNDS, SILENT, Phase, Watch
from fpsolve.workflow.reports import facts_since, shown_at_the_end, write_report

if TYPE_CHECKING:
    from fpsolve.output.report import Reporter

EVERY = 30.0
"""Seconds after which the curves that are done are written, so that a run that is killed keeps them."""
_WORDS = Words("the proof", "a proof", "proof.json", "JSON", "make one with `fpsolve prove`")


@dataclass(frozen=True)
class Checked:
    """What became of the claims of a file.

    Attributes:
        claims: all of them.
        objections: which do not follow, and why.
    """

    claims: Claims
    objections: Sequence[str]


def prove_case(
    case: Case,
    out: str | Path = "results",
    *,
    width: float | None = None,
    pool: Pool | None = None,
    reporter: Reporter | None = None,
    watch: Watch = SILENT,
) -> list[CurveProof]:
    """Prove bounds on Λ at every p of every curve, and on λ, δ_p and excursions; write proof.json into `out`/<case>/.

    Args:
        width: wanted upper − lower; 1e-7 of the scale of each number if None.
        pool: who proves; this process if none is given.
        reporter: writes report.html, if one is wanted.

    Raises:
        FpsolveError: a curve cannot be proven, or the width is none; nothing is written.
        OutputError: the folder cannot be made or written to, or another run writes into it.
        KeyboardInterrupt: its text says what is kept.
    """
    refuse_unprovable_case(case, width)
    plan = Plan(case, width)
    answers, proofs = list[Answer](), list[CurveProof]()
    started = datetime.now(UTC)

    def show() -> None:
        if reporter is not None and proofs:
            facts, is_whole = facts_since(case, started), len(answers) == plan.total
            write_report(reporter, case, folder, watch, facts=facts, proofs=proofs, complete=is_whole)

    def write() -> list[CurveProof]:
        proofs = plan.gathered(answers)
        if proofs:
            with writable(folder):
                write_proof(plan.case, proofs, folder, is_whole=len(answers) == plan.total)
        return proofs

    with (
        own_folder(case, out, (PROVEN,)) as folder,
        saying_if_interrupted(lambda: kept(len(answers), f"of {plan.total} bounds", folder), ANEW),
        watch.bar(Phase(case.name, "proving", plan.total, BOUNDS)) as progress,
        pool or serial() as workers,
    ):
        written = monotonic()
        with shown_at_the_end(show):
            try:
                for found in workers.map(answer, plan.questions()):
                    answers.append(found)
                    progress(failed=not found.is_proven)
                    if monotonic() - written > EVERY and len(answers) % plan.each == 0:
                        write()
                        written = monotonic()
            finally:
                proofs = write()
    return proofs


def check_proof(path: Path) -> Checked:
    """Verify all claims of a proof.json from their certificates alone.

    Raises:
        MalformedProof: it is none.
        MissingFlint: python-flint is not installed.
    """
    try:
        claims = claims_from(read_text(path, _WORDS))
    except Unreadable as failure:
        raise MalformedProof(f"{path}: {failure.sentence}") from None
    except MalformedProof as failure:
        raise MalformedProof(f"{path}: {failure}; make one with `fpsolve prove`") from None
    return Checked(claims, tuple(claims.objections()))
