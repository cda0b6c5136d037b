"""Intervals of the numbers of a case whose parameters are uncertain, to first order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread, spread_of
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.exponent.quantities import MOMENT, SUMMARY_NUMBERS
from fpsolve.solve.question import Numbers, Question
from fpsolve.solve.set_result import SetResult

INTERVAL = f"{LEVEL:.0%} interval"
"""The heading of intervals in tables."""


@dataclass(frozen=True)
class Spreads:
    """The spreads of a parameter set to first order.

    Attributes:
        summary_numbers: by the names of λ and δ_p, without those that are not there.
        moments: of Λ(p), by p, without those that are not there.
    """

    summary_numbers: Mapping[str, Spread] = field(default_factory=dict)
    moments: Mapping[float, Spread] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.summary_numbers or self.moments)


def spreads_of(case: Case, result: SetResult) -> Spreads:
    """Those of a parameter set; empty where nothing is uncertain, or there are no sensitivities."""
    slopes = result.sensitivities
    if not case.uncertain or slopes is None:
        return Spreads()
    laws = case.uncertain.laws(result.parameter_set.problem)
    summary_numbers = {
        name: spread_of(each.value, slopes.summary_numbers.get(name, {}), laws)
        for name in UNCERTAIN
        if (each := result.estimates[name]) is not None
    }
    rows = zip(slopes.p.tolist(), slopes.moments, strict=True)
    moments = {p: spread_of(each.value, row, laws) for p, row in rows if p and (each := result.moment(p))}
    return Spreads(
        {name: each for name, each in summary_numbers.items() if each is not None},
        {p: each for p, each in moments.items() if each is not None},
    )


def _numbers(case: Case, result: SetResult | None) -> Numbers:
    spreads = spreads_of(case, result) if result else Spreads()
    of_p = _ends([spreads.moments.get(p) for p in result.moments.p.tolist()] if result else [])
    ends = {MOMENT: of_p} | {
        SUMMARY_NUMBERS[name]: _ends([spreads.summary_numbers.get(name)])[:, 0] for name in UNCERTAIN
    }
    return {
        quantity.end(which, LEVEL): values
        for quantity, both in ends.items()
        if case.uncertain and quantity.name in case.asked
        for which, values in zip(("low", "high"), both, strict=True)
    }


def _ends(spreads: Sequence[Spread | None]) -> FloatArray:
    """The lower and the upper ends of some intervals, shape (2, n); NaN where there is none."""
    ends = [(each.low, each.high) if each else (math.nan, math.nan) for each in spreads]
    return np.reshape(ends, (-1, 2)).T


QUESTION: Question = Question("intervals", numbers=_numbers)
