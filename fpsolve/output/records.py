"""Records of what is finished, kept in files that only grow: what a run that ended early had done is not lost.

A record is a line of JSON. Each process that writes has a file of its own, and a record is with the system before the
next one is begun; a line that is torn, or damaged, is none. The record of a parameter set has an entry for each part
that was solved, by a key that follows from all that its numbers follow from: a run that asks for more solves what is
missing and adds a line, a run that asks for less solves nothing.

How a value becomes plain data, and comes back to the last bit, follows from the annotation of its attribute: a
dataclass is a list of its attributes, an array a compressed text; nan and inf, which JSON has not, are texts.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import socket
import zlib
from base64 import b64decode, b64encode
from bisect import bisect_left, insort
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, is_dataclass
from errno import ENOSPC
from functools import cache, lru_cache
from pathlib import Path
from secrets import token_hex
from time import monotonic, sleep
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, Curve
from fpsolve.errors import OutputError, Remedy
from fpsolve.exponent.error import Moment
from fpsolve.messages import Code, Message, Severity
from fpsolve.output.tables import says_more
from fpsolve.parts.every import BY_NAME
from fpsolve.parts.moments import PART as MOMENTS
from fpsolve.parts.moments import begun_of, unfinished
from fpsolve.parts.part import Entry, Job, Numerics, Part, Reason, Settings
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.results.table import Table
from fpsolve.study.columns import row_of, table_of
from fpsolve.study.solve import Asked, everything, result_of

SOLVED_RECORDS = "records/solved"
"""The folder of the records of sets."""
RESULT_VERSION = 5
"""Of what is computed from the same parameters; records of another one are computed anew."""
SHARED_SECONDS = 60.0
"""After which a file that another machine has written is there, if it ever is."""
KEPT = 2**21
"""Bytes of the records whose results stay in memory once they are read, as of few curves all are asked for again."""
_OF_ANOTHER_FORM = LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError, zlib.error
"""What is raised where data have another form than what is made of them."""
_AS_IT_IS = getattr(os, "O_BINARY", 0)
"""The flag of files whose line ends Windows leaves alone."""
_NAMES: dict[int, str] = {}
"""The file of this process."""
Record = dict[str, Any]
Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class Address:
    """Where a record is: its file, where it begins in it, and how long it is, in bytes."""

    file: str
    start: int
    size: int


class Records:
    """The records in a folder by their keys, of which the last one counts, or each adds to those before."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._addresses: dict[str, tuple[Address, ...]] = {}
        self._seen: dict[str, int] = {}

    def look(self) -> Records:
        """Find what has been written by now, since the last look."""
        for path in self.files:
            start = self._seen.get(path.name, 0)
            with path.open("rb") as file:
                file.seek(start)
                for line in file:
                    if found := _parsed(line):
                        place = Address(path.name, start, len(line))
                        self._addresses[found[0]] = (*self._addresses.get(found[0], ()), place)
                        self._seen[path.name] = start + len(line)
                    start += len(line)
        return self

    @property
    def are_there(self) -> bool:
        return bool(self._addresses)

    def address(self, key: str) -> Address | None:
        """The last record of a key."""
        return self._addresses[key][-1] if key in self._addresses else None

    def addresses(self, key: str) -> tuple[Address, ...]:
        """All records of a key."""
        if not self._addresses:
            self.look()
        return self._addresses.get(key, ())

    def expect(self, address: Address) -> None:
        """Wait for the file of a record, which a network may show late. Raises `OutputError` where it does not come."""
        until = monotonic() + SHARED_SECONDS
        while address.file not in self._seen and not (self.folder / address.file).exists():
            if monotonic() > until:
                raise OutputError(f"{self.folder} is not where the workers write: they must share it", Remedy.FOLDER)
            sleep(0.5)
        self._seen.setdefault(address.file, 0)

    def read(self, address: Address) -> Record:
        """A record. Raises OSError or ValueError where there is none."""
        with (self.folder / address.file).open("rb") as file:
            file.seek(address.start)
            found = _parsed(file.read(address.size))
        if found is None:
            raise ValueError(f"{self.folder / address.file} has changed")
        with _read_as("anything"):
            return json.loads(found[1].decode())

    def made(self, key: str, make: Callable[[Record], Made]) -> Made | None:
        """What is made of the record of a key; None where there is none, or none of the form that `make` takes."""
        try:
            return None if (address := self.address(key)) is None else make(self.read(address))
        except (OSError, ValueError):
            return None

    def remove(self) -> None:
        """Start over."""
        self._addresses.clear()
        self._seen.clear()
        for path in self.files:
            path.unlink()

    @property
    def files(self) -> list[Path]:
        """The files of records; folders and pipes are none, whatever they are called."""
        return sorted(path for path in self.folder.glob("*.jsonl") if path.is_file())


class Results(Sequence[CurveResult]):
    """What is known of the curves of a case, in their order; each is read from its records when it is first looked at.

    Args:
        case: whose curves these are.
        records: those of its folder.
        numerics: how the curves are solved.

    Attributes:
        says: whether anything is said of a curve beyond its numbers, shape (curves,); of those in the `table`.
    """

    def __init__(self, case: Case, records: Records, numerics: Numerics) -> None:
        self._case, self._records, self._numerics = case, records, numerics
        self._first, self._further = everything(case, 1), everything(case, 2)
        self._places: dict[int, tuple[Address, ...]] = {}
        self._given: dict[int, CurveResult] = {}
        self._table, self._unread = table_of(case), set[int]()
        self.says = np.ones(case.planned, dtype=bool)
        self._order: list[int] = []
        self._kept: dict[int, CurveResult] = {}
        self._room = KEPT

    def asked(self, number: int) -> Asked:
        """What is asked of the curve with a number."""
        return self._first if number == 1 else self._further

    def add(self, number: int, found: Address | CurveResult | None = None) -> None:
        """Count a curve among those that are known, with a further record of it, or a result without one."""
        if not self.has(number):
            insort(self._order, number)
        if isinstance(found, Address):
            self._places[number] = (*self._places.get(number, ()), found)
            self._given.pop(number, None)
        elif found is not None:
            self._given[number] = found
        self._kept.pop(number, None)
        self._unread.add(number)

    @property
    def table(self) -> Table:
        """The numbers of all that are known."""
        for number in sorted(self._unread):
            self._put(self.of(number))
        return self._table

    @property
    def telling(self) -> Iterator[CurveResult]:
        """Those of which more is said than their numbers."""
        return (self.of(number) for number in self._order if self.says[number - 1])

    def _put(self, result: CurveResult) -> None:
        number = result.curve.number
        self._table.put(number - 1, row_of(self._case, result))
        self.says[number - 1] = says_more(self._case, result)
        self._unread.discard(number)

    def find(self, curve: Curve) -> bool:
        """Look for the records of a curve; whether they have all that is asked of it, which can be read."""
        places = self._records.addresses(set_key(curve))
        if not places:
            return False
        self._places[curve.number] = places
        entries, _ = self.entries(curve)
        if is_whole := self._is_whole(curve, entries):
            self.add(curve.number)
            self._put(self._keep(curve, entries, {}))
        return is_whole

    def _is_whole(self, curve: Curve, entries: Mapping[str, Entry]) -> bool:
        has_failed = MOMENTS.name in entries and entries[MOMENTS.name].reason is not None
        return has_failed or self.asked(curve.number).keys() <= entries.keys()

    def entries(self, curve: Curve) -> tuple[dict[str, Entry], dict[float, Moment]]:
        """Of a curve the entries that are known and asked for, and Λ(p), by p, where others are still to be solved."""
        record: Record = {}
        if curve.number not in self._places:
            self._places[curve.number] = self._records.addresses(set_key(curve))
        for place in self._places[curve.number]:
            with suppress(OSError, ValueError):  # which counts as none
                found = self._records.read(place)
                record |= found if isinstance(found, dict) else {}
        return entries_of(record, self.asked(curve.number), self._numerics)

    def has(self, number: int) -> bool:
        """Whether the curve with a number is known."""
        place = bisect_left(self._order, number)
        return place < len(self._order) and self._order[place] == number

    def is_begun(self, number: int) -> bool:
        """Whether there are records of the curve with a number."""
        return number in self._places

    def __len__(self) -> int:
        return len(self._order)

    def __getitem__(self, index: Any) -> Any:
        numbers = self._order[index]
        if isinstance(numbers, list):
            return [self[i] for i in range(*index.indices(len(self)))]
        return self.of(numbers)

    def of(self, number: int) -> CurveResult:
        """That of the curve with a number."""
        if (known := self._given.get(number) or self._kept.get(number)) is not None:
            return known
        curve = Curve(self._case.problem, self._case.vary.sets[number - 1], number)
        return self._keep(curve, *self.entries(curve))

    def _keep(self, curve: Curve, entries: Mapping[str, Entry], begun: Mapping[float, Moment]) -> CurveResult:
        """The result of a curve, which stays in memory as long as there is room."""
        result = result_of(curve, self.asked(curve.number), self._numerics, entries, begun)
        size = sum(place.size for place in self._places.get(curve.number, ()))
        if not self._is_whole(curve, entries):
            self._given[curve.number] = result
        elif size <= self._room:
            self._room -= size
            self._kept[curve.number] = result
        return result


def append(folder: Path, key: str, record: Record) -> Address:
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
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | _AS_IT_IS, 0o666)
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


def _parsed(line: bytes) -> tuple[str, bytes] | None:
    """A key and its record as JSON; None where the line is torn or damaged."""
    start, mark, content = line.removesuffix(b"}\n").partition(b', "record": ')
    try:
        head = json.loads(start.decode() + "}")
        return (str(head["key"]), content) if mark and zlib.crc32(content) == head["crc32"] else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def set_key(curve: Curve) -> str:
    """What the records of a parameter set are found by."""
    return f"{RESULT_VERSION}-{curve.digest}"


def part_key(part: Part, settings: Settings, numerics: Numerics, *, is_limited: bool = False) -> str:
    """What the entry of a part is found by in the records of a set: a digest of all that its numbers follow from.

    Args:
        part: which.
        settings: what is asked of it.
        numerics: how it is solved.
        is_limited: whether it is an entry that a larger budget may change.
    """
    content: dict[str, Any] = {"form": form(part.kind), "settings": settings}
    if part.uses_solver:
        mesh = numerics.mesh
        content["numerics"] = [numerics.rtol, mesh and plain(mesh)]
    if is_limited:
        content["budget"] = [numerics.budget.unknowns, numerics.budget.seconds]
    return f"{part.name}-{_hash(content)[:16]}"


@lru_cache(maxsize=64)
def part_keys(asked: str, numerics: Numerics) -> dict[str, tuple[str, str]]:
    """The keys of what is asked for, as JSON: of entries that no budget limits, and of others."""
    return {
        name: (
            part_key(BY_NAME[name], settings, numerics),
            part_key(BY_NAME[name], settings, numerics, is_limited=True),
        )
        for name, settings in json.loads(asked).items()
    }


@lru_cache(maxsize=16)
def begun_key(numerics: Numerics) -> str:
    """What Λ(p) is found by while other p are being solved."""
    return part_key(MOMENTS, {}, numerics, is_limited=True)


def record_of_set(curve: Curve, asked: Asked, numerics: Numerics, entries: Mapping[str, Entry]) -> Record:
    """The record of what was solved of a set, without what failed for a reason that may be gone the next time."""
    keys, record = part_keys(json.dumps(asked), numerics), Record()
    for name, entry in entries.items():
        part = BY_NAME[name]
        said = list(messages_of(part, entry, curve, numerics))
        if not any(each.tells_of(code) for each in said for code in (Code.NO_MEMORY, Code.FAULT)):
            is_limited = entry.reason is not None or any(each.severity is not Severity.NOTE for each in said)
            is_limited |= entry.found is not None and part.lacks(entry.found, asked[name])
            record[keys[name][is_limited]] = plain((entry.found, entry.reason, entry.seconds))
    return record


def begun_record(job: Job) -> Record:
    """The record of Λ(p) while other p are being solved."""
    found = unfinished(job.curve.problem, job.begun)
    return {begun_key(job.numerics): [plain(found), None, 0.0]}


def messages_of(part: Part, entry: Entry, curve: Curve, numerics: Numerics) -> Iterator[Message]:
    """All that is said of an entry."""
    if entry.reason is not None:
        yield entry.reason.message
    elif entry.found is not None:
        yield from part.said(entry.found, curve, numerics)
        yield from part.reasons(entry.found)


def entries_of(record: Record, asked: Asked, numerics: Numerics) -> tuple[dict[str, Entry], dict[float, Moment]]:
    """The entries of a record that answer what is asked for, and Λ(p) of an unfinished run, by p.

    An entry that cannot be read is none.
    """
    entries = dict[str, Entry]()
    for name, keys in part_keys(json.dumps(asked), numerics).items():
        for key in reversed(keys):  # what no budget limits counts
            if key in record and (entry := _entry_of(record[key], BY_NAME[name])):
                entries[name] = entry
    begun = dict[float, Moment]()
    if (key := begun_key(numerics)) in record and (entry := _entry_of(record[key], MOMENTS)) and entry.found:
        begun = begun_of(entry.found)
    return entries, begun


def _entry_of(data: Any, part: Part) -> Entry | None:
    """An entry from what a record has of it; None where that has another form."""
    try:
        found, reason, seconds = data
        return Entry(None if found is None else maker(part.kind)(found), maker(Reason | None)(reason), float(seconds))
    except _OF_ANOTHER_FORM:
        return None


def record_of(found: Any) -> Record:
    """The record of a dataclass, without its curve."""
    kind: Any = type(found)
    return {name: plain(getattr(found, name)) for name in _names(kind)}


def made_of(kind: type, record: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes of a dataclass from its record. Raises `ValueError` where that has another form."""
    with _read_as(f"a {kind.__name__}"):
        return {name: maker(each)(record[name]) for name, each in _hints(kind).items()}


@contextmanager
def _read_as(what: str) -> Iterator[None]:
    """Raises `ValueError` where data have another form."""
    try:
        yield
    except _OF_ANOTHER_FORM as failure:
        raise ValueError(f"this is no record of {what}: {failure!r}") from failure


def key_of(kind: Any, curve: Curve, **content: Any) -> str:
    """What a record of a kind is found by: the version, a digest of form and content, and that of the curve."""
    return f"{RESULT_VERSION}-{_hash({'form': form(kind), **content})}-{curve.digest}"


def _hash(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def plain(value: Any) -> Any:
    """What JSON can hold of a value, a dataclass without its curve."""
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


@cache
def maker(kind: Any) -> Callable[[Any], Any]:
    """Makes the values that have an annotation of what `plain` gave; raises one of `_OF_ANOTHER_FORM` elsewhere."""
    origin, parts = get_origin(kind), get_args(kind)
    if kind is Message:
        return Message.from_data
    if _names(kind):
        each = [*map(maker, _hints(kind).values())]
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
def form(kind: Any) -> Any:
    """What the data of values with an annotation look like; it changes with the attributes of a dataclass in it."""
    if _names(kind):
        return [kind.__name__, *([name, form(each)] for name, each in _hints(kind).items())]
    return [str(get_origin(kind) or kind), *map(form, get_args(kind))]


@cache
def _names(kind: Any) -> Sequence[str]:
    """The attributes of a dataclass but a curve, or of a named tuple; none of what is neither."""
    known = [each.name for each in fields(kind)] if is_dataclass(kind) else getattr(kind, "_fields", ())
    return [name for name in known if name != "curve"]


@cache
def _hints(kind: Any) -> Mapping[str, Any]:
    """Their annotations; what needs numba is imported for simulations only."""
    late: dict[str, Any] = {}
    if kind is SimulatedCurve:
        from fpsolve.simulation import MonteCarlo, Response

        late = {"MonteCarlo": MonteCarlo, "Response": Response}
    hints = get_type_hints(kind, localns=late)
    return {name: hints[name] for name in _names(kind)}


def _packed(value: FloatArray) -> Record:
    data = np.ascontiguousarray(value, dtype="<f8").tobytes()
    return {"shape": list(value.shape), "data": b64encode(zlib.compress(data)).decode("ascii")}


def _unpacked(packed: Any) -> FloatArray:
    data = zlib.decompress(b64decode(packed["data"]))
    return np.frombuffer(data, dtype="<f8").reshape(packed["shape"]).astype(float)
