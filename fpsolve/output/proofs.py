"""Proven bounds as proof.json."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fpsolve import __version__
from fpsolve.case.case import Case
from fpsolve.files import write_text
from fpsolve.proofs.certificate import Enclosure
from fpsolve.proofs.questions import ExcursionBound, IndexEnclosure
from fpsolve.proofs.statement import DECIMAL
from fpsolve.study.prove import CurveProof

PROOF = "proof.json"


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


def _line(data: Any) -> str:
    return json.dumps(data, allow_nan=False, ensure_ascii=False)
