"""Results as plain data and back, exactly: numbers, texts, lists and tables, which JSON can hold."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from fpsolve.analysis.sensitivity import Sensitivities, Slopes
from fpsolve.case.curves import Curve
from fpsolve.exponent.error import Estimate, Failure
from fpsolve.model.quantity import UNNAMED, Quantity
from fpsolve.study.results import CurveResult, Moments
from fpsolve.study.solve import Numerics, Wanted

RESULT_VERSION = 2
"""Of what is computed from the same parameters; records of another one are computed anew."""
Record = dict[str, Any]
_FORM = [field.name for kind in (CurveResult, Moments, Estimate, Failure, Sensitivities) for field in fields(kind)]
"""What a record holds; those of another form are not read."""


def key_of(curve: Curve, wanted: Wanted, numerics: Numerics) -> str:
    """What a record is found by: a digest of all that its numbers and sentences follow from."""
    mesh, budget = numerics.mesh, numerics.budget
    content = {
        "form": _FORM,
        "parameters": dict(curve.parameters),
        "p": wanted.p.tolist(),
        "wanted": [wanted.indices, wanted.shown, wanted.density, wanted.differentiated],
        "numerics": [numerics.rtol, budget.unknowns, budget.seconds, None if mesh is None else _plain(mesh)],
    }
    return digest(content)


def digest(content: Record) -> str:
    """A key from what results follow from, and from their version."""
    text = json.dumps({"version": RESULT_VERSION, **content}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def record_of(result: CurveResult) -> Record:
    """All of a result but its curve."""
    slopes = result.sensitivities
    return {
        "moments": _plain(result.moments),
        "estimates": {name: each and _estimated(each) for name, each in result.estimates.items()},
        "discretisation": result.discretisation,
        "warnings": list(result.warnings),
        "notes": list(result.notes),
        "failures": [[failure.p, failure.reason] for failure in result.failures],
        "sensitivities": None if slopes is None else _sensitivities(slopes),
        "seconds": result.seconds,
    }


def result_of(record: Mapping[str, Any], curve: Curve) -> CurveResult:
    """The result of a curve, from its record. Raises `KeyError` or `TypeError` where it is none."""
    slopes = record["sensitivities"]
    return CurveResult(
        curve=curve,
        moments=Moments(**{name: np.array(values, dtype=float) for name, values in record["moments"].items()}),
        estimates={name: row and _estimate(row) for name, row in record["estimates"].items()},
        discretisation=record["discretisation"],
        warnings=tuple(record["warnings"]),
        notes=tuple(record["notes"]),
        failures=tuple(Failure(p, reason) for p, reason in record["failures"]),
        sensitivities=None if slopes is None else _differentiated(slopes),
        seconds=record["seconds"],
    )


def _plain(data: Any) -> Record:
    """The fields of a dataclass, arrays as lists."""
    values = {field.name: getattr(data, field.name) for field in fields(data)}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def _estimated(estimate: Estimate) -> list[Any]:
    """The numbers of an estimate, and its quantity where it has a name."""
    *numbers, quantity = asdict(estimate).values()
    return numbers if estimate.quantity == UNNAMED else [*numbers, quantity]


def _estimate(row: Sequence[Any]) -> Estimate:
    value, error, scale, meaning, *named = row
    return Estimate(value, error, scale, meaning, *(Quantity(**each) for each in named))


def _sensitivities(found: Sensitivities) -> Record:
    def rows(slopes: Slopes) -> Record:
        return {key: _estimated(each) for key, each in slopes.items()}

    return {
        "theta": dict(found.theta),
        "p": found.p.tolist(),
        "moments": [rows(slopes) for slopes in found.moments],
        "indices": {name: rows(slopes) for name, slopes in found.indices.items()},
        "notes": list(found.notes),
    }


def _differentiated(record: Mapping[str, Any]) -> Sensitivities:
    def slopes(rows: Mapping[str, Any]) -> Slopes:
        return {key: _estimate(row) for key, row in rows.items()}

    return Sensitivities(
        theta=record["theta"],
        p=np.array(record["p"], dtype=float),
        moments=tuple(slopes(rows) for rows in record["moments"]),
        indices={name: slopes(rows) for name, rows in record["indices"].items()},
        notes=tuple(record["notes"]),
    )
