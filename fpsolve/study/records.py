"""Results as plain data, which JSON can hold, and back to the last bit.

How a value becomes plain data follows from the annotation of its attribute: a dataclass is a list of its attributes,
an array a compressed text; nan and inf, which JSON has not, are texts.
"""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, lru_cache
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Curve
from fpsolve.case.sections import MonteCarloSection
from fpsolve.data import Quantity
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Message, message_of
from fpsolve.model.kinds import version_of
from fpsolve.study.results import CurveResult, SimulatedCurve
from fpsolve.study.solve import Numerics, Wanted

RESULT_VERSION = 3
"""Of what is computed from the same parameters; records of another one are computed anew."""
Record = dict[str, Any]


def key_of(curve: Curve, wanted: Wanted, numerics: Numerics) -> str:
    """What the record of a result is found by: a digest of all that its numbers and sentences follow from."""
    mesh, budget = numerics.mesh, numerics.budget
    return _digest(
        CurveResult,
        **_of_curve(curve),
        p=wanted.p.tolist(),
        wanted=[wanted.indices, wanted.shown, wanted.density, wanted.differentiated],
        numerics=[numerics.rtol, budget.unknowns, budget.seconds, mesh and codec(CylinderMesh).plain(mesh)],
    )


def simulation_key(curve: Curve, orders: Sequence[float], setting: MonteCarloSection) -> str:
    """What the record of a simulation is found by."""
    settings = setting.model_dump(mode="json")
    return _digest(SimulatedCurve, **_of_curve(curve), orders=list(orders), setting=settings)


def _of_curve(curve: Curve) -> dict[str, Any]:
    """The parameters, and the system and the noise as they are written, with the versions of other packages' kinds."""
    kinds = [[repr(half), version_of(type(half))] for half in curve.problem.halves]  # type: ignore[arg-type]
    return {"parameters": dict(curve.parameters), "kinds": kinds}


def record_of(result: CurveResult | SimulatedCurve) -> Record:
    """All of a result but its curve."""
    kind: Any = type(result)
    return {name: each.plain(getattr(result, name)) for name, each in _recorded(kind).items()}


def result_of(record: Mapping[str, Any], curve: Curve) -> CurveResult:
    """The result of a curve from its record. Raises `ValueError` where that has another form."""
    return CurveResult(curve, **_made(CurveResult, record))


def simulated_of(record: Mapping[str, Any], curve: Curve) -> SimulatedCurve:
    """The simulation of a curve from its record. Raises `ValueError` where that has another form."""
    return SimulatedCurve(curve, **_made(SimulatedCurve, record))


def _made(kind: type, record: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes that a record holds."""
    try:
        return {name: each.made(record[name]) for name, each in _recorded(kind).items()}
    except (LookupError, TypeError, AttributeError, ValueError, zlib.error) as failure:
        raise ValueError(f"this is no record of a {kind.__name__}: {failure!r}") from failure


def _digest(kind: type, **content: Any) -> str:
    """A key from what results of a kind follow from and from their form; it begins with their version."""
    form = {name: each.form for name, each in _recorded(kind).items()}
    text = json.dumps({"form": form, **content}, sort_keys=True)
    return f"{RESULT_VERSION}-{hashlib.sha256(text.encode()).hexdigest()}"


def is_current(key: str) -> bool:
    """Whether a key is that of a record of this version."""
    return key.startswith(f"{RESULT_VERSION}-")


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
    origin, parts, is_row = get_origin(kind), get_args(kind), is_dataclass(kind)
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
    if origin is np.ndarray:
        return Codec("array", _packed, _unpacked)
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
    names = {}
    if kind is SimulatedCurve:
        from fpsolve.simulation import MonteCarlo, Response

        names = {"MonteCarlo": MonteCarlo, "Response": Response}
    hints = get_type_hints(kind, localns=names)
    return {each.name: codec(hints[each.name]) for each in fields(kind) if each.name != "curve"}


def _checked(data: Any, kind: Any) -> Any:
    """Plain data of a kind. Raises TypeError where they are of another one."""
    if not isinstance(data, kind) or (isinstance(data, bool) and kind is not bool):
        raise TypeError(f"{data!r} is of another kind than {kind}")
    return data


def _packed(value: FloatArray) -> Record:
    data = np.ascontiguousarray(value, dtype="<f8").tobytes()
    return {"shape": list(value.shape), "data": b64encode(zlib.compress(data)).decode("ascii")}


def _unpacked(packed: Mapping[str, Any]) -> FloatArray:
    data = zlib.decompress(b64decode(packed["data"], validate=True))
    return np.frombuffer(data, dtype="<f8").reshape(tuple(packed["shape"])).astype(float)


_SIMPLE: Mapping[Any, Codec] = {
    Any: Codec("any", lambda value: value, lambda data: data),
    str: Codec("text", str, lambda data: data if type(data) is str else _checked(data, str)),
    bool: Codec("bool", bool, lambda data: _checked(data, bool)),
    int: Codec("int", int, lambda data: _checked(data, int)),
    float: Codec("float", lambda value: float(value) if math.isfinite(value) else str(float(value)), float),
    float | str: Codec("number or text", lambda value: value, lambda data: _checked(data, float | str)),
    Message: Codec("message", lambda value: message_of(value).to_data(), Message.from_data),
}
"""For what has no parts."""
