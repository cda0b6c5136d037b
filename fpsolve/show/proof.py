"""Proven bounds: a table for each curve, or a row each, and what follows of paths and moments."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from functools import partial
from pathlib import Path
from typing import Any

from fpsolve.analysis.excursions import SYMBOL
from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.files import plain_text
from fpsolve.model.problem import Problem
from fpsolve.output.proofs import PROOF
from fpsolve.page.limits import EACH, PROOFS, ROWS
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.proofs.balls import MissingFlint
from fpsolve.proofs.certificate import Enclosure, MalformedProof
from fpsolve.proofs.claims import CurveClaims, claims_from, plain, verdicts
from fpsolve.proofs.questions import ExcursionBound, IndexEnclosure
from fpsolve.proofs.statement import statement_of
from fpsolve.show.curves import Shown, table_of
from fpsolve.study.prove import CurveProof
from fpsolve.study.results import CurveResult

NOT_PROVEN = "not proven"
"""The word where no bound is proven."""
LONGEST = 12
"""Digits of a p at most in a table."""
MOST_CHECKED = 3e7
"""Operations for the certificates of a curve that a report checks: some seconds."""
WORDS = {1: "grows", -1: "decays", 0: "open"}
"""The fate of a path or a moment by the sign of its exponent."""


def show(case: Case, proofs: Sequence[CurveProof]) -> Iterator[Block]:
    """The bounds and what follows from them."""
    if len(proofs) > EACH:
        yield proofs_grid(case, proofs)
        return
    for proof in proofs:
        yield Sentence("", case.heading(proof.curve))
        yield proof_grid(proof)
        told = proof.verdicts
        if sum(found is not None and found.sign != 0 for _, found in proof.moments) > PROOFS:
            path = verdicts([], 0 if proof.exponent is None else proof.exponent.sign)
            told = [*path, f"of {len(proof.moments)} moments {_counted(proof)}"]
        if told:
            yield Sentence(f"Proven: {'; '.join(told)}.")
        if proof.excursion is not None:
            rare = excursion_in_words(proof)
            yield Sentence(f"Proven: {rare}." if rare else f"{SYMBOL} {NOT_PROVEN}")


def proof_grid(proof: CurveProof) -> Grid:
    """The bounds on Λ at each p, λ and δ_p, how far they are apart, and what the moment or almost every path does."""
    columns = [Column("quantity"), Column("≥"), Column("≤"), Column("width", 2), Column("what it says", 1)]
    grid = Grid("", columns)
    bounds: list[tuple[str, Enclosure | IndexEnclosure | None, str]]
    bounds = [(f"Λ({_order(p)})", found, _fate(p, found)) for p, found in proof.moments]
    if (path := proof.exponent) is not None:
        bounds.append((LYAPUNOV_EXPONENT.symbol, path, WORDS[path.sign] if path.is_proven else NOT_PROVEN))
    if proof.index is not None:
        bounds.append((STABILITY_INDEX.symbol, proof.index, "" if proof.index.is_proven else NOT_PROVEN))
    for symbol, found, fate in bounds:
        row = ["", "", ""]
        if found is not None and found.is_proven:
            size = found.upper - found.lower
            width = f"{size:.0e}".replace("inf", "∞") if size else "0"
            is_met = not isinstance(found, Enclosure) or found.is_met
            row = [*bounds_text(found), width if is_met else f"{width}, too wide"]
        grid.rows.append([symbol, *row, fate])
    return grid


def proofs_grid(case: Case, proofs: Sequence[CurveProof]) -> Grid:
    """How many Λ(p) are proven of each curve, the bounds on λ, and what becomes of paths and moments."""
    p, symbol = [p for p, _ in proofs[0].moments], LYAPUNOV_EXPONENT.symbol

    def proven(proof: CurveProof) -> str:
        return f"{sum(found is not None and found.is_proven for _, found in proof.moments)} of {len(p)}"

    def fate(i: int, proof: CurveProof) -> str:
        return _fate(*proof.moments[i])

    shown = [
        Shown(Column("proven"), proven),
        Shown(Column(symbol, 1), lambda each: _between(each.exponent) if each.exponent else ""),
        Shown(Column("paths", 2), lambda each: WORDS[each.exponent.sign] if each.exponent else ""),
    ]
    each_p = [Shown(Column(f"p = {_order(each)}", 3), partial(fate, i)) for i, each in enumerate(p)]
    return table_of(
        case, proofs[:ROWS], shown + (each_p if len(p) <= PROOFS else [Shown(Column("moments", 3), _counted)])
    )


def _fate(p: str, found: Enclosure | None) -> str:
    if found is None or not found.is_proven:
        return "not tried" if found is None else NOT_PROVEN
    return WORDS[found.sign] if float(p) else "is constant"


def _order(p: str) -> str:
    """p for the eye."""
    return text if len(text := plain(p)) <= LONGEST else f"{float(p):.10g}"


def _counted(proof: CurveProof) -> str:
    """ "31 grow, 1 decays"."""
    signs = [found.sign for _, found in proof.moments if found is not None]
    counts = {word: signs.count(sign) for sign, word in WORDS.items() if sign}
    told = [f"{n} {word if n == 1 else word.removesuffix('s')}" for word, n in counts.items() if n]
    return ", ".join(told) or "none is known"


def _between(found: Enclosure | IndexEnclosure) -> str:
    """ "in [0.0010257274, 0.0010257275]"."""
    return f"in [{', '.join(bounds_text(found))}]" if found.is_proven else NOT_PROVEN


def bounds_text(found: Enclosure | IndexEnclosure) -> tuple[str, str]:
    """Both bounds with two digits of how far they are apart, of a single one five digits, rounded outward."""
    if found.lower == found.upper:
        return f"{found.lower:g}", f"{found.upper:g}"
    known = [end for end in (found.lower, found.upper) if math.isfinite(end)]
    size, digits = (found.upper - found.lower, 2) if len(known) > 1 else (abs(known[0]) or 1.0, 5)
    step = Decimal(1).scaleb(math.floor(math.log10(size)) + 1 - digits)
    low, high = (
        f"{Decimal(repr(end)).quantize(step, rounding)}" if math.isfinite(end) else f"{end}".replace("inf", "∞")
        for end, rounding in ((found.lower, ROUND_FLOOR), (found.upper, ROUND_CEILING))
    )
    return low, high


def excursion_in_words(proof: CurveProof) -> str:
    """What is proven of excursions: "0.757 A^-0.3784 ≤ P(sup ‖x‖ ≥ A) ≤ 1.34 A^-0.3783 for every A > 1"."""
    found, text = proof.excursions, SYMBOL
    if not found:
        return ""
    if "lower" in found:
        text = f"{_power(found['lower'], ROUND_FLOOR)} ≤ {text}"
    if "upper" in found:
        text = f"{text} ≤ {_power(found['upper'], ROUND_CEILING)}"
    return f"{text} for every A > 1, a start (1, 0) and any noise at the start"


def _power(found: ExcursionBound, rounding: str) -> str:
    """c A^−p with the digits of c rounded outward."""
    factor = Decimal(repr(found.factor))
    step = Decimal(1).scaleb(factor.adjusted() - 3)
    return f"{factor.quantize(step, rounding)} A^-{found.p}"


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
        is_own = all((each.motion, each.chain) == (own.motion, own.chain) for each in certificates)
        objection = next(claims.objections(), "") if is_own else "its certificates are of another system"
    except MissingFlint as missing:
        return [f"{says} was not checked here: {missing}."]
    except (FpsolveError, TypeError, ValueError) as failure:
        objection = str(failure)
    return [f"{says} does not follow: {objection}." if objection else f"Proven: {'; '.join(claims.verdicts)}."]
