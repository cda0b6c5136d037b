"""Greek letters and signs in words, for an output whose encoding has none of them."""

from __future__ import annotations

import codecs
import unicodedata

HANDLER = "fpsolve.spelt"
"""The name under which `codecs` knows what puts words in the place of letters that cannot be encoded."""
_NAMED = {"EPSILON": "epsilon", "LAMDA": "lambda"}
_SIGNS = {
    "′": "'", "″": "''", "−": "-", "–": "-", "±": "+-", "≤": "<=", "≥": ">=", "≠": "!=", "∞": "inf", "×": "x",
    "·": "*", "‖": "||", "⟨": "<", "⟩": ">", "→": "->", "…": "...", "√": "sqrt", "∂": "d", "ẋ": "x'", "ẍ": "x''",
    "½": "1/2", "²": "^2", "³": "^3", "⁴": "^4", "“": '"', "”": '"', "’": "'",
}  # fmt: skip


def spelt(text: str, encoding: str) -> str:
    """A text as an output with this encoding can show it."""
    return text.encode(encoding, errors=HANDLER).decode(encoding)


def _spelt(failure: UnicodeError) -> tuple[str, int]:
    """For `codecs`: what cannot be encoded, in words."""
    if not isinstance(failure, UnicodeEncodeError):
        raise failure
    return "".join(map(_word, failure.object[failure.start : failure.end])), failure.end


def _word(letter: str) -> str:
    """A letter in ASCII; "?" where nothing is like it."""
    if letter in _SIGNS:
        return _SIGNS[letter]
    case, _, name = unicodedata.name(letter, "").removeprefix("GREEK ").partition(" LETTER ")
    if unicodedata.name(letter, "").startswith("GREEK ") and name.isalpha():
        word = _NAMED.get(name, name.lower())
        return word.capitalize() if case == "CAPITAL" else word
    return unicodedata.normalize("NFKD", letter).encode("ascii", errors="ignore").decode() or "?"


codecs.register_error(HANDLER, _spelt)
