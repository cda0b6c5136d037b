"""Intervals of the numbers of a case whose parameters are uncertain, to first order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread, spread_of
from fpsolve.case.case import Case
from fpsolve.exponent.quantities import INDICES, MOMENT
from fpsolve.model.quantity import Quantity
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.question import Question

INTERVAL = f"{LEVEL:.0%} interval"
"""The heading of intervals in tables."""
ENDS = ("low", "high")
"""Names of the ends of an interval."""


@dataclass(frozen=True)
class Spreads:
    """The spreads of a curve to first order.

    Attributes:
        indices: by the names of λ and δ_p, without those that are not there.
        moments: of Λ(p), by p, without those that are not there.
    """

    indices: Mapping[str, Spread] = field(default_factory=dict)
    moments: Mapping[float, Spread] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.indices or self.moments)


def spreads_of(case: Case, result: CurveResult) -> Spreads:
    """Those of a curve; empty where nothing is uncertain, or there are no sensitivities."""
    slopes = result.sensitivities
    if not case.uncertain or slopes is None:
        return Spreads()
    laws = case.uncertain.laws(result.curve.problem)
    indices = {
        name: spread_of(each.value, slopes.indices.get(name, {}), laws)
        for name in UNCERTAIN
        if (each := result.estimates[name]) is not None
    }
    rows = zip(slopes.p.tolist(), slopes.moments, strict=True)
    moments = {p: spread_of(each.value, row, laws) for p, row in rows if p and (each := result.moment(p))}
    return Spreads(
        {name: each for name, each in indices.items() if each is not None},
        {p: each for p, each in moments.items() if each is not None},
    )


def _numbers(case: Case, result: CurveResult | None) -> Mapping[Quantity, Any]:
    spreads = spreads_of(case, result) if result else Spreads()
    of_p = [spreads.moments.get(p) for p in result.moments.p.tolist()] if result else []
    uncertain = (MOMENT, *(INDICES[name] for name in UNCERTAIN)) if case.uncertain else ()
    return {
        each.end(end, LEVEL): np.array([getattr(at, end, math.nan) for at in of_p], dtype=float)
        if each is MOMENT
        else getattr(spreads.indices.get(each.name), end, None)
        for each in uncertain
        if each.name in case.asked
        for end in ENDS
    }


QUESTION: Question = Question("intervals", numbers=_numbers)
