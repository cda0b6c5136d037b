"""The page of all keys of case files, from the declarations that check them: `python docs/keys.py` writes it."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import get_args

from fpsolve.case import Case
from fpsolve.exponent import Budget
from fpsolve.model.kinds import KINDS, kind_of
from fpsolve.model.parameters import example_of, meaning_of

PAGE = Path(__file__).parent / "reference/keys.md"


def row(*cells: object) -> str:
    return "| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells) + " |\n"


def table(*heads: str) -> str:
    return "\n" + row(*heads) + row(*["---"] * len(heads))


def default_of(value: object) -> str:
    value = getattr(value, "value", value)
    return repr(value) if isinstance(value, str | int | float | bool | tuple | None) else "..."


SIGNS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤", "min_length": "at least", "max_length": "at most"}


LENGTHS = ("min_length", "max_length")


def range_of(field) -> str:
    found = []
    lengths = {name: value for rule in field.metadata for name in LENGTHS if (value := getattr(rule, name, None))}
    if len(lengths) == 2:
        noun = "letters" if field.annotation is str else "entries"
        return f"{' to '.join(str(lengths[name]) for name in LENGTHS)} {noun}"
    for rule in field.metadata:
        for name, sign in SIGNS.items():
            if (value := getattr(rule, name, None)) is not None:
                found.append(f"{sign} {value:g}" if isinstance(value, float | int) else f"{sign} {value}")
    return ", ".join(found)


def _fields(fields) -> str:
    text = table("key", "meaning", "range", "if omitted", "example")
    for name, each in fields.items():
        default = "" if each.is_required() else each.get_default(call_default_factory=True)
        default = "" if default in (None, "", ()) or default_of(default) == "..." else f"`{default_of(default)}`"
        required = "**required**" if each.is_required() else default
        symbol = dict(each.json_schema_extra or {}).get("symbol")
        meaning = f"{symbol}: {meaning_of(each)}" if symbol else meaning_of(each)
        example = example_of(each)
        text += row(f"`{name}`", meaning, range_of(each), required, f"`{example}`" if example else "")
    return text


def keys() -> str:
    """Every key of a case file, from the declarations that check it."""
    about = "These are all keys of a case file, from the code that checks them. [Case files](cases.md) has examples."
    text = f"# Keys\n\n{about}\n\n## Sections\n{_fields(Case.model_fields)}"
    for name in KINDS["system"]:
        kind = kind_of("system", name)
        text += f'\n## `[system]` with `kind = "{name}"`\n\n{_first(kind)}\n'
        text += _fields({**kind.stated, **kind.__pydantic_fields__})
    for name in KINDS["noise"]:
        usual = kind_of("noise", name)
        for kind in (usual, *usual.variants):
            own = [
                f"`{key}`"
                for key in kind.__pydantic_fields__
                if kind is not usual and key not in usual.__pydantic_fields__
            ]
            by = f", stated by {' and '.join(own)}" if own else ""
            text += f'\n## `[noise]` with `kind = "{name}"`{by}\n\n{_first(kind)}\n'
            text += _fields({**kind.stated, **kind.__pydantic_fields__})
    for section, field in Case.model_fields.items():
        made = Budget if section == "budget" else _section_of(field.annotation)
        if made is not None:
            brackets = f"[[{section}]]" if section == "expect" else f"[{section}]"
            text += f"\n## `{brackets}`\n\n{_first(made)}\n" + _fields(getattr(made, "__pydantic_fields__", {}))
    return text


def _section_of(annotation):
    for each in (annotation, *get_args(annotation)):
        if inspect.isclass(each) and hasattr(each, "model_fields"):
            return each
    return None


def _first(item) -> str:
    first = (inspect.getdoc(item) or "").partition("\n\n")[0].replace("\n", " ").replace("*", "\\*").replace("`[", "[")
    text = re.sub(r"^\[+\w+\]+: ", "", first)  # the heading names the section
    return re.sub(r"^([a-z]{2,}|a)\b", lambda word: word[0].capitalize(), text)  # a symbol keeps its case


if __name__ == "__main__":
    PAGE.write_text(keys(), encoding="utf-8")
