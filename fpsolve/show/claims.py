"""What a proof.json beside results claims of their curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from fpsolve.errors import FpsolveError
from fpsolve.files import plain_text
from fpsolve.model.problem import Problem
from fpsolve.page.limits import EACH
from fpsolve.page.page import Sentence
from fpsolve.proofs.balls import MissingFlint
from fpsolve.proofs.certificate import MalformedProof
from fpsolve.proofs.claims import CurveClaims, claims_from
from fpsolve.proofs.statement import statement_of
from fpsolve.results.curve import CurveResult

PROOF = "proof.json"
"""The file of proven bounds."""
MOST_CHECKED = 3e7
"""Operations for the certificates of a curve that a report checks: some seconds."""


def show_claims(results: Sequence[CurveResult], folder: Path) -> Iterator[Sentence]:
    """What a proof.json beside few results claims of their curves: proven where it follows from its certificates."""
    claims = _claims(folder)
    for result in results if len(results) <= EACH else ():
        claimed = claims.get(frozenset(result.curve.parameters.items()))
        for number, text in enumerate(_told(claimed, result.curve.problem)):
            yield Sentence(text, result.curve.label if number == 0 else "")


def _claims(folder: Path) -> Mapping[frozenset[Any], CurveClaims]:
    """The claims of each curve by its parameters."""
    try:
        curves = claims_from(plain_text(folder / PROOF)).curves
    except (OSError, ValueError, MalformedProof):  # there is none, or it is none of ours
        return {}
    numbers = [{key: v if isinstance(v, str) else float(v) for key, v in each.parameters.items()} for each in curves]
    return {frozenset(key.items()): each for key, each in zip(numbers, curves, strict=True)}


def _told(claims: CurveClaims | None, problem: Problem) -> list[str]:
    """What is claimed, or why it is not said to be proven."""
    if claims is None or not claims.verdicts:
        return []
    bounds = [each for claim in claims.claims.values() for each in claim.bounds]
    certificates = [each.certificate for each in bounds if each.certificate is not None]
    says = f"{PROOF} says: {'; '.join(claims.verdicts)}. This"
    if sum(each.work for each in certificates) > MOST_CHECKED:
        return [f"{says} was not checked here, as that takes long; `fpsolve prove --check {PROOF}` does it."]
    try:
        own = statement_of(problem)
        is_own = all(each.statement.records == own.records for each in certificates)
        objection = next(claims.objections(), "") if is_own else "its certificates are of another system"
    except MissingFlint as missing:
        return [f"{says} was not checked here: {missing}."]
    except (FpsolveError, TypeError, ValueError) as failure:
        objection = str(failure)
    return [f"{says} does not follow: {objection}." if objection else f"Proven: {'; '.join(claims.verdicts)}."]
