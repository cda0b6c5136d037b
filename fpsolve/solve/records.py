"""Records of what is known, in a file that only grows: what a run that ended early had done is not lost.

A record is a line of JSON with a key and some entries, and it is with the system before work goes on; a line that is
torn, or damaged, is none. The records of a key add up, and of each name the last entry counts.

How a value becomes plain data, and comes back to the last bit, follows from its annotation, by pydantic. An array is a
compressed text; nan and inf, which JSON has not, are words as Python writes them.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter

from fpsolve import __version__
from fpsolve.arrays import FloatArray
from fpsolve.pool import Pool

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
        with suppress(FileNotFoundError), path.open("rb") as file:
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
        if not (starts := self._starts.get(key)):
            return entries
        with suppress(OSError, ValueError, zlib.error), self.path.open("rb") as file:
            for start in starts:
                file.seek(start)
                if found := _parsed(file.readline()):
                    entries |= json.loads(found[1], object_hook=unpacked)
        return entries

    def put(self, key: str, entries: Mapping[str, Any]) -> None:
        """Add entries, on a line of their own also where the last one is torn.

        Raises:
            OSError: they cannot be written; what is left of them is a torn line, which is none.
        """
        content = json.dumps(entries, ensure_ascii=False, default=packed).encode()
        line = b'{"key": "%s", "crc32": %d, "record": %s}\n' % (key.encode(), zlib.crc32(content), content)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        end, self._end = self._end, b"\n"
        with self.path.open("ab") as file:
            start = file.tell() + file.write(end)
            file.write(line)
        self._starts.setdefault(key, []).append(start)
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
    kind: Any,
    key: Callable[[Item], str],
    keeps: Callable[[Found], bool],
) -> Iterator[tuple[Item, Found, bool]]:
    """What is found of each item, in their order, and whether an earlier run had; what is new is recorded as it comes.

    Args:
        records: of the items.
        pool: does the tasks of those that are not known.
        task: finds something of an item; can be pickled.
        kind: the annotation of what is found; a record that has another form counts as none.
        key: what the record of an item is found by.
        keeps: whether something that was found is recorded.
    """
    named, known = [(key(each), each) for each in items], dict[str, Found]()
    for name in dict(named):
        with suppress(ValueError):
            if found := made(kind, records.get(name).get("found")):
                known[name] = found
    earlier, left = {*known}, {name: item for name, item in named if name not in known}
    fresh = pool.run(task, left.values())
    for name, item in named:
        while name not in known:
            each, one = next(fresh)
            known[key(each)] = one
            if keeps(one):
                records.put(key(each), {"found": plain(kind, one)})
        yield item, known[name], name in earlier


def key_of(*content: Any) -> str:
    """The key of what follows from some content, which JSON can hold, as this version of fpsolve finds it."""
    return sha256(json.dumps([__version__, *content], sort_keys=True, default=packed).encode()).hexdigest()[:32]


def plain(kind: object, value: object) -> Any:
    """A value with an annotation as data that a record can hold."""
    return _form(kind).dump_python(value, warnings=False)


def made(kind: object, data: object) -> Any:
    """The value with an annotation of what `plain` gave. Raises `ValueError` where that has another form."""
    return _form(kind).validate_python(data)


@cache
def _form(kind: Any) -> TypeAdapter[Any]:
    """What writes and reads the values with an annotation, or None."""
    return TypeAdapter(kind | None, config=ConfigDict(arbitrary_types_allowed=True, extra="forbid"))


def packed(array: FloatArray) -> Entries | float:
    """An array as JSON can hold it, to the last bit; a number of numpy as one of Python."""
    if not array.shape:
        return array.item()
    data = np.ascontiguousarray(array, dtype="<f8").tobytes()
    return {"shape": list(array.shape), "data": b64encode(zlib.compress(data)).decode("ascii")}


def unpacked(found: Entries) -> Entries | FloatArray:
    """An array of what `packed` gave; another table as it is."""
    if found.keys() != {"shape", "data"}:
        return found
    data = zlib.decompress(b64decode(found["data"]))
    return np.frombuffer(data, dtype="<f8").reshape(found["shape"])
