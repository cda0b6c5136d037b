"""Records of what is finished, kept in files that only grow: what a run that ended early had done is not lost.

A record is a line of JSON. Each process that writes has a file of its own, and a record is with the system before the
next one is begun; a line that is torn, or damaged, is none. How a value becomes plain data, and comes back to the last
bit, follows from the annotation of its attribute: a dataclass is a list of its attributes, an array a compressed text;
nan and inf, which JSON has not, are texts.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import socket
import zlib
from base64 import b64decode, b64encode
from bisect import insort
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from errno import ENOSPC
from functools import cache, lru_cache
from pathlib import Path
from secrets import token_hex
from time import monotonic, sleep
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from fpsolve.analysis.continuation import Trace
from fpsolve.analysis.scan import Scan
from fpsolve.analysis.stability import Boundary
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.sections import MonteCarloSection
from fpsolve.data import Quantity
from fpsolve.errors import OutputError, Remedy
from fpsolve.exponent.quantities import BY_JUMP, INDICES
from fpsolve.exponent.solver import InvariantClass
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Message, message_of
from fpsolve.model.quantity import ResponseQuantities
from fpsolve.study.chart import charted
from fpsolve.study.response import CurveResponse
from fpsolve.study.results import CurveResult, SimulatedCurve
from fpsolve.study.solve import Numerics, Wanted, everything

RESULT_VERSION = 4
"""Of what is computed from the same parameters; records of another one are computed anew."""
SHARED_SECONDS = 60.0
"""After which a file that another machine has written is there, if it ever is."""
LONGEST, MOST_NUMBERS = 2**28, 2**24
"""Of a line, in bytes, and of an array."""
KEPT = 2**24
"""Bytes of the records whose results stay in memory once they are read, as each table and figure asks for all."""
MOST_LISTED = 8
"""Numbers of an array that is a list in a record; longer ones take less room and time compressed."""
_NAMES: dict[int, str] = {}
"""The file of this process."""
Record = dict[str, Any]
Made = TypeVar("Made")


@dataclass(frozen=True)
class Address:
    """Where a record is: its file, where it begins in it, and how long it is, in bytes."""

    file: str
    start: int
    size: int


@dataclass(frozen=True, eq=False)
class Line:
    """What is recorded of a finished line of a chart, see `Boundary`."""

    traces: tuple[Trace, ...]
    scan: Scan
    seconds: float


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
                while len(line := file.readline(LONGEST)) not in (0, LONGEST):  # what is longer is no record
                    if found := _parsed(line):
                        self._addresses[found[0]] = Address(path.name, start, len(line))
                        self._seen[path.name] = start + len(line)
                    start += len(line)
        return self

    @property
    def are_there(self) -> bool:
        return bool(self._addresses)

    @property
    def outdated(self) -> int:
        """How many another version of fpsolve has written; they are not read."""
        return sum(not key.startswith(f"{RESULT_VERSION}-") for key in self._addresses)

    def address(self, key: str) -> Address | None:
        return self._addresses.get(key)

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
        return found[1]

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
        for path in self._files():
            path.unlink()

    def _files(self) -> list[Path]:
        """The files of records; folders and pipes are none, whatever they are called."""
        return sorted(path for path in self.folder.glob("*.jsonl") if path.is_file())


class Results(Sequence[CurveResult]):
    """What is known of the curves of a case, in their order; each is read from its record when it is first looked at.

    Args:
        case: whose curves these are.
        records: those of its folder.
    """

    def __init__(self, case: Case, records: Records) -> None:
        self._case, self._records, self._asked = case, records, everything(case).p.tolist()
        self._found: dict[int, Address | CurveResult] = {}
        self._order: list[int] = []
        self._kept: dict[int, CurveResult] = {}
        self._room = KEPT

    def add(self, number: int, found: Address | CurveResult) -> None:
        if number not in self._found:
            insort(self._order, number)
        self._found[number] = found
        self._kept.pop(number, None)

    def find(self, curve: Curve, key: str) -> bool:
        """Take the result of a curve from the record of a key; whether there is one that can be read."""
        if (address := self._records.address(key)) is None:
            return False
        try:
            is_whole = fits(result_of(self._records.read(address), curve), self._asked)
        except (OSError, ValueError):
            return False
        if is_whole:
            self.add(curve.number, address)
        return is_whole

    def has(self, number: int) -> bool:
        """Whether that of the curve with a number is known."""
        return number in self._found

    def __len__(self) -> int:
        return len(self._order)

    def __getitem__(self, index: Any) -> Any:
        numbers = self._order[index]
        if isinstance(numbers, list):
            return [self[i] for i in range(*index.indices(len(self)))]
        return self.of(numbers)

    def of(self, number: int) -> CurveResult:
        """That of the curve with a number, if it is known. Raises `KeyError`."""
        if (known := self._kept.get(number)) is not None:
            return known
        found = self._found[number]
        if not isinstance(found, Address):
            return found
        [varied] = self._case.vary.sets(number - 1, number)
        result = result_of(self._records.read(found), Curve(self._case.problem, varied, number))
        if found.size <= self._room:
            self._room -= found.size
            self._kept[number] = result
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


def _parsed(line: bytes) -> tuple[str, Record] | None:
    """A key and its record; None where the line is torn or damaged."""
    _, mark, content = line.removesuffix(b"}\n").partition(b', "record": ')
    try:
        head = json.loads(line.decode())
        if not mark or zlib.crc32(content) != head["crc32"]:
            return None
        return str(head["key"]), head["record"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def key_of(curve: Curve, wanted: Wanted, numerics: Numerics) -> str:
    """What the record of a result is found by: a digest of all that its numbers and sentences follow from."""
    return f"{RESULT_VERSION}-{_asked(wanted, numerics)}-{curve.digest}"


@lru_cache(16)
def _asked(wanted: Wanted, numerics: Numerics) -> str:
    """A digest of what is asked of curves, and of how they are solved."""
    mesh, budget = numerics.mesh, numerics.budget
    return _digest(
        CurveResult,
        p=wanted.p.tolist(),
        wanted=[wanted.indices, wanted.shown, wanted.density, wanted.differentiated, wanted.is_stated, wanted.start],
        response=[wanted.response, wanted.grid],
        numerics=[numerics.rtol, mesh and codec(CylinderMesh).plain(mesh)],
        budget=[budget.unknowns, budget.seconds, budget.memory],
    )


def growing_key(curve: Curve, numerics: Numerics) -> str:
    """What the numbers of a curve are found by that is not finished; they do not depend on the budget."""
    mesh = numerics.mesh and codec(CylinderMesh).plain(numerics.mesh)
    return f"{RESULT_VERSION}-{_digest(CurveResult, numerics=[numerics.rtol, mesh])}-{curve.digest}"


def simulation_key(curve: Curve, orders: Sequence[float], setting: MonteCarloSection) -> str:
    settings = setting.model_dump(mode="json")
    return f"{RESULT_VERSION}-{_digest(SimulatedCurve, orders=list(orders), setting=settings)}-{curve.digest}"


def line_key(case: Case, line: Boundary) -> str:
    """What the record of a line of a chart is found by."""
    frame = [repr(each) for each in (line.zero, line.x, line.y, line.step, line.budget)]
    digest = _digest(Line, frame=frame, nodes=charted(case).nodes)
    return f"{RESULT_VERSION}-{digest}-{case.curve({}).digest}"


def line_of(record: Record, line: Boundary) -> Boundary:
    """A finished line from its record, with what it was begun with. Raises `ValueError` where that has another form."""
    found = Line(**_made(Line, record))
    samples = [point.sample for trace in found.traces for point in trace.points]
    count = found.scan.nodes.size
    shapes = found.scan.nodes.shape, found.scan.values.shape, found.scan.gradients.shape
    is_whole = shapes == ((count,), (count, count), (count, count, 2)) and all(trace.points for trace in found.traces)
    is_whole &= all(each.at.shape == each.gradient.shape == (2,) and np.isfinite(each.at).all() for each in samples)
    if not is_whole:
        raise ValueError("this is no record of a line")
    return replace(line, traces=found.traces, scan=found.scan, seconds=found.seconds, complete=True)


def record_of(result: CurveResult | SimulatedCurve | Line) -> Record:
    kind: Any = type(result)
    return {name: each.plain(getattr(result, name)) for name, each in _recorded(kind).items()}


def result_of(record: Mapping[str, Any], curve: Curve) -> CurveResult:
    """The result of a curve from its record. Raises `ValueError` where that has another form."""
    return CurveResult(curve, **_made(CurveResult, record))


def simulated_of(record: Mapping[str, Any], curve: Curve) -> SimulatedCurve:
    """The simulation of a curve from its record. Raises `ValueError` where that has another form."""
    return SimulatedCurve(curve, **_made(SimulatedCurve, record))


def _made(kind: type, record: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return {name: each.made(record[name]) for name, each in _recorded(kind).items()}
    except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError, zlib.error) as failure:
        raise ValueError(f"this is no record of a {kind.__name__}: {failure!r}") from failure


def fits(result: CurveResult, asked: Sequence[float]) -> bool:
    """Whether the numbers of a result are of the p that were asked for, each found or failed, and can be written."""
    found, slopes, failed = result.moments, result.sensitivities, [each.p for each in result.failures]
    columns = [getattr(found, each.name) for each in fields(found)]
    p, solved = found.p.tolist(), {*found.p.tolist(), *failed}
    indices = [each for some in (result.estimates, *result.jumps) for each in some.values() if each]
    if (rare := result.excursion) is not None:
        numbers = rare.lyapunov_exponent, rare.stability_index, rare.lower, rare.upper, rare.upcrossings
        indices += filter(None, numbers)
    if (response := result.response) is not None:
        indices += [*response.numbers.values(), response.balance]
    is_whole = (
        all(each.shape == found.p.shape for each in columns[:-1])
        and found.p.ndim == 1
        and not any(np.isinf(each).any() for each in columns)
        and bool(np.isfinite(found.value).all())
        and len(set(p)) == len(p)
        and {*p} <= set(asked) <= (solved if None not in solved else {*asked})
        and result.estimates.keys() == INDICES.keys()
        and len(result.jumps) in (0, len(result.curve.problem.system.jumps))
        and all(each.keys() <= BY_JUMP.keys() for each in result.jumps)
        and all(np.array_equal(each.p, found.p) and _is_finite(each, found.p.shape) for each in result.classes)
        and (response is None or _can_be_drawn(response, result.curve.problem.system.response))
        and 0 <= result.seconds < math.inf
    )
    if is_whole and slopes is not None:
        keys, rows = slopes.theta.keys(), [*slopes.moments, *slopes.indices.values()]
        indices += [each for row in rows for each in row.values()]
        is_whole = (
            slopes.p.shape == (len(slopes.moments),)
            and set(slopes.p.tolist()) <= set(p)
            and keys == slopes.quantities.keys()
            and keys <= result.curve.parameters.keys()
            and all(row.keys() <= keys for row in rows)
            and slopes.indices.keys() <= INDICES.keys()
            and all(map(math.isfinite, slopes.theta.values()))
        )
    return is_whole and not any(math.isinf(each.value) or each.error_estimate < 0 for each in indices)


def _is_finite(each: InvariantClass, shape: tuple[int, ...]) -> bool:
    """Whether the numbers of a class are, and of a shape."""
    exponent = each.lyapunov_exponent
    is_whole = all(
        column.shape == shape and bool(np.isfinite(column).all()) for column in (each.value, each.error_estimate)
    )
    return is_whole and all(map(math.isfinite, (each.phase or 0.0, exponent.value, exponent.error_estimate)))


def _can_be_drawn(response: CurveResponse, about: ResponseQuantities) -> bool:
    """Whether the numbers of a response are all there, and its density is one over a grid."""
    density = response.density
    numbers = response.stability_index, response.least
    is_whole = response.numbers.keys() <= about.numbers.keys() and all(map(math.isfinite, numbers))
    if density is None or not is_whole:
        return is_whole
    places = density.amplitude, density.phi, density.xi
    shape = tuple(each.size for each in places)
    tables = {1: density.of_amplitude, 2: density.of_plane, 3: density.whole}
    return (
        all(each.ndim == 1 and each.size > 1 and bool(np.all(np.diff(each) > 0)) for each in places)
        and all(each.shape == shape[:size] for size, each in tables.items())
        and all(bool(np.isfinite(each).all()) for each in (*places, *tables.values()))
    )


def simulation_fits(simulated: SimulatedCurve, orders: Sequence[float]) -> bool:
    """Whether the numbers of a simulation are of the p that were asked for, and can be written and drawn."""
    found, response = simulated.result, simulated.response
    numbers = [found.lyapunov_exponent, found.lyapunov_exponent_error, found.variance_rate, found.variance_rate_error]
    numbers += [found.time, found.step]
    for each in found.estimates:
        numbers += [each.p, each.effective_paths, each.value or 0.0, each.standard_error or 0.0]
    is_whole = [each.p for each in found.estimates] == list(orders)
    if response is not None:
        edges = response.x_edges, response.v_edges, response.amplitude_edges
        *cells, count = [each.size - 1 for each in edges]
        numbers += [response.outside, response.impact_rate or 0.0, response.time, *sum(response.means.values(), ())]
        is_whole &= (
            all(each.ndim == 1 and each.size > 1 and bool(np.all(np.diff(each) > 0)) for each in edges)
            and response.density.shape == tuple(cells)
            and response.amplitude_density.shape == response.amplitude_error.shape == (count,)
        )
    return is_whole and all(map(math.isfinite, numbers))


def _digest(kind: type, **content: Any) -> str:
    """A digest of what results of a kind follow from beside their curve, and of their form."""
    form = {name: each.form for name, each in _recorded(kind).items()}
    text = json.dumps({"form": form, **content}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


class Codec(NamedTuple):
    """Makes plain data of the values of one kind, and values of plain data.

    Attributes:
        form: what the plain data look like; it changes with the attributes of a dataclass, and with those in it.
        plain: gives what JSON can hold.
        made: the inverse. Raises TypeError, ValueError or LookupError where the data have another form.
    """

    form: Any
    plain: Callable[[Any], Any]
    made: Callable[[Any], Any]


@cache
def codec(kind: Any) -> Codec:
    """For the values of an attribute with an annotation."""
    origin, parts, is_row = get_origin(kind), get_args(kind), is_dataclass(kind) or hasattr(kind, "_fields")
    if kind in _SIMPLE:
        return _SIMPLE[kind]
    if is_row:
        attributes = _recorded(kind)
        row = Codec(
            [kind.__name__, *([name, one.form] for name, one in attributes.items())],
            lambda value: [one.plain(getattr(value, name)) for name, one in attributes.items()],
            lambda data: kind(
                *[one.made(part) for one, part in zip(attributes.values(), _checked(data, list), strict=True)]
            ),
        )
        if kind is not Quantity:
            return row
        # a text for each, as there are few of them and many numbers
        plain = lru_cache(lambda value: json.dumps(row.plain(value)))
        made = lru_cache(lambda text: row.made(json.loads(text)))
        return Codec(row.form, plain, lambda data: made(_checked(data, str)))
    if origin is get_origin(FloatArray):  # np.ndarray, or NDArray itself since NumPy 2.5
        return Codec("array or list", _packed, _unpacked)
    if origin is Literal:
        return Codec(parts, str, lambda data: parts[parts.index(data)])
    if origin is UnionType and NoneType in parts:
        [inner] = [codec(part) for part in parts if part is not NoneType]
        return Codec(
            ["none", inner.form],
            lambda value: None if value is None else inner.plain(value),
            lambda data: None if data is None else inner.made(data),
        )
    if origin is tuple and parts[1:] == (...,):
        inner = codec(parts[0])
        return Codec(
            [inner.form],
            lambda value: [inner.plain(each) for each in value],
            lambda data: tuple(map(inner.made, _checked(data, list))),
        )
    if origin is tuple:
        each = [codec(part) for part in parts]
        return Codec(
            [one.form for one in each],
            lambda value: [one.plain(part) for one, part in zip(each, value, strict=True)],
            lambda data: tuple(one.made(part) for one, part in zip(each, _checked(data, list), strict=True)),
        )
    if origin in (dict, Mapping):
        inner = codec(parts[1])
        return Codec(
            {"": inner.form},
            lambda value: {key: inner.plain(each) for key, each in value.items()},
            lambda data: {key: inner.made(each) for key, each in _checked(data, dict).items()},
        )
    raise TypeError(f"values of {kind} cannot be recorded")


@cache
def _recorded(kind: Any) -> Mapping[str, Codec]:
    """For each attribute of a dataclass but a curve; what needs numba is imported for simulations only."""
    late: dict[str, Any] = {}
    if kind is SimulatedCurve:
        from fpsolve.simulation import MonteCarlo, Response

        late = {"MonteCarlo": MonteCarlo, "Response": Response}
    hints = get_type_hints(kind, localns=late)
    names = getattr(kind, "_fields", None) or [each.name for each in fields(kind)]
    return {name: codec(hints[name]) for name in names if name != "curve"}


def _checked(data: Any, kind: Any) -> Any:
    """Plain data of a kind. Raises TypeError where they are of another one."""
    if not isinstance(data, kind) or (isinstance(data, bool) and kind is not bool):
        raise TypeError(f"{data!r} is of another kind than {kind}")
    return data


def _packed(value: FloatArray) -> Record | list[float | str]:
    if value.ndim == 1 and value.size <= MOST_LISTED:
        return [each if math.isfinite(each) else str(each) for each in map(float, value)]
    data = np.ascontiguousarray(value, dtype="<f8").tobytes()
    return {"shape": list(value.shape), "data": b64encode(zlib.compress(data)).decode("ascii")}


def _unpacked(packed: Any) -> FloatArray:
    if isinstance(packed, list):
        return np.array([each if type(each) is float else _number(each) for each in packed], dtype=float)
    shape = tuple(_checked(size, int) for size in packed["shape"])
    if min(shape, default=1) < 0 or (count := math.prod(shape)) > MOST_NUMBERS:
        raise ValueError(f"there is no array of shape {shape}")
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(b64decode(_checked(packed["data"], str), validate=True), 8 * count + 1)
    if not unpacker.eof:
        raise ValueError("an array is cut off")
    return np.frombuffer(data, dtype="<f8").reshape(shape).astype(float)


def _number(data: Any) -> float:
    return float(data if data in ("nan", "inf", "-inf") else _checked(data, int | float))


def _text(data: Any) -> str:
    _checked(data, str).encode()  # half a pair of UTF-16 is no text
    return str(data)


def _strict(data: Any) -> Any:
    """What strict JSON in UTF-8 can hold."""
    if type(data) is int or (type(data) is float and math.isfinite(data)):
        return data
    _text(json.dumps(data, allow_nan=False, ensure_ascii=False))
    return data


def _message(data: Any) -> Message:
    """A message that can be said in the words of case files, too, and sorted by its size."""
    message = Message.from_data(data)
    _text(message + message.words(CASE_WORDS))
    if message.size is not None:
        _number(message.size)
    return message


_SIMPLE: Mapping[Any, Codec] = {
    Any: Codec("any", lambda value: value, _strict),
    str: Codec("text", str, _text),
    bool: Codec("bool", bool, lambda data: _checked(data, bool)),
    int: Codec("int", int, lambda data: _checked(data, int)),
    float: Codec("float", lambda value: float(value) if math.isfinite(value) else str(float(value)), _number),
    float | str: Codec("number or text", lambda value: value, lambda data: _checked(data, float | str)),
    Message: Codec("message", lambda value: message_of(value).to_data(), _message),
}
"""For what has no parts."""
