"""A case with other values as the text of a file: the case as it was written, with its comments, where that can be."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from fpsolve.case.case import Case
from fpsolve.case.messages import is_list
from fpsolve.case.sections import is_number
from fpsolve.case.toml import Document, Scanner, document_of, dotted, loads
from fpsolve.model.faults import table_of

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def rewritten(case: Case, values: Mapping[str, float], expect: Mapping[str, Any] | None, folder: Path) -> str:
    """The text of a case with other values of some parameters, and with what the command line has changed.

    Comments are kept where every change is one of a value that the file states, or leaves a section out. Files that
    the case names are named from the new place.

    Args:
        values: of the parameters by their keys, such as "oscillator.c1".
        expect: what is expected instead of what the case expects; nothing if None.
        folder: where the file will be.
    """
    was, document = document_of(case.text), document_of(case.text)
    for change in case.overrides:
        document.override(change, change)
    data = document.data
    for key, value in values.items():
        _set(data, key, value)
    if file := table_of(data.get("mesh")).get("file"):
        data["mesh"]["file"] = Path(os.path.relpath(case.path.parent / file, folder)).as_posix()
    for name in [name for name, each in data.items() if name == "expect" or each in ({}, [])]:
        del data[name]
    end = (
        "" if expect is None else "\n[[expect]]\n" + "".join(f"{key} = {_toml(each)}\n" for key, each in expect.items())
    )
    with suppress(ValueError, LookupError):
        text = _edited(was, data)
        if loads(text) == data:
            return text.rstrip("\n") + "\n" + end
    return _dumped(data) + end


def with_noise(case: Case, noise: str, folder: Path) -> str:
    """The text of a case with other sections of noise, at its end, and without what it expects.

    Args:
        noise: their text.
        folder: where the file will be.
    """
    was, document = document_of(case.text), document_of(case.text)
    data = document.data
    if file := table_of(data.get("mesh")).get("file"):
        data["mesh"]["file"] = Path(os.path.relpath(case.path.parent / file, folder)).as_posix()
    for name in ("noise", "expect"):
        data.pop(name, None)
    with suppress(ValueError, LookupError):
        text = _edited(was, data)
        if loads(text) == data:
            return f"{text.rstrip()}\n{noise}"
    return f"{_dumped(data)}{noise}"


def _set(data: dict[str, Any], key: str, value: float) -> None:
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


def _edited(was: Document, data: Mapping[str, Any]) -> str:
    """The text with other values and without some sections. Raises `LookupError` where other changes are needed."""
    text, scanner = was.text, Scanner(was.text).scan()
    cuts = [cut for name in was.data.keys() - data.keys() for cut in _sections(scanner, text, name)]
    for name in was.data.keys() & data.keys():
        for path, value in _changes(was.data[name], data[name], (name,)):
            start, end = scanner.spans[dotted(path)]
            cuts.append((start, end, _toml(value)))
    added = "".join(f"\n[{name}]\n{_lines(data[name])}" for name in data.keys() - was.data.keys())
    for start, end, new in sorted(cuts, reverse=True):
        text = text[:start] + new + text[end:]
    return text.rstrip("\n") + "\n" + added


def _sections(scanner: Scanner, text: str, name: str) -> Iterator[tuple[int, int, str]]:
    """Where the sections of a name begin and end; what follows the last value of one stays."""
    starts = [*(start for _, start in scanner.headers), len(text)]
    found = [(start, starts[i + 1]) for i, (path, start) in enumerate(scanner.headers) if path[0] == name]
    if not found:
        raise LookupError(f"{name} is no section")
    for start, stop in found:
        last = max((end for begin, end in scanner.spans.values() if start < begin < stop), default=start)
        line = text.find("\n", last)
        yield start, len(text) if line < 0 else line + 1, ""


def _changes(was: Any, now: Any, path: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Where data differ, as deep as both are tables with the same keys, and the new values."""
    if isinstance(was, dict) and isinstance(now, dict):
        if was.keys() != now.keys():
            yield path, now
        else:
            for key in was.keys() & now.keys():
                yield from _changes(was[key], now[key], (*path, key))
    elif was != now or type(was) is not type(now):
        yield path, now


def _dumped(data: Mapping[str, Any]) -> str:
    """Data as TOML: first what is no table."""
    text = _lines({key: each for key, each in data.items() if not isinstance(each, dict)})
    return text + "".join(f"\n[{_key(key)}]\n{_lines(each)}" for key, each in data.items() if isinstance(each, dict))


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(f"{_key(key)} = {_toml(each)}\n" for key, each in table.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(each)}" for key, each in value.items()) + " }" if value else "{}"
    if is_list(value):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)
