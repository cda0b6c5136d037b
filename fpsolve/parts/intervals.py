"""Intervals of the numbers of a case whose parameters are uncertain: to first order, and by samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread, latin_hypercube, spread_of
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.vary import Vary
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES, MOMENT
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import Quantity, moment_at
from fpsolve.page.page import Block, Column, Grid
from fpsolve.parts.part import Part, Settings
from fpsolve.results.curve import CurveResult
from fpsolve.results.table import Row
from fpsolve.results.text import interval, percent

SAMPLE = "sample"
"""The name of the folder of the samples of a case, and of the file of their quantiles."""
APART = 0.1
"""Of the width of an interval, by which two of them differ so that it is told."""
SHARES = (0.5 - 0.5 * LEVEL, 0.5, 0.5 + 0.5 * LEVEL)
"""Quantiles of an interval, and the median."""
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
    values = dict(zip(result.moments.p.tolist(), result.moments.value.tolist(), strict=True))
    rows = zip(slopes.p.tolist(), slopes.moments, strict=True)
    moments = {p: spread_of(values[p], row, laws) for p, row in rows if p and p in values}
    return Spreads(
        {name: each for name, each in indices.items() if each is not None},
        {p: each for p, each in moments.items() if each is not None},
    )


@dataclass(frozen=True)
class Sampled:
    """What the samples of a case say of one quantity.

    Attributes:
        quantity: which.
        p: of Λ(p); None for the others.
        count: of the samples that have it.
        mean, deviation: of these.
        low, median, high: their quantiles; low and high are the ends of the interval of `LEVEL`.
        below: the share of them that is negative.
        spread: to first order.
        apart: how far the intervals of both are from each other, as a share of the width of that to first order: of the
            same sets, so that chance does not count.
    """

    quantity: Quantity
    p: float | None
    count: int
    mean: float
    deviation: float
    low: float
    median: float
    high: float
    below: float
    spread: Spread
    apart: float

    @property
    def remark(self) -> Message | None:
        """That the first order does not serve, where it does not."""
        if not self.apart > APART:
            return None
        ends = {"low": self.spread.low, "high": self.spread.high, "least": self.low, "most": self.high}
        return Message(Code.CURVED, symbol=self.quantity.symbol, size=self.apart, count=self.count, **ends)


@dataclass(frozen=True)
class Samples:
    """The samples of a case.

    Attributes:
        planned, seed: how many sets were drawn, and the seed.
        failed: how many of them did not converge, in whole or in part.
        rows: of each quantity.
    """

    planned: int
    seed: int
    failed: int
    rows: tuple[Sampled, ...]

    @property
    def remarks(self) -> list[Message]:
        """Where the first order does not serve, and that sets are missing."""
        found = [each.remark for each in self.rows]
        missing = [Message(Code.SAMPLES_MISSING, count=self.failed, of=self.planned)] * bool(self.failed)
        absent = [
            Message(Code.SAMPLES_ABSENT, symbol=each.quantity.symbol, count=lacking, of=self.planned)
            for each in self.rows
            if (lacking := self.planned - self.failed - each.count) > 0
        ]
        return [*missing, *absent, *filter(None, found)]


def _drawn(case: Case) -> Vary:
    """The samples as parameter sets."""
    laws = case.uncertain.laws(case.problem)
    drawn = latin_hypercube(laws, case.uncertain.sample, case.uncertain.seed)
    return type(case.vary)(drawn, "zip")


def refuse_wrong_samples(case: Case) -> None:
    """Refuse samples some of which are no problem. Raises `FpsolveError`."""
    for varied in _drawn(case).sets() if case.uncertain.sample else ():
        try:
            case.problem.at(varied)
        except ValueError as failure:
            told = ", ".join(f"{key} = {value:.6g}" for key, value in varied.items())
            raise FpsolveError(f"{case.path}: uncertain: with {told}: {failure}; use a smaller deviation") from None


def sampled_case(case: Case) -> Case:
    """The case with its samples as parameter sets, beside it under the name of `SAMPLE`; λ, δ_p, Λ(p) are asked for."""
    vary = _drawn(case)
    wanted = [name for name in (MOMENT.name, *UNCERTAIN) if name in case.asked]
    output = case.output.model_copy(update={"quantities": tuple(wanted), "eigenfunctions": None, "figure": False})
    updated = {
        "vary": vary,
        "output": output,
        "uncertain": type(case.uncertain)(),
        "expect": (),
        "chart": None,
        "design": None,
    }
    made = case.model_copy(update={**updated, "figure": type(case.figure)()})
    made._path = case.path.with_name(f"{SAMPLE}.toml")
    return made


def samples_of(case: Case, result: CurveResult, sampled: Sequence[CurveResult]) -> Samples:
    """What the samples say, beside the first order.

    Args:
        case: whose parameters are uncertain.
        result: of the case itself.
        sampled: of the samples.
    """
    return Samples(
        planned=case.uncertain.sample,
        seed=case.uncertain.seed,
        failed=sum(each.status.fails for each in sampled),
        rows=tuple(_rows(case, result, list(sampled))),
    )


def _rows(case: Case, result: CurveResult, sampled: Sequence[CurveResult]) -> Iterator[Sampled]:
    spreads, slopes = spreads_of(case, result), result.sensitivities
    if slopes is None:
        return
    sets = {key: np.array([float(each.curve.varied[key]) for each in sampled]) for key in case.uncertain.deviations}
    for name, spread in spreads.indices.items():
        estimates = [each.estimates[name] for each in sampled]
        values = np.array([np.nan if each is None else each.value for each in estimates])
        yield _sampled(INDICES[name], None, values, spread, _linear(spread, slopes.indices[name], result, sets))
    rows = dict(zip(slopes.p.tolist(), slopes.moments, strict=True))
    for p, spread in spreads.moments.items():
        values = np.array([getattr(each.moment(p), "value", np.nan) for each in sampled])
        yield _sampled(moment_at(p), p, values, spread, _linear(spread, rows[p], result, sets))


def _linear(
    spread: Spread, slopes: Mapping[str, Estimate], result: CurveResult, sets: Mapping[str, FloatArray]
) -> FloatArray:
    """What the first order says of each set, shape (n,)."""
    values = result.curve.parameters
    return spread.value + sum(
        (slopes[key].value * (theta - float(values[key])) for key, theta in sets.items()), np.zeros(1)
    )


def _sampled(quantity: Quantity, p: float | None, values: FloatArray, spread: Spread, linear: FloatArray) -> Sampled:
    is_there = np.isfinite(values)
    found, first = values[is_there], linear[is_there]
    if not found.size:
        none = math.nan
        return Sampled(quantity, p, 0, none, none, none, none, none, none, spread, none)
    low, median, high = np.quantile(found, SHARES, method="hazen").tolist()
    least, _, most = np.quantile(first, SHARES, method="hazen").tolist()
    moved = low - least, high - most, (high - low) - (most - least)
    return Sampled(
        quantity=quantity,
        p=p,
        count=int(found.size),
        mean=float(np.mean(found)),
        deviation=float(np.std(found)),
        low=low,
        median=median,
        high=high,
        below=float(np.mean(found < 0)),
        spread=spread,
        apart=max(map(abs, moved)) / (most - least) if most > least else 0.0,
    )


def _settings(case: Case, number: int) -> Settings | None:
    return {} if case.uncertain else None


def _indices(case: Case) -> list[str]:
    """The names of the indices whose intervals are asked for."""
    return [name for name in INDICES if name in UNCERTAIN and name in case.asked] if case.uncertain else []


def _columns(case: Case) -> Sequence[Quantity]:
    about = [MOMENT] if case.uncertain and MOMENT.name in case.asked else []
    return [each.end(end, LEVEL) for each in (*about, *(INDICES[name] for name in _indices(case))) for end in ENDS]


def _row(case: Case, result: CurveResult) -> Row:
    if not case.uncertain:
        return {}
    spreads, row = spreads_of(case, result), dict[str, Any]()
    of_p = [spreads.moments.get(p) for p in result.moments.p.tolist()]
    for end in ENDS:
        row[f"{MOMENT.name}_{end}"] = np.array([getattr(each, end, math.nan) for each in of_p], dtype=float)
        row |= {f"{name}_{end}": getattr(spreads.indices.get(name), end, None) for name in _indices(case)}
    return row


def _content(case: Case, result: CurveResult) -> Mapping[str, Any]:
    """What is uncertain of a curve, and how that of the parameters is."""
    if not case.uncertain:
        return {}
    found, laws = spreads_of(case, result), case.uncertain.laws(result.curve.problem)
    content = {
        "level": LEVEL,
        "laws": {
            key: {"value": each.value, "sd": each.sd, "mean": each.mean, "deviation": each.deviation}
            for key, each in laws.items()
        },
        **{name: plain_spread(found.indices[name]) if name in found.indices else None for name in UNCERTAIN},
        "moments": [{"p": p, **plain_spread(each)} for p, each in found.moments.items()],
    }
    return {"uncertainty": content}


def plain_spread(spread: Spread) -> dict[str, float]:
    """A spread to first order as files have it."""
    return {name: getattr(spread, name) for name in ("mean", "deviation", *ENDS)} | {
        "probability_below_0": spread.below
    }


def show_samples(case: Case, samples: Samples) -> Iterator[Block]:
    """The intervals of the samples, their medians, and the intervals to first order."""
    columns = [Column("quantity"), Column(f"samples, {LEVEL:.0%}"), Column("median", 1), Column("P(< 0)")]
    remark = f"{samples.planned} samples of a Latin hypercube, seed {samples.seed}"
    grid = Grid(case.headline, [*columns, Column(f"first order, {LEVEL:.0%}"), Column("apart", 2)], remark=remark)
    for each in samples.rows:
        is_there = each.count > 0
        numbers = [interval(each.low, each.high), f"{each.median:.6g}", percent(each.below)]
        first = interval(each.spread.low, each.spread.high)
        apart = f"{each.apart:.0%}" if is_there else ""
        grid.rows.append([each.quantity.symbol, *(numbers if is_there else ["none", "", ""]), first, apart])
    yield grid


PART: Part = Part("intervals", _settings, columns=_columns, row=_row, content=_content)
