"""Greek letters and signs in words, for an output whose encoding does not have them."""

from __future__ import annotations

import codecs
import unicodedata
from typing import Any

HANDLER = "fpsolve.spelt"
"""The name under which `codecs` knows `_spell`, which spells letters that an encoding does not have."""
_SIGNS = {
    "′": "'", "″": "''", "−": "-", "–": "-", "±": "+-", "≤": "<=", "≥": ">=", "≠": "!=", "∞": "inf", "×": "x",
    "·": "*", "‖": "||", "⟨": "<", "⟩": ">", "→": "->", "…": "...", "√": "sqrt", "∂": "d", "ẋ": "x'", "ẍ": "x''",
    "½": "1/2", "²": "^2", "³": "^3", "⁴": "^4", "“": '"', "”": '"', "’": "'",
}  # fmt: skip


def spelt(text: str, encoding: str) -> str:
    """A text as an output with this encoding can show it: Greek letters and signs in words, where it has none."""
    return text.encode(encoding, errors=HANDLER).decode(encoding)


def _spell(failure: Any) -> tuple[str, int]:
    """For `codecs`: what cannot be encoded, in words of ASCII; "?" where nothing is like it."""
    words = []
    for letter in failure.object[failure.start : failure.end]:
        name = unicodedata.name(letter, "")
        case, _, greek = name.removeprefix("GREEK ").partition(" LETTER ")
        if letter in _SIGNS:
            words.append(_SIGNS[letter])
        elif name.startswith("GREEK ") and greek.isalpha():
            word = "lambda" if greek == "LAMDA" else greek.lower()
            words.append(word.capitalize() if case == "CAPITAL" else word)
        else:
            words.append(unicodedata.normalize("NFKD", letter).encode("ascii", errors="ignore").decode() or "?")
    return "".join(words), failure.end


codecs.register_error(HANDLER, _spell)
