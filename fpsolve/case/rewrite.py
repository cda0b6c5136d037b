"""A case with other values as the text of a file: the case as it was written, with its comments."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, MutableMapping
from pathlib import Path
from types import MappingProxyType

import tomlkit
from tomlkit.items import Item, Table

from fpsolve.case.case import Case
from fpsolve.case.explain import is_number
from fpsolve.case.keys import get, leaves, place_of, put
from fpsolve.case.matrices import KEYS
from fpsolve.case.toml import document_of, loads
from fpsolve.model.faults import table_of


def rewritten(
    case: Case,
    folder: Path,
    values: Mapping[str, float | str] = MappingProxyType({}),
    *,
    without: Collection[str] = (),
    others: Mapping[str, object] = MappingProxyType({}),
    more: str = "",
) -> str:
    """The text of a case with other values, and with what the command line has changed.

    Files that the case names are named from the new place.

    Args:
        folder: where the file will be.
        values: of the parameters by their keys, such as "oscillator.c1".
        without: the sections that are left out; empty ones are, too.
        others: of other keys, such as "moments.p".
        more: what stands at its end.
    """
    data = {name: each for name, each in _data(case, folder).items() if name not in without and each not in ({}, [])}
    for key, value in values.items():
        _set(data, key, value)
    for key, each in others.items():
        put(data, key, each)
    return _with_data(case.text, data) + more


def _data(case: Case, folder: Path) -> dict[str, object]:
    """What a case says with the changes of the command line, seen from a folder."""
    document = document_of(case.text)
    for change in case.overrides:
        document.override(change, change)
    for key, file in leaves(document.data):
        if isinstance(file, str) and {*key.split(".")[1:2]} & {"file", *KEYS}:
            put(document.data, key, Path(os.path.relpath(case.path.parent / file, folder)).as_posix())
    return document.data


def _set(data: dict[str, object], key: str, value: float | str) -> None:
    """Set a parameter where a case states it, or else as the only value of a key that is varied."""
    section, _, name = key.rpartition(".")
    for base in (section, "system") if section == "oscillator" else (section,):
        if is_number(get(data, place := place_of(data, f"{base}.{name}"))):
            put(data, place, value)
            return
    data["vary"] = {**table_of(data.get("vary")), key: [value]}


def _with_data(text: str, data: Mapping[str, object]) -> str:
    """A text of TOML with other data, in the order and with the comments that it has."""
    document = tomlkit.parse(text)
    _update(document, data, loads(text))
    found = tomlkit.dumps(document)
    return (found if loads(found) == data else tomlkit.dumps(data)).rstrip("\n") + "\n"


def _update(table: MutableMapping[str, object], data: Mapping[str, object], before: Mapping[str, object]) -> None:
    """Give a table the entries of data, as deep as both are tables; others stay as they are written.

    A comment beside a value that changes says what the value was.
    """
    for key in [key for key in before if key not in data]:
        del table[key]
    for key, value in data.items():
        old, inner, comment, was = before.get(key), table.get(key), "", ""
        if isinstance(inner, Item) and not isinstance(inner, Table):
            comment, was = inner.trivia.comment.lstrip("# "), inner.as_string()
        if isinstance(value, dict) and isinstance(old, dict) and isinstance(inner, MutableMapping):
            _update(inner, value, old)
        elif old != value or type(old) is not type(value):
            table[key] = value
        if comment and old != value and isinstance(made := table[key], Item):
            made.comment(f"before {was}: {comment}")
