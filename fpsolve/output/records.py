"""Records of what is known, in a file that only grows: what a run that ended early had done is not lost.

A record is a line of JSON with a key and some entries, and it is with the system before work goes on; a line that is
torn, or damaged, is none. The records of a key add up, and of each name the last entry counts.

How a value becomes plain data, and comes back to the last bit, follows from the annotation of its attribute: a
dataclass is a list of its attributes, an array a compressed text; nan and inf, which JSON has not, are texts.
"""

from __future__ import annotations

import json
import math
import os
import zlib
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from errno import ENOSPC
from functools import cache
from hashlib import sha256
from itertools import tee
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from fpsolve import __version__
from fpsolve.arrays import FloatArray
from fpsolve.messages import Message
from fpsolve.pool import Pool

_OF_ANOTHER_FORM = LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError, zlib.error
"""What is raised where data have another form than what is made of them."""
Entries = dict[str, Any]
Item = TypeVar("Item")
Found = TypeVar("Found")


class Records:
    """The entries that are known, by their keys. One process alone has such a file, and adds to it.

    Args:
        path: the file.
        is_fresh: whether to start over.
    """

    def __init__(self, path: Path, *, is_fresh: bool = False) -> None:
        self.path = path
        self._starts: dict[str, list[int]] = {}
        self._end = b""
        if is_fresh:
            path.unlink(missing_ok=True)
        if path.exists():
            with path.open("rb") as file:
                start = 0
                for line in file:
                    if found := _parsed(line):
                        self._starts.setdefault(found[0], []).append(start)
                    start += len(line)
                    self._end = b"" if line.endswith(b"\n") else b"\n"

    def __bool__(self) -> bool:
        return bool(self._starts)

    def get(self, key: str) -> Entries:
        """All entries of a key; none where nothing is known, or can be read."""
        entries = Entries()
        if key in self._starts:
            with suppress(OSError, ValueError), self.path.open("rb") as file:
                for start in self._starts[key]:
                    file.seek(start)
                    if found := _parsed(file.readline()):
                        entries |= json.loads(found[1])
        return entries

    def put(self, key: str, entries: Mapping[str, Any]) -> None:
        """Add entries, on a line of their own also where the last one is torn.

        Raises:
            OSError: they cannot be written; nothing is left of them.
        """
        content = json.dumps(entries, ensure_ascii=False).encode()
        line = b'{"key": "%s", "crc32": %d, "record": %s}\n' % (key.encode(), zlib.crc32(content), content)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("ab", buffering=0) as file:
            start = file.seek(0, os.SEEK_END)
            try:
                if file.write(self._end + line) < len(self._end + line):
                    raise OSError(ENOSPC, os.strerror(ENOSPC), str(self.path))
            except OSError:
                file.truncate(start)
                raise
        self._starts.setdefault(key, []).append(start + len(self._end))
        self._end = b""


def _parsed(line: bytes) -> tuple[str, bytes] | None:
    """A key and its entries as JSON; None where the line is torn or damaged."""
    start, mark, content = line.removesuffix(b"}\n").partition(b', "record": ')
    try:
        head = json.loads(start.decode() + "}")
        return (str(head["key"]), content) if mark and zlib.crc32(content) == head["crc32"] else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def answered(
    records: Records,
    pool: Pool,
    task: Callable[[Item], Found],
    items: Iterable[Item],
    *,
    key: Callable[[Item], str],
    read: Callable[[Entries, Item], Found | None],
    entries: Callable[[Found], Entries],
) -> Iterator[tuple[Item, Found, bool]]:
    """What is found of each item, in their order, and whether an earlier run had; what is new is recorded as it comes.

    Args:
        records: of the items.
        pool: does the tasks of those that are not known.
        task: finds something of an item; can be pickled.
        items: are taken twice.
        key: what the record of an item is found by.
        read: gives what its record has; None, or raises `ValueError`, where that is nothing.
        entries: the record of what was found; empty of what is not kept.
    """
    earlier, new = dict[str, Found | None](), dict[str, Found]()

    def known(item: Item) -> Found | None:
        if (name := key(item)) not in earlier:
            earlier[name] = None
            with suppress(ValueError):
                earlier[name] = read(records.get(name), item)
        return earlier[name]

    ahead, items = tee(items)
    fresh = pool.run(task, (each for each in ahead if known(each) is None))
    for item in items:
        found = known(item)
        while found is None and key(item) not in new:
            each, one = next(fresh)
            new[key(each)] = one
            if record := entries(one):
                records.put(key(each), record)
        yield item, found or new[key(item)], found is not None


def key_of(*content: Any) -> str:
    """The key of what follows from some content, which JSON can hold, as this version of fpsolve finds it."""
    return sha256(json.dumps([__version__, *content], sort_keys=True).encode()).hexdigest()[:32]


def plain(value: Any) -> Any:
    """What JSON can hold of a value."""
    if isinstance(value, Message):
        return value.to_data()
    if names := _names(value.__class__):
        return [plain(getattr(value, name)) for name in names]
    if isinstance(value, np.ndarray):
        return _packed(value)
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    value = value.item() if isinstance(value, np.generic) else value
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def made(kind: Any, data: Any) -> Any:
    """The value with an annotation of what `plain` gave. Raises `ValueError` where that has another form."""
    try:
        return maker(kind)(data)
    except _OF_ANOTHER_FORM as failure:
        raise ValueError(f"this is no record of {kind}: {failure!r}") from failure


@cache
def maker(kind: Any) -> Callable[[Any], Any]:
    """Makes the values that have an annotation of what `plain` gave; raises one of `_OF_ANOTHER_FORM` elsewhere."""
    origin, parts = get_origin(kind), get_args(kind)
    if kind is Message:
        return Message.from_data
    if names := _names(kind):
        hints = get_type_hints(kind)
        each = [maker(hints[name]) for name in names]
        return lambda data: kind(*(make(part) for make, part in zip(each, data, strict=True)))
    if origin is get_origin(FloatArray):  # np.ndarray, or NDArray itself since NumPy 2.5
        return _unpacked
    if origin is Literal:
        return lambda data: parts[parts.index(data)]
    if origin is UnionType and NoneType in parts:
        [own] = [maker(part) for part in parts if part is not NoneType]
        return lambda data: None if data is None else own(data)
    if origin is tuple and parts[1:] == (...,):
        one = maker(parts[0])
        return lambda data: tuple(map(one, data))
    if origin is tuple:
        each = [*map(maker, parts)]
        return lambda data: tuple(make(part) for make, part in zip(each, data, strict=True))
    if origin in (dict, Mapping):
        entry = maker(parts[1])
        return lambda data: {key: entry(value) for key, value in data.items()}
    return kind if kind in (str, bool, int, float) else lambda data: data


@cache
def _names(kind: Any) -> Sequence[str]:
    """The attributes of a dataclass, or of a named tuple; none of what is neither."""
    return [each.name for each in fields(kind)] if is_dataclass(kind) else getattr(kind, "_fields", ())


def _packed(value: FloatArray) -> Entries:
    data = np.ascontiguousarray(value, dtype="<f8").tobytes()
    return {"shape": list(value.shape), "data": b64encode(zlib.compress(data)).decode("ascii")}


def _unpacked(packed: Any) -> FloatArray:
    data = zlib.decompress(b64decode(packed["data"]))
    return np.frombuffer(data, dtype="<f8").reshape(packed["shape"]).astype(float)
