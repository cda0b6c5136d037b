"""What summary.json has of a curve beyond the tables, as tables in the table of the curve."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fpsolve.analysis.excursions import Excursion
from fpsolve.analysis.sensitivity import RECORDS, Sensitivities, Slopes
from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread
from fpsolve.case.case import Case
from fpsolve.case.sections import EXCURSIONS, RESPONSE, SENSITIVITIES
from fpsolve.exponent.error import MEANINGLESS, Estimate, InvariantClass
from fpsolve.model.quantity import LYAPUNOV_EXPONENT
from fpsolve.results.table import pair
from fpsolve.solve.curve import CurveResponse, CurveResult
from fpsolve.solve.intervals import ENDS, spreads_of


def beyond_tables(case: Case, result: CurveResult) -> dict[str, Any]:
    """What neither results.nc nor a CSV file has, by its name; None where it is asked for and not there."""
    found = dict[str, Any]()
    if result.classes:
        found["classes"] = [_class(each) for each in result.classes]
    if EXCURSIONS in case.asked:
        found[EXCURSIONS] = result.excursion and _excursion(case, result.excursion)
    if RESPONSE in case.asked:
        found[RESPONSE] = result.response and _response(result.response)
    if SENSITIVITIES in case.asked:
        found[SENSITIVITIES] = result.sensitivities and _sensitivities(result.sensitivities)
    if case.uncertain and result.curve.is_possible:
        found["uncertainty"] = _intervals(case, result)
    return found


def says_more(case: Case, result: CurveResult) -> bool:
    """Whether there is more of a curve than its numbers in tables."""
    return any(result.remarks.values()) or bool(beyond_tables(case, result))


def _class(found: InvariantClass) -> dict[str, Any]:
    """λ and Λ(p) of a block or a ray."""
    columns = found.p.tolist(), found.value.tolist(), found.error_estimate.tolist()
    return {
        "name": found.name,
        **pair(LYAPUNOV_EXPONENT.name, found.lyapunov_exponent),
        "moments": [dict(zip(("p", "moment", "moment_error"), row, strict=True)) for row in zip(*columns, strict=True)],
    }


def _sensitivities(known: Sensitivities) -> Mapping[str, Any]:
    """∂/∂θ by the key of θ, null where its error leaves it no meaning, and the estimates of these errors alike."""

    def numbers(of: Callable[[Estimate], float]) -> dict[str, Any]:
        def row(slopes: Slopes) -> dict[str, float | None]:
            return {key: of(each) if each.relative_error <= MEANINGLESS else None for key, each in slopes.items()}

        moments = zip(known.p.tolist(), known.moments, strict=True)
        indices = {name: row(known.indices[name]) if name in known.indices else None for name in RECORDS}
        return {"moments": [{"p": p, **row(slopes)} for p, slopes in moments], **indices}

    errors = numbers(lambda each: each.error_estimate)
    return {**numbers(lambda each: each.value), "errors": errors}


def _excursion(case: Case, found: Excursion) -> Mapping[str, Any]:
    """The start, the bounds and the asymptotic number of upcrossings at all levels, and what these follow from."""
    levels = np.array(case.excursions.levels)
    rows = zip(levels.tolist(), *(each.tolist() for each in found.bounds(levels)), strict=True)
    many = [None if math.isnan(each) else each for each in found.expected_upcrossings(levels).tolist()]
    return {
        "start": {"phi": found.phi, "xi": found.xi},
        "is_certain": found.is_certain,
        **pair("stability_index", found.stability_index),
        **pair("lower", found.lower),
        **pair("upper", found.upper),
        **pair("upcrossings", found.upcrossings),
        "levels": [
            {"level": level, "least_probable": low, "most_probable": high, "upcrossings": count}
            for (level, low, high), count in zip(rows, many, strict=True)
        ],
    }


def _response(found: CurveResponse) -> Mapping[str, Any]:
    """The means and impacts with their errors, what the density does near rest, and how far these are to be trusted."""
    means: dict[str, Any] = {}
    for name, number in found.means.items():
        means |= pair(name, number)
    content = {
        "means": means,
        **({} if found.impact_rate is None else pair("impact_rate", found.impact_rate)),
    }
    if found.balance is not None:
        content |= {
            "has_hump": found.has_hump,
            "has_crater": found.has_crater,
            **pair("balance", found.balance),
            "least_over_largest_density": found.least,
            "unknowns": found.unknowns,
        }
    return content


def _intervals(case: Case, result: CurveResult) -> Mapping[str, Any]:
    """What is uncertain of a curve, and how that of the parameters is."""
    found, laws = spreads_of(case, result), case.uncertain.laws(result.curve.problem)
    return {
        "level": LEVEL,
        "laws": {
            key: {name: getattr(each, name) for name in ("value", "sd", "mean", "deviation")}
            for key, each in laws.items()
        },
        **{name: _plain(found.indices[name]) if name in found.indices else None for name in UNCERTAIN},
        "moments": [{"p": p, **_plain(each)} for p, each in found.moments.items()],
    }


def _plain(spread: Spread) -> dict[str, float]:
    """A spread to first order as files have it."""
    return {name: getattr(spread, name) for name in ("mean", "deviation", *ENDS)} | {
        "probability_below_0": spread.below
    }
