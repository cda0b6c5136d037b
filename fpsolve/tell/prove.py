"""Proven bounds as tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

from fpsolve.case.case import Case
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.proofs.certificate import Enclosure
from fpsolve.proofs.claims import verdicts
from fpsolve.proofs.questions import StabilityIndexEnclosure
from fpsolve.solve.prove import SetProof
from fpsolve.tell.blocks import Block, Column, Grid, Sentence
from fpsolve.tell.sets import Cells, grid_of
from fpsolve.tell.text import EACH, PROOFS, ROWS

NOT_PROVEN = "not proven"
"""The word where no bound is proven."""
FATES = {1: "grows", -1: "decays", 0: "open"}
"""The fate of a path or a moment by the sign of its exponent."""


def show(case: Case, proofs: Sequence[SetProof]) -> Iterator[Block]:
    """The bounds and what follows from them."""
    if len(proofs) > EACH:
        yield proofs_grid(case, proofs)
        return
    for proof in proofs:
        yield Sentence("", case.heading(proof.parameter_set))
        told = proof.verdicts
        if sum(found is not None and found.sign != 0 for _, found in proof.moments) > PROOFS:
            path = verdicts([], 0 if proof.exponent is None else proof.exponent.sign)
            told = [*path, f"of {len(proof.moments)} moments {_counted(proof)}"]
        if told:
            yield Sentence(f"Proven: {'; '.join(told)}.")
        yield proof_grid(proof)


def proof_grid(proof: SetProof) -> Grid:
    """The bounds on Λ at each p, λ and δ_p, how far they are apart, and what the moment or almost every path does."""
    columns = [Column("quantity"), Column("≥"), Column("≤"), Column("width", 2), Column("what it says", 1)]
    grid = Grid("", columns)
    bounds: list[tuple[str, Enclosure | StabilityIndexEnclosure | None, str]]
    bounds = [(f"Λ({p:.10g})", found, _fate(p, found)) for p, found in proof.moments]
    if (path := proof.exponent) is not None:
        bounds.append((LYAPUNOV_EXPONENT.symbol, path, FATES[path.sign] if path.is_proven else NOT_PROVEN))
    if proof.stability_index is not None:
        bounds.append(
            (STABILITY_INDEX.symbol, proof.stability_index, "" if proof.stability_index.is_proven else NOT_PROVEN)
        )
    for symbol, found, fate in bounds:
        row = ["", "", ""]
        if found is not None and found.is_proven:
            size = found.upper - found.lower
            width = f"{size:.0e}".replace("inf", "∞") if size else "0"
            is_met = not isinstance(found, Enclosure) or found.is_met
            row = [*bounds_text(found), width if is_met else f"{width}, too wide"]
        grid.rows.append([symbol, *row, fate])
    return grid


def proofs_grid(case: Case, proofs: Sequence[SetProof]) -> Grid:
    """How many Λ(p) are proven of each parameter set, the bounds on λ, and what becomes of paths and moments."""

    def cells(proof: SetProof) -> Cells:
        count = sum(found is not None and found.is_proven for _, found in proof.moments)
        yield Column("proven"), f"{count} of {len(proof.moments)}"
        path = proof.exponent
        bounds = f"in [{', '.join(bounds_text(path))}]" if path and path.is_proven else NOT_PROVEN
        yield Column(LYAPUNOV_EXPONENT.symbol, 1), bounds if path else ""
        yield Column("paths", 2), FATES[path.sign] if path else ""
        if len(proof.moments) > PROOFS:
            yield Column("moments", 3), _counted(proof)
        else:
            yield from ((Column(f"p = {p:.10g}", 3), _fate(p, found)) for p, found in proof.moments)

    return grid_of(case, proofs[:ROWS], cells)


def _fate(p: float, found: Enclosure | None) -> str:
    if found is None or not found.is_proven:
        return "not tried" if found is None else NOT_PROVEN
    return FATES[found.sign] if p else "is constant"


def _counted(proof: SetProof) -> str:
    """ "31 grow, 1 decays"."""
    signs = [found.sign for _, found in proof.moments if found is not None]
    counts = {word: signs.count(sign) for sign, word in FATES.items() if sign}
    told = [f"{n} {word if n == 1 else word.removesuffix('s')}" for word, n in counts.items() if n]
    return ", ".join(told) or "none is known"


def bounds_text(found: Enclosure | StabilityIndexEnclosure) -> tuple[str, str]:
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
