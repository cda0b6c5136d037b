"""Simulated curves as plain data, from which they are made again to the last bit."""

from __future__ import annotations

import math
import zlib
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.curves import Curve
from fpsolve.case.sections import MonteCarloSection
from fpsolve.study.records import digest
from fpsolve.study.results import SimulatedCurve


def to_record(simulated: SimulatedCurve) -> dict[str, Any]:
    """What a simulation found, all but the curve, for strict JSON: an array is a compressed text."""
    return {
        "result": _plain(asdict(simulated.result)),
        "response": None if simulated.response is None else _plain(asdict(simulated.response)),
        "warnings": list(simulated.warnings),
        "interrupted": simulated.interrupted,
    }


def simulation_key(curve: Curve, orders: Sequence[float], setting: MonteCarloSection) -> str:
    """What the record of a simulation is found by."""
    content = {"parameters": dict(curve.parameters), "orders": list(orders), "setting": setting.model_dump(mode="json")}
    return digest(content)


def simulated_of(record: Mapping[str, Any], curve: Curve) -> SimulatedCurve:
    """The simulation of a curve from its record. Raises `ValueError` where it is none."""
    from fpsolve.simulation.estimators import MonteCarlo
    from fpsolve.simulation.response import Response

    try:
        response = None if record["response"] is None else _made(Response, record["response"])
        result = _made(MonteCarlo, record["result"])
        return SimulatedCurve(curve, result, response, tuple(record["warnings"]), record["interrupted"])
    except (KeyError, TypeError, AttributeError, ValueError, zlib.error) as failure:
        raise ValueError(f"this is no record of a simulation: {failure!r}") from failure


def _plain(value: Any) -> Any:
    """Dictionaries, lists, texts and numbers; those that JSON has not, nan and inf, are texts."""
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value, dtype="<f8").tobytes()
        return {"shape": list(value.shape), "data": b64encode(zlib.compress(data)).decode("ascii")}
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    value = value.item() if isinstance(value, np.generic) else value
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _array(packed: Mapping[str, Any]) -> FloatArray:
    data = zlib.decompress(b64decode(packed["data"], validate=True))
    return np.frombuffer(data, dtype="<f8").reshape(tuple(packed["shape"])).astype(float)


def _estimates(records: list[dict[str, Any]]) -> tuple[Any, ...]:
    from fpsolve.simulation.estimators import MomentEstimate

    return tuple(_made(MomentEstimate, each) for each in records)


_MAKERS: Mapping[str, Callable[[Any], Any]] = {
    "int": int,
    "bool": bool,
    "float": float,
    "float | None": lambda value: None if value is None else float(value),
    "Estimator": str,
    "FloatArray": _array,
    "tuple[str, ...]": tuple,
    "Mapping[str, float | str]": dict,
    "tuple[MomentEstimate, ...]": _estimates,
    "dict[str, tuple[float, float]]": lambda pairs: {key: (float(a), float(b)) for key, (a, b) in pairs.items()},
}
"""What makes each kind of attribute from plain data, by its annotation."""


def _made(kind: Any, record: Mapping[str, Any]) -> Any:
    """A dataclass from the record of its attributes."""
    return kind(**{each.name: _MAKERS[str(each.type)](record[each.name]) for each in fields(kind)})
