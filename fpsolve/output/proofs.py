"""Proven bounds as proof.json, and as tables on the terminal."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from pathlib import Path
from typing import Any

from rich.text import Text

from fpsolve import __version__
from fpsolve.analysis.excursions import SYMBOL
from fpsolve.case.case import Case
from fpsolve.data import written
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX
from fpsolve.files import write_text
from fpsolve.output.screen import Cell, Column, Grid, Screen
from fpsolve.output.terminal import MOST_ROWS, MOST_TABLES, varied_columns
from fpsolve.proofs.certificate import Enclosure
from fpsolve.proofs.claims import plain, verdicts
from fpsolve.proofs.questions import ExcursionBound, IndexEnclosure
from fpsolve.proofs.statement import DECIMAL
from fpsolve.study.prove import CurveProof

PROOF = "proof.json"
NOT_PROVEN = "not proven"
MOST_TOLD, LONGEST = 4, 12
"""Of so many moments at most a sentence tells each; and of so many digits at most a p is told in a table."""
WORDS = {1: "grows", -1: "decays", 0: "open"}


def write_proof(case: Case, proofs: Sequence[CurveProof], folder: Path, *, is_whole: bool) -> None:
    """proof.json: for each curve its parameters, and every bound with the certificate from which it follows.

    A bound has a line. Numbers among the parameters are written as the decimals of which the bounds hold.
    """
    head = {"fpsolve": __version__, "case": case.name, "complete": is_whole}
    lines = ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items())
    curves = []
    for proof in proofs:
        written = {key: _line(value) for key, value in proof.curve.parameters.items()}
        written |= {key: text for key, text in proof.stated.parameters.items() if DECIMAL.fullmatch(text)}
        moments = ",\n".join(f"    {_moment(p, found)}" for p, found in proof.moments)
        parts = {
            "parameters": f"{{{', '.join(f'{json.dumps(key)}: {text}' for key, text in written.items())}}}",
            "moments": f"[\n{moments}\n   ]",
            "lyapunov_exponent": "null" if proof.exponent is None else _line(_bound(proof.exponent)),
            "stability_index": "null" if proof.index is None else _index(proof.index),
            "verdicts": _line(proof.verdicts),
        }
        if proof.excursions:
            rare = ", ".join(_excursion(sense, each) for sense, each in proof.excursions.items())
            parts["excursions"] = f"[{rare}]"
        text = ",\n".join(f"   {json.dumps(key)}: {value}" for key, value in parts.items())
        curves.append(f"  {{\n{text}\n  }}")
    write_text(folder / PROOF, "\n".join(["{", f'{lines},\n "curves": [', ",\n".join(curves), " ]", "}", ""]))


def _bound(found: Enclosure | None) -> dict[str, Any]:
    """lower, upper and the certificate; null where nothing is proven."""
    if found is None or found.certificate is None:
        return {"lower": None, "upper": None, "certificate": None}
    ends = (end if math.isfinite(end) else None for end in (found.lower, found.upper))
    return dict(zip(("lower", "upper"), ends, strict=True)) | {"certificate": found.certificate.model_dump(mode="json")}


def _moment(p: str, found: Enclosure | None) -> str:
    """The bounds on Λ(p); p as the decimal of which they hold."""
    return f'{{"p": {p}, {_line(_bound(found))[1:]}'


def _index(found: IndexEnclosure) -> str:
    """Bounds on δ_p, and Λ at two p beside it."""
    ends = (found.lower, found.upper) if found.is_proven else (None, None)
    moments = ", ".join(_moment(p, each) for p, each in found.moments)
    return f'{{"lower": {_line(ends[0])}, "upper": {_line(ends[1])}, "moments": [{moments}]}}'


def _excursion(sense: str, found: ExcursionBound) -> str:
    """A bound of excursions, and the bounds on Λ(p) from which it follows."""
    return f'{{"sense": "{sense}", "factor": {_line(found.factor)}, "moment": {_moment(found.p, found.moment)}}}'


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


def _line(data: Any) -> str:
    return json.dumps(data, allow_nan=False, ensure_ascii=False)


def print_proofs(case: Case, proofs: Sequence[CurveProof]) -> None:
    """The bounds and what follows from them: a table for each curve, or of many curves a row each."""
    screen = Screen.of()
    if len(proofs) > MOST_TABLES:
        screen.show(proofs_grid(case, proofs))
        return
    for proof in proofs:
        screen.show(proof_grid(case, proof))
        indices = [(LYAPUNOV_EXPONENT.symbol, proof.exponent), (STABILITY_INDEX.symbol, proof.index)]
        screen.packed([f"{symbol} {between(found)}" for symbol, found in indices if found is not None])
        told = proof.verdicts
        if sum(found is not None and found.sign != 0 for _, found in proof.moments) > MOST_TOLD:
            path = verdicts([], 0 if proof.exponent is None else proof.exponent.sign)
            told = [*path, f"of {len(proof.moments)} moments {_counted(proof)}"]
        if told:
            screen.say(f"Proven: {'; '.join(told)}.")
        if proof.excursion is not None:
            rare = excursion_in_words(proof)
            screen.say(f"Proven: {rare}." if rare else f"{SYMBOL} {NOT_PROVEN}")
        screen.lines([""])


def proof_grid(case: Case, proof: CurveProof) -> Grid:
    symbol = MOMENT.symbol
    columns = [Column("p"), Column(f"{symbol} ≥"), Column(f"{symbol} ≤"), Column("width", 2), Column("the moment", 1)]
    grid = Grid(case.heading(proof.curve), columns)
    for p, found in proof.moments:
        fate = _fate(p, found)
        row: list[Cell] = [_order(p), "", "", "", Text(fate, "bold red") if fate == NOT_PROVEN else fate]
        if found is not None and found.is_proven:
            width = f"{found.width:.0e}".replace("inf", "∞") if found.width else "0"
            row[1:4] = [*bounds_text(found), Text(width, "" if found.is_met else "yellow")]
        grid.rows.append(row)
    return grid


def proofs_grid(case: Case, proofs: Sequence[CurveProof]) -> Grid:
    """What varies, how many Λ(p) are proven, the bounds on λ, and what becomes of paths and moments."""
    has_exponent = any(proof.exponent is not None for proof in proofs)
    p = [p for p, _ in proofs[0].moments]
    headings = [f"p = {_order(each)}" for each in p] if len(p) <= MOST_TOLD else ["moments"]
    columns = [*varied_columns(case), Column("proven")]
    columns += [Column(LYAPUNOV_EXPONENT.symbol, 1), Column("paths", 2)] * has_exponent
    grid = Grid(case.headline, [*columns, *[Column(heading, 3) for heading in headings]])
    for proof in proofs[:MOST_ROWS]:
        proven = sum(found is not None and found.is_proven for _, found in proof.moments)
        exponent = ["", ""] if proof.exponent is None else [between(proof.exponent), WORDS[proof.exponent.sign]]
        words = [_fate(each, found) for each, found in proof.moments]
        moments = words if len(p) <= MOST_TOLD else [_counted(proof)]
        varied = map(written, proof.curve.varied.values())
        grid.rows.append([*varied, f"{proven} of {len(p)}", *exponent[: 2 * has_exponent], *moments])
    return grid


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


def between(found: Enclosure | IndexEnclosure) -> str:
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
