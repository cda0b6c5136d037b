"""Sweeps over one or two keys from few solves: what surfaces over the ranges of the keys tell of all sets of a case.

Where there is no surface over all of them, or more than its nodes were needed, halves of the frame are tried.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpsolve.analysis.index_surface import IndexSurface
from fpsolve.analysis.surface import Surface
from fpsolve.arrays import FloatArray, is_log_spaced
from fpsolve.case.case import Case, Curve
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES
from fpsolve.model.quantity import MOMENT, STABILITY_INDEX
from fpsolve.results.curve import NO_MOMENTS, CurveResult, MomentColumns

OF_ERROR = 0.5
"""Share of rtol that a surface is made for: what is left and the space have one each at most."""
SPLITS = 4
"""How often a frame is halved."""
WORTH = 200
"""Number of sets of a half that are worth a surface."""
Wanted = tuple[str, float]
"""The name of a quantity, and p of a moment."""


@dataclass(frozen=True, eq=False)
class OfSets:
    """A quantity of all sets of a case.

    Attributes:
        values, errors, scales: and what rtol is of, shape (sets,); NaN where no surface tells it.
        nodes: how many solves there were.
        seconds: how long the processor took.
    """

    values: FloatArray
    errors: FloatArray
    scales: FloatArray
    nodes: int
    seconds: float

    @property
    def are_told(self) -> NDArray[np.bool_]:
        return np.isfinite(self.values)


def wanted(case: Case) -> list[Wanted]:
    """What a case asks of surfaces."""
    names = [(name, 0.0) for name in case.asked if name != MOMENT.name]
    return [*((MOMENT.name, p) for p in (case.p.tolist() if MOMENT.name in case.asked else ())), *names]


def stated(case: Case, what: Wanted) -> dict[str, Any]:
    """What these numbers follow from, beside the parameters that all sets have in common."""
    points = case.vary.points
    return {"what": what, "rtol": case.rtol, "keys": case.vary.keys, "points": sha256(points.tobytes()).hexdigest()}


def solved_sets(case: Case, what: Wanted) -> OfSets:
    """A quantity of all sets."""
    started, points = process_time(), case.vary.points
    found, nodes = np.full((3, len(points)), math.nan), 0
    logs = [is_log_spaced(values) for values in case.vary.columns.values()]
    frames: list[tuple[NDArray[np.int64], int]] = [(np.arange(len(points)), 0)]
    if what == (MOMENT.name, 0.0):
        found[:], frames = np.array([[0.0], [0.0], [1.0]]), []
    while frames:
        sets, splits = frames.pop()
        low, high = points[sets].min(axis=0), points[sets].max(axis=0)
        if not np.all(low < high):
            continue
        ranges = {
            key: (*ends, "log" if is_log else "linear")
            for key, *ends, is_log in zip(case.vary.keys, low.tolist(), high.tolist(), logs, strict=True)
        }
        surface = _surface(case, what, ranges)
        if surface is not None:
            nodes += len(surface.nodes)
            shares = surface.shares(*points[sets].T)
            values, _ = surface.at_shares(shares, has_gradient=False, solves=False)
            errors, scales = surface.errors(shares, values)
            told = errors <= case.rtol * scales
            found[:, sets[told]] = values[told], errors[told], scales[told]
            sets = sets[~told]
        k = splits % len(logs)
        middle = math.sqrt(low[k] * high[k]) if logs[k] else 0.5 * (low[k] + high[k])
        for half in (sets[points[sets, k] <= middle], sets[points[sets, k] > middle]):
            if splits < SPLITS and half.size >= WORTH:
                frames.append((half, splits + 1))
    values, errors, scales = found
    return OfSets(values, errors, scales, nodes, process_time() - started)


def _surface(case: Case, what: Wanted, ranges: Mapping[str, Any]) -> Surface | None:
    """That of a quantity; None where there is none."""
    options: Any = {"rtol": OF_ERROR * case.rtol, "budget": case.budget}
    try:
        if what[0] == STABILITY_INDEX.name:
            surface: Surface = IndexSurface(case.problem, ranges, **options)
        else:
            surface = Surface(case.problem, ranges, what[1], **options)
        return surface if surface.is_converged else None
    except (FpsolveError, np.linalg.LinAlgError):
        return None


def result_at(curve: Curve, known: Mapping[Wanted, OfSets]) -> CurveResult:
    """What surfaces tell of a set."""
    at, p = curve.number - 1, [p for name, p in known if name == MOMENT.name]
    numbers = {what: [float(each[at]) for each in (of.values, of.errors, of.scales)] for what, of in known.items()}
    value, error = (np.array([numbers[MOMENT.name, each][k] for each in p]) for k in (0, 1))
    none = np.full(len(p), math.nan)
    moments = MomentColumns(np.array(p), value, none, error, none, none, none) if p else NO_MOMENTS
    indices: dict[str, Estimate | None] = dict.fromkeys(INDICES)
    for name, quantity in INDICES.items():
        if (name, 0.0) in numbers:
            value_of, error_of, scale = numbers[name, 0.0]
            indices[name] = Estimate(value_of, error_of, scale, quantity=quantity)
    return CurveResult(curve, moments, indices, seconds=seconds_of(known))


def seconds_of(known: Mapping[Wanted, OfSets]) -> float:
    """How long the processor took for a set."""
    return round(sum(of.seconds / len(of.values) for of in known.values()), 6)
