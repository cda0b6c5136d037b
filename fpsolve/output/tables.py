"""Results as tables: summary.json, moments.csv, curves.csv, response.csv; monte_carlo.json and its response."""

from __future__ import annotations

import csv
import json
import math
import platform
import shlex
import socket
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from datetime import datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve import __version__
from fpsolve.analysis.excursions import Excursion
from fpsolve.analysis.sensitivity import DIFFERENTIATED, Sensitivities, Slopes
from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread
from fpsolve.case.case import Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.sections import EXCURSIONS, RESPONSE, SENSITIVITIES
from fpsolve.exponent.error import MEANINGLESS, Estimate
from fpsolve.exponent.quantities import INDICES, Index
from fpsolve.files import draft, write_csv, write_json
from fpsolve.messages import message_of
from fpsolve.model.kinds import version_of
from fpsolve.model.quantity import MOMENT, MOMENTS, RATE_FUNCTION, Quantity
from fpsolve.study.response import CurveResponse
from fpsolve.study.results import CurveResult, SimulatedCurve
from fpsolve.study.uncertain import SAMPLE, Samples, spreads_of

ENDS = ("low", "high")
"""Of an interval."""
MOST_INDENTED = 100
"""Curves of a summary that is made for eyes, too."""
MOST_SUMMARISED = 1000
"""Curves of which summary.json has all numbers; of more it leaves them to results.nc and to the CSV files."""
_END = "\n ]\n}\n"


def facts_of(case: Case, started: datetime, seconds: float) -> dict[str, Any]:
    """Of a run: versions, the command, the machine, when it began and how long it takes, and the case as written."""
    name, *rest = sys.argv
    kinds = filter(None, (version_of(type(half)) for half in case.problem.halves))  # type: ignore[arg-type]
    packages = _packages() | dict(each.rsplit(" ", 1) for each in kinds)
    return {
        "versions": {"fpsolve": __version__, "python": platform.python_version(), **packages},
        "command": shlex.join(
            ["python", "-m", "fpsolve", *rest] if name.endswith("__main__.py") else [Path(name).name, *rest]
        ),
        "host": socket.gethostname(),
        "started": started.isoformat(timespec="seconds"),
        "wall_seconds": round(seconds, 3),
        "overrides": list(case.overrides),
        "case_text": case.text,
    }


@cache
def _packages() -> dict[str, str]:
    """The versions of those that numbers depend on."""
    return {name: version(name) for name in ("numpy", "scipy", "scikit-fem")}


def write_results(
    case: Case, results: Sequence[CurveResult], folder: Path, facts: Mapping[str, Any], finished: int | None = None
) -> None:
    """summary.json, which says whether all curves of the case are there, moments.csv and curves.csv, in one go.

    Of many curves summary.json has the state, the messages and what no other table has; see `MOST_SUMMARISED`.

    Args:
        facts: on the run, see `facts_of`.
        finished: how many of them are; all if None.
    """
    has_moments, names = MOMENT.name in case.asked, columns_of(case)
    indices = [column.name for each in asked(case) for column in (each, each.error())]
    settled = [column.name for each in response_columns(case).values() for column in (each, each.error())]
    ends = [f"{each.name}_{part}" for each in _uncertain(case) for part in ENDS]
    more = ENDS if case.uncertain else ()
    is_short = case.planned > MOST_SUMMARISED
    with ExitStack() as stack:
        summary, moments, curves = (
            stack.enter_context(draft(folder / name)) for name in ("summary.json", "moments.csv", "curves.csv")
        )
        by_moment, by_curve = csv.writer(moments), csv.writer(curves)
        by_moment.writerow([*case.vary.keys, *names, *more])
        by_curve.writerow([*case.vary.keys, *indices, *settled, *ends, "p_solved", "p_failed", "status", "seconds"])
        summary.write(_beginning(case, len(results) if finished is None else finished, facts, held=is_short))
        for number, result in enumerate(results):
            varied, done, rows = result.curve.varied.values(), result.moments, _rows(result, names)
            summary.write(_entry(case, number, _short_summary(case, result) if is_short else _summary(case, result)))
            spreads = spreads_of(case, result)
            for row in rows:
                by_moment.writerow([*varied, *row, *(_ends(spreads.moments.get(float(row[0] or 0.0))) if more else ())])
            intervals = [end for each in _uncertain(case) for end in _ends(spreads.indices.get(each.name))]
            found = [result.estimates[each.name] for each in asked(case)]
            stationary = result.response.numbers if result.response else {}
            found += [stationary.get(name) for name in response_columns(case)]
            numbers = [number for each in found for number in ((each.value, each.error_estimate) if each else ("", ""))]
            counts = [done.p.size, (case.p.size if has_moments else 0) - done.p.size]
            by_curve.writerow([*varied, *numbers, *intervals, *counts, result.status.word, round(result.seconds, 6)])
        summary.write(_END)


def whole_summary(case: Case, results: Sequence[CurveResult], facts: Mapping[str, Any]) -> str:
    """All numbers and messages of all curves in one line of JSON, as summary.json has them of few curves.

    Args:
        facts: on the run, see `facts_of`.
    """
    entries = (_entry(case, number, _summary(case, result)) for number, result in enumerate(results))
    lines = "".join([_beginning(case, len(results), facts), *entries, _END]).splitlines()
    return " ".join(line.strip() for line in lines)


def _beginning(case: Case, done: int, facts: Mapping[str, Any], *, held: bool = False) -> str:
    """What summary.json has before its curves; with the parameters that these have in common, if they are held."""
    state = {"complete": done == case.planned, "planned": case.planned, "done": done}
    common = {"parameters": dict(case.held)} if held else {}
    start = json.dumps({**head(case), **state, **facts, **common}, indent=1, ensure_ascii=False)
    return start.removesuffix("\n}") + ',\n "curves": ['


def _entry(case: Case, number: int, content: Mapping[str, Any]) -> str:
    """A curve in summary.json after so many others."""
    indent = 1 if case.planned <= MOST_INDENTED else None
    text = json.dumps(content, indent=indent, allow_nan=False, ensure_ascii=False).replace("\n", "\n  ")
    return (",\n  " if number else "\n  ") + text


def _rows(result: CurveResult, names: Sequence[str]) -> list[list[float | None]]:
    """The moments of a curve, a row for each p; None where there is no number."""
    columns = [getattr(result.moments, name).tolist() for name in names]
    return [[None if math.isnan(each) else each for each in row] for row in zip(*columns, strict=True)]


def _uncertain(case: Case) -> list[Index]:
    """The indices whose intervals are asked for."""
    return [each for each in asked(case) if each.name in UNCERTAIN] if case.uncertain else []


def _ends(spread: Spread | None) -> list[Any]:
    """The ends of an interval; nothing in their places where there is none."""
    return ["", ""] if spread is None else [getattr(spread, part) for part in ENDS]


def _spread(spread: Spread) -> dict[str, float]:
    """To first order."""
    return {name: getattr(spread, name) for name in ("mean", "deviation", *ENDS)} | {
        "probability_below_0": spread.below
    }


def _spreads(case: Case, result: CurveResult) -> dict[str, Any]:
    """What is uncertain of a curve, and how that of the parameters is."""
    found, laws = spreads_of(case, result), case.uncertain.laws(result.curve.problem)
    return {
        "level": LEVEL,
        "laws": {
            key: {"value": each.value, "sd": each.sd, "mean": each.mean, "deviation": each.deviation}
            for key, each in laws.items()
        },
        **{name: _spread(found.indices[name]) if name in found.indices else None for name in UNCERTAIN},
        "moments": [{"p": p, **_spread(each)} for p, each in found.moments.items()],
    }


def write_samples(case: Case, samples: Samples, folder: Path) -> None:
    """sample.json: the quantiles of the samples of a case, beside the first order."""
    rows = [
        {"quantity": each.quantity.name, "p": each.p}
        | {name: getattr(each, name) for name in ("count", "mean", "deviation", "low", "median", "high")}
        | {"share_below_0": each.below, "first_order": _spread(each.spread), "apart": each.apart}
        for each in samples.rows
    ]
    content = {
        **head(case),
        "parameters": dict(case.curve({}).parameters),
        "level": LEVEL,
        **{name: getattr(samples, name) for name in ("planned", "seed", "failed")},
        "rows": [{key: None if each != each else each for key, each in row.items()} for row in rows],
        "warnings": in_case_words(samples.remarks),
    }
    write_json(folder / f"{SAMPLE}.json", content)


def columns_of(case: Case) -> list[str]:
    """The names of what a case asks for at every p."""
    return [*MOMENTS, *[RATE_FUNCTION.name] * (RATE_FUNCTION.name in case.asked)]


def asked(case: Case) -> list[Index]:
    """The indices that a case asks for."""
    return [index for name, index in INDICES.items() if name in case.asked]


def response_columns(case: Case) -> Mapping[str, Quantity]:
    """The numbers of the stationary response by their names, if a case asks for them."""
    return case.system.response.numbers if case.has_response else {}


def write_response(result: CurveResult, folder: Path) -> None:
    """response.csv of a curve, where it has a stationary density: that of the amplitude."""
    if result.response is None or (density := result.response.density) is None:
        return
    rows = zip(density.amplitude.tolist(), density.of_amplitude.tolist(), strict=True)
    write_csv(folder / f"response{result.curve.suffix}.csv", ["amplitude", "density"], rows)


def write_simulation(case: Case, simulated: SimulatedCurve, folder: Path) -> None:
    """monte_carlo.json of a curve, and monte_carlo_response.csv where there is a response."""
    suffix, result, response = simulated.curve.suffix, simulated.result, simulated.response
    content = {
        **head(case),
        **_parameters(simulated.curve),
        "estimates": [asdict(estimate) for estimate in result.estimates],
        **_with_errors(simulated.estimates),
        **{name: getattr(result, name) for name in ("paths", "time", "step", "seed", "impacts")},
        "response": response
        and {
            "means": _with_errors(response.means),
            **({} if response.impact_rate is None else {"impact_rate": response.impact_rate}),
            **{name: getattr(response, name) for name in ("outside", "time")},
        },
        "warnings": in_case_words(simulated.warnings),
    }
    write_json(folder / f"monte_carlo{suffix}.json", content)
    if response is None:
        return
    edges = response.amplitude_edges
    columns = (edges[:-1], edges[1:], response.amplitude_density, response.amplitude_error)
    rows = (map(float, row) for row in zip(*columns, strict=True))
    header = ["amplitude_from", "amplitude_to", "density", "standard_error"]
    write_csv(folder / f"monte_carlo_response{suffix}.csv", header, rows)


def in_case_words(messages: Sequence[str]) -> list[str]:
    """Messages as those read them who work with case files."""
    return [message_of(each).words(CASE_WORDS) for each in messages]


def head(case: Case) -> dict[str, Any]:
    """What every table begins with."""
    units = {"units": {"time": case.units.time}}
    return {"case": case.name, "title": case.title, "fpsolve_version": __version__, **units}


def _parameters(curve: Curve) -> dict[str, dict[str, Any]]:
    return {"parameters": dict(curve.parameters), "varied": dict(curve.varied)}


def _summary(case: Case, result: CurveResult) -> dict[str, Any]:
    """What a case asks for of a curve."""
    names = columns_of(case)
    found: dict[str, Any] = {}
    if MOMENT.name in case.asked:
        found["moments"] = [dict(zip(names, row, strict=True)) for row in _rows(result, names)]
    for index in asked(case):
        numbers = result.index(index)
        found[index.name] = numbers and {key: value if math.isfinite(value) else None for key, value in numbers.items()}
    return {
        **_parameters(result.curve),
        "status": result.status.word,
        **found,
        **_beyond_tables(case, result),
        "discretisation": result.discretisation,
        **_told(result),
        "seconds": round(result.seconds, 6),
    }


def _short_summary(case: Case, result: CurveResult) -> dict[str, Any]:
    """The same without what results.nc has, and without the discretisation."""
    varied = dict(result.curve.varied)
    return {"varied": varied, "status": result.status.word, **_beyond_tables(case, result), **_told(result)}


def _told(result: CurveResult) -> dict[str, list[str]]:
    """The messages, with those of failures among the warnings."""
    return {
        "warnings": in_case_words([*result.warnings, *(failure.reason for failure in result.failures)]),
        "notes": in_case_words(result.notes),
    }


def _beyond_tables(case: Case, result: CurveResult) -> dict[str, Any]:
    """What neither results.nc nor a CSV file has."""
    found: dict[str, Any] = {}
    if result.jumps:
        found["jumps"] = [
            {"phase": ray.phase, "log_factor": ray.log_factor}
            | {
                name: each and {"value": each.value, "error_estimate": each.error_estimate}
                for name, each in of_ray.items()
            }
            for ray, of_ray in zip(result.curve.problem.system.jumps, result.jumps, strict=True)
        ]
    if result.classes:
        found["classes"] = [
            {
                "name": each.name,
                "lyapunov_exponent": {
                    "value": each.lyapunov_exponent.value,
                    "error_estimate": each.lyapunov_exponent.error_estimate,
                },
                "moments": [
                    {"p": p, "value": value, "error_estimate": error}
                    for p, value, error in zip(
                        each.p.tolist(), each.value.tolist(), each.error_estimate.tolist(), strict=True
                    )
                ],
            }
            for each in result.classes
        ]
    if SENSITIVITIES in case.asked:
        found["sensitivities"] = None if result.sensitivities is None else _sensitivities(result.sensitivities)
    if EXCURSIONS in case.asked:
        found["excursions"] = None if result.excursion is None else _excursion(case, result.excursion)
    if case.has_response:
        found[RESPONSE] = None if result.response is None else _response(result.response)
    if case.uncertain:
        found["uncertainty"] = _spreads(case, result)
    return found


def _number(each: Estimate | None) -> dict[str, float] | None:
    return each and {"value": each.value, "error_estimate": each.error_estimate}


def _response(found: CurveResponse) -> dict[str, Any]:
    """The means and impacts with their errors, what the density does near rest, and how far these are to be trusted."""
    return {
        "means": {name: _number(each) for name, each in found.means.items()},
        **({} if found.impact_rate is None else {"impact_rate": _number(found.impact_rate)}),
        "has_hump": found.has_hump,
        "has_crater": found.has_crater,
        "balance": _number(found.balance),
        "least_over_largest_density": found.least,
        "unknowns": found.unknowns,
    }


def _excursion(case: Case, found: Excursion) -> dict[str, Any]:
    """The start, the bounds and the asymptotic number of upcrossings at all levels, and what these follow from."""
    levels = np.array(case.excursions.levels)
    rows = zip(levels.tolist(), *(each.tolist() for each in found.bounds(levels)), strict=True)
    many = [None if math.isnan(each) else each for each in found.expected_upcrossings(levels).tolist()]
    return {
        "start": {"phi": found.phi, "xi": found.xi},
        "is_certain": found.is_certain,
        "stability_index": _number(found.stability_index),
        "lower": _number(found.lower),
        "upper": _number(found.upper),
        "upcrossings": _number(found.upcrossings),
        "levels": [
            {"level": level, "least_probable": low, "most_probable": high, "upcrossings": count}
            for (level, low, high), count in zip(rows, many, strict=True)
        ],
    }


def _sensitivities(found: Sensitivities) -> dict[str, Any]:
    """∂/∂θ by the key of θ, null where its error leaves it no meaning, and the estimates of these errors alike."""

    def numbers(of: Callable[[Estimate], float]) -> dict[str, Any]:
        def row(slopes: Slopes) -> dict[str, float | None]:
            return {key: of(each) if each.relative_error <= MEANINGLESS else None for key, each in slopes.items()}

        moments = zip(found.p.tolist(), found.moments, strict=True)
        indices = {name: row(found.indices[name]) if name in found.indices else None for name in DIFFERENTIATED}
        return {"moments": [{"p": p, **row(slopes)} for p, slopes in moments], **indices}

    errors = numbers(lambda each: each.error_estimate)
    return {**numbers(lambda each: each.value), "error_estimates": errors}


def _with_errors(numbers: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {name: {"value": value, "standard_error": error} for name, (value, error) in numbers.items()}
