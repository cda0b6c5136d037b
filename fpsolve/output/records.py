"""Records of what is finished, kept in files that only grow: what a run that ended early had done is not lost.

A record is a line of JSON. Each process that writes has a file of its own, and a record is with the system before the
next one is begun; a line that is torn, or damaged, is none.
"""

from __future__ import annotations

import json
import os
import socket
import zlib
from bisect import insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from errno import ENOSPC
from pathlib import Path
from secrets import token_hex
from time import monotonic, sleep
from typing import Any, overload

from fpsolve.case.case import Case, Curve
from fpsolve.errors import OutputError, Remedy
from fpsolve.study.records import is_current, result_of
from fpsolve.study.results import CurveResult

SHARED_SECONDS = 60.0
"""After which a file that another machine has written is there, if it ever is."""
_NAMES: dict[int, str] = {}
"""The file of this process."""


@dataclass(frozen=True)
class Address:
    """Where a record is: its file, where it begins in it, and how long it is, in bytes."""

    file: str
    start: int
    size: int


class Records:
    """The records in a folder by their keys, of which the last one counts."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._addresses: dict[str, Address] = {}
        self._seen: dict[str, int] = {}

    def look(self) -> Records:
        """Find what has been written by now, since the last look."""
        for path in self._files():
            start = self._seen.get(path.name, 0)
            with path.open("rb") as file:
                file.seek(start)
                for line in file:
                    if found := _parsed(line):
                        self._addresses[found[0]] = Address(path.name, start, len(line))
                        self._seen[path.name] = start + len(line)
                    start += len(line)
        return self

    @property
    def are_there(self) -> bool:
        """Whether there is one at least."""
        return bool(self._addresses)

    @property
    def outdated(self) -> int:
        """How many another version of fpsolve has written; they are not read."""
        return sum(not is_current(key) for key in self._addresses)

    def address(self, key: str) -> Address | None:
        """Where the record of a key is, if there is one."""
        return self._addresses.get(key)

    def expect(self, address: Address) -> None:
        """Wait for the file of a record, which a network may show late. Raises `OutputError` where it does not come."""
        until = monotonic() + SHARED_SECONDS
        while address.file not in self._seen and not (self.folder / address.file).exists():
            if monotonic() > until:
                raise OutputError(f"{self.folder} is not where the workers write: they must share it", Remedy.FOLDER)
            sleep(0.5)
        self._seen.setdefault(address.file, 0)

    def read(self, address: Address) -> dict[str, Any]:
        """A record. Raises OSError or ValueError where there is none."""
        with (self.folder / address.file).open("rb") as file:
            file.seek(address.start)
            found = _parsed(file.read(address.size))
        if found is None:
            raise ValueError(f"{self.folder / address.file} has changed")
        return found[1]

    def remove(self) -> None:
        """Start over."""
        self._addresses.clear()
        self._seen.clear()
        for path in self._files():
            path.unlink()

    def _files(self) -> list[Path]:
        """The files of records; folders and pipes are none, whatever they are called."""
        return sorted(path for path in self.folder.glob("*.jsonl") if path.is_file())


class Results(Sequence[CurveResult]):
    """What is known of the curves of a case, in their order; each is read from its record when it is looked at.

    Args:
        case: whose curves these are.
        records: those of its folder.
    """

    def __init__(self, case: Case, records: Records) -> None:
        self._case, self._records = case, records
        self._found: dict[int, Address | CurveResult] = {}
        self._order: list[int] = []

    def add(self, number: int, found: Address | CurveResult) -> None:
        """Curve `number`, from 1 on."""
        if number not in self._found:
            insort(self._order, number)
        self._found[number] = found

    def find(self, curve: Curve, key: str) -> bool:
        """Take the result of a curve from the record of a key; whether there is one that can be read."""
        if (address := self._records.address(key)) is None:
            return False
        try:
            result_of(self._records.read(address), curve)
        except (OSError, ValueError):
            return False
        self.add(curve.number, address)
        return True

    def has(self, curve: Curve) -> bool:
        """Whether there is a result of a curve; it is not read."""
        return curve.number in self._found

    def of(self, curve: Curve) -> CurveResult | None:
        """The result of a curve, if there is one."""
        return self._result(curve) if self.has(curve) else None

    def __len__(self) -> int:
        return len(self._order)

    @overload
    def __getitem__(self, index: int) -> CurveResult: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[CurveResult]: ...
    def __getitem__(self, index: int | slice) -> CurveResult | Sequence[CurveResult]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = self._order[index]
        [curve] = self._case.curves(number - 1, number)
        return self._result(curve)

    def __iter__(self) -> Iterator[CurveResult]:
        return (self[i] for i in range(len(self)))

    def _result(self, curve: Curve) -> CurveResult:
        found = self._found[curve.number]
        return result_of(self._records.read(found), curve) if isinstance(found, Address) else found


def append(folder: Path, key: str, record: dict[str, Any]) -> Address:
    """Add a record to the file of this process in a folder, on a line of its own also where the last one is torn.

    Raises:
        OSError: it cannot be written; nothing is left of it.
    """
    content = json.dumps(record, ensure_ascii=False).encode()
    line = b'{"key": "%s", "crc32": %d, "record": %s}\n' % (key.encode(), zlib.crc32(content), content)
    number = os.getpid()
    if number not in _NAMES:  # no other process has this name, nor had it
        _NAMES[number] = f"{socket.gethostname()}-{number}-{token_hex(4)}.jsonl"
    path = folder / _NAMES[number]
    path.parent.mkdir(parents=True, exist_ok=True)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        start = os.fstat(handle).st_size
        if start:
            os.lseek(handle, start - 1, os.SEEK_SET)
            if os.read(handle, 1) != b"\n":
                start += os.write(handle, b"\n")
        try:
            written = os.write(handle, line)
            if written < len(line):
                raise OSError(ENOSPC, os.strerror(ENOSPC), str(path))
        except OSError:
            os.ftruncate(handle, start)
            raise
    finally:
        os.close(handle)
    return Address(path.name, start, len(line))


def _parsed(line: bytes) -> tuple[str, dict[str, Any]] | None:
    """A key and its record; None where the line is torn or damaged."""
    _, mark, content = line.removesuffix(b"}\n").partition(b', "record": ')
    try:
        head = json.loads(line)
        if not mark or zlib.crc32(content) != head["crc32"]:
            return None
        return str(head["key"]), head["record"]
    except (ValueError, KeyError, TypeError):
        return None
