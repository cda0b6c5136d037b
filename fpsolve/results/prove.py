"""The file of proven bounds, proof.json."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fpsolve import __version__
from fpsolve.case.case import Case
from fpsolve.files import write_text
from fpsolve.proofs.claims import Claims, CurveClaims, IndexBound, bound_of, moment_of
from fpsolve.proofs.questions import IndexEnclosure
from fpsolve.solve.prove import CurveProof

PROOF = "proof.json"
"""The file of proven bounds."""


def write_proof(case: Case, proofs: Sequence[CurveProof], folder: Path, *, is_whole: bool) -> None:
    """proof.json: for each curve its parameters, and every bound with the certificate from which it follows."""
    curves = [
        CurveClaims(
            parameters=dict(proof.curve.parameters),
            moments=[moment_of(p, found) for p, found in proof.moments],
            lyapunov_exponent=None if proof.exponent is None else bound_of(proof.exponent),
            stability_index=None if proof.index is None else _index(proof.index),
            verdicts=proof.verdicts,
        )
        for proof in proofs
    ]
    claims = Claims(fpsolve=__version__, case=case.name, complete=is_whole, curves=curves)
    write_text(folder / PROOF, claims.model_dump_json(indent=1) + "\n")


def _index(found: IndexEnclosure) -> IndexBound:
    """Bounds on δ_p, and Λ at two p beside it."""
    lower, upper = (found.lower, found.upper) if found.is_proven else (None, None)
    return IndexBound(lower=lower, upper=upper, moments=[moment_of(p, each) for p, each in found.moments])
