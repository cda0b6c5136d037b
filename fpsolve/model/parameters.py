"""What all parameters have in common: strict types, ranges, and words for messages, tables and figures."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field
from pydantic.fields import FieldInfo

SIZE = {"ge": 1e-15, "le": 1e15}
"""The range of a positive parameter: whatever the others are, no formula overflows or divides by nothing."""
DERIVED = {"ge": 1e-32, "le": 1e32}
"""That of what is made of such parameters."""
STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


def parameter(
    meaning: str, example: str, symbol: str = "", unit: str = "", *, name: str | None = None, **rules: Any
) -> FieldInfo:
    """All that is said about a parameter, to stand beside its type.

    Args:
        meaning: what it is, and after a semicolon a remark.
        example: a line of TOML that states it.
        symbol: in LaTeX, with dollars.
        unit: such as "rad/time".
        name: what an axis calls it; None for the meaning without the remark.
        rules: its range, by `gt`, `ge`, `lt` and `le`, and what else pydantic's `Field` takes.
    """
    return Field(
        title=name or meaning.partition(";")[0],
        description=meaning,
        examples=[example],
        json_schema_extra={"symbol": symbol, "unit": unit},
        **rules,
    )


def example_of(field: FieldInfo) -> str:
    """The line of TOML that states a `parameter`, or nothing."""
    [example] = field.examples or [""]
    return str(example)


def symbol_of(field: FieldInfo) -> str:
    """The symbol of a `parameter` in LaTeX, or nothing."""
    return _extra(field, "symbol")


def unit_of(field: FieldInfo) -> str:
    """The unit of a `parameter`, or nothing."""
    return _extra(field, "unit")


def meaning_of(field: FieldInfo) -> str:
    """What a `parameter` is, with its unit."""
    unit, meaning = unit_of(field), field.description or ""
    return f"{meaning}, in {unit}" if unit else meaning


def _extra(field: FieldInfo, name: str) -> str:
    extra = field.json_schema_extra
    return str(extra[name]) if isinstance(extra, dict) else ""
