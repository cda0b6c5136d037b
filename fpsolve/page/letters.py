"""Letters that an output whose encoding has only ASCII does not have, as what is nearest to them."""

from __future__ import annotations

import codecs
from typing import Any

HANDLER = "fpsolve.nearest"
"""The name of `_nearest` among the error handlers of Python's encodings."""
NEAREST = {
    "λ": "lambda", "Λ": "Lambda", "δ": "delta", "ξ": "xi", "φ": "phi", "ω": "omega", "ρ": "rho", "τ": "tau", "ε": "eps",
    "±": "+-", "≤": "<=", "≥": ">=", "′": "'", "″": "''", "−": "-", "²": "^2", "³": "^3", "‖": "||", "⟨": "<", "⟩": ">",
    "∞": "inf", "ẋ": "x'", "₀": "0", "₁": "1", "₂": "2",
}  # fmt: skip


def encodable(text: str, encoding: str) -> str:
    """A text as an output with this encoding shows it."""
    return text.encode(encoding, errors=HANDLER).decode(encoding)


def _nearest(failure: Any) -> tuple[str, int]:
    """What is nearest to letters that cannot be encoded, or "?", and where to go on."""
    return "".join(NEAREST.get(each, "?") for each in failure.object[failure.start : failure.end]), failure.end


codecs.register_error(HANDLER, _nearest)
