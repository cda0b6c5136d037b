"""A case with other values as the text of a file: the case as it was written, with its comments."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Comment, Table

from fpsolve.case.case import Case
from fpsolve.case.toml import document_of, loads
from fpsolve.explain import is_number
from fpsolve.model.faults import table_of


def rewritten(case: Case, values: Mapping[str, float], expect: Mapping[str, Any] | None, folder: Path) -> str:
    """The text of a case with other values of some parameters, and with what the command line has changed.

    Files that the case names are named from the new place.

    Args:
        values: of the parameters by their keys, such as "oscillator.c1".
        expect: what is expected instead of what the case expects; nothing if None.
        folder: where the file will be.
    """
    data = _data(case, folder)
    for key, value in values.items():
        _set(data, key, value)
    for name in [name for name, each in data.items() if name == "expect" or each in ({}, [])]:
        del data[name]
    text = _with_data(case.text, data)
    return text if expect is None else f"{text}\n{tomlkit.dumps({'expect': [expect]})}"


def of_one_curve(case: Case, values: Mapping[str, float | str], p: Sequence[float], quantities: Collection[str]) -> str:
    """The text of a case in its folder with one curve, of these parameters: what it varies, draws or expects is gone.

    Args:
        values: of the parameters by their keys; those that it varies are among them.
        p: the orders of the moments.
        quantities: what it computes at least.
    """
    gone = "expect", "vary", "figure"
    data = {name: each for name, each in _data(case, case.path.parent).items() if name not in gone}
    for key, value in values.items():
        _set(data, key, value)
    if [*p] != case.p.tolist():
        data["moments"]["p"] = [*p]
    if (names := case.output.names) is not None and not {*quantities} <= {*names}:
        data["output"]["quantities"] = [*dict.fromkeys((*names, *quantities))]
    return _with_data(case.text, data)


def with_noise(case: Case, noise: str, folder: Path) -> str:
    """The text of a case with other sections of noise, at its end, and without what it expects.

    Args:
        noise: their text.
        folder: where the file will be.
    """
    data = {name: each for name, each in _data(case, folder).items() if name not in ("noise", "expect")}
    return _with_data(case.text, data) + noise


def _data(case: Case, folder: Path) -> dict[str, Any]:
    """What a case says with the changes of the command line, seen from a folder."""
    document = document_of(case.text)
    for change in case.overrides:
        document.override(change, change)
    if file := table_of(document.data.get("mesh")).get("file"):
        document.data["mesh"]["file"] = Path(os.path.relpath(case.path.parent / file, folder)).as_posix()
    return document.data


def _set(data: dict[str, Any], key: str, value: float | str) -> None:
    """Set a parameter where a case states it, or else as the only value of a key that is varied."""
    section, _, name = key.rpartition(".")
    for base in (section, "system") if section == "oscillator" else (section,):
        for inner in ((), ("parameters",)):
            table: Any = data
            for part in (*base.split("."), *inner):
                table = table_of(table).get(part)
            stated: Any = table_of(table).get(name)
            for place, last in ((table, name), (stated, "value")):
                if is_number(table_of(place).get(last)):
                    place[last] = value
                    return
    data.setdefault("vary", {})[key] = [value]


def _with_data(text: str, data: Mapping[str, Any]) -> str:
    """A text of TOML with other data, in the order and with the comments that it has."""
    document = tomlkit.parse(text)
    _update(document, data)
    found = tomlkit.dumps(document)
    return (found if loads(found) == data else tomlkit.dumps(data)).rstrip("\n") + "\n"


def _update(table: Any, data: Mapping[str, Any]) -> None:
    """Give a table the entries of data, as deep as both are tables; others stay as they are written."""
    for key in [key for key in table if key not in data]:
        _remove(table, key)
    for key, value in data.items():
        old = table.get(key)
        if isinstance(value, dict) and isinstance(old, dict):
            _update(old, value)
        elif old is None or old.unwrap() != value or type(old.unwrap()) is not type(value):
            table[key] = value


def _remove(table: Any, key: str) -> None:
    """Remove an entry; comments after the last value of a section stay, as they speak of the next one."""
    names, item = list(table), table[key]
    before = table[names[names.index(key) - 1]]
    if isinstance(item, Table) and isinstance(before, Table) and before is not item:
        after = list(takewhile(lambda entry: entry[0] is None, reversed(item.value.body)))
        for _, each in reversed(after) if any(isinstance(each, Comment) for _, each in after) else ():
            before.value.append(None, each)
    del table[key]
