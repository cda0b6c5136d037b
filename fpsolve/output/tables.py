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
from fpsolve.files import draft, write_csv, write_json
from fpsolve.messages import message_of
from fpsolve.model.kinds import version_of
from fpsolve.model.quantity import MOMENT, Quantity
from fpsolve.results.table import Row, plain, rows_over_p
from fpsolve.study.columns import ENDS, columns_of, pair, row_of
from fpsolve.study.response import CurveResponse
from fpsolve.study.results import CurveResult, SimulatedCurve, Status
from fpsolve.study.uncertain import SAMPLE, Samples, spreads_of

MOST_INDENTED = 100
"""Curves of a summary that is made for eyes, too."""
MOST_SUMMARISED = 1000
"""Curves of which summary.json has all numbers; of more it leaves them to results.nc and to the CSV files."""
_END = "\n ]\n}\n"


def facts_of(case: Case, started: datetime, seconds: float) -> dict[str, Any]:
    """Of a run: versions, the command, the machine, when it began and how long it takes, and the case as written."""
    name, *rest = sys.argv or [""]  # empty where Python is embedded
    kinds = filter(None, (version_of(type(half)) for half in case.problem.sections.values()))  # type: ignore[arg-type]
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
    columns, is_short = columns_of(case), case.planned > MOST_SUMMARISED
    over_p, of_curve = _names(columns)
    of_curve = [name for name in of_curve if not name.endswith("_perturbation")]  # which take the problem of each curve
    with ExitStack() as stack:
        summary, moments, curves = (
            stack.enter_context(draft(folder / name)) for name in ("summary.json", "moments.csv", "curves.csv")
        )
        by_moment, by_curve = csv.writer(moments), csv.writer(curves)
        by_moment.writerow([*case.vary.keys, *over_p])
        by_curve.writerow([*case.vary.keys, *of_curve])
        summary.write(_beginning(case, len(results) if finished is None else finished, facts, held=is_short))
        for number, result in enumerate(results):
            row, varied = row_of(case, result, has_theory=not is_short), result.curve.varied.values()
            content = _short_summary(case, result) if is_short else _summary(case, result, row, columns)
            summary.write(_entry(case, number, content))
            by_moment.writerows([*varied, *each] for each in rows_over_p(row, over_p))
            by_curve.writerow([*varied, *(_cell(row.get(name)) for name in of_curve)])
        summary.write(_END)


def _names(columns: Sequence[Quantity]) -> tuple[list[str], list[str]]:
    """Of the columns over p, which comes first, and of the others."""
    return ["p", *(each.name for each in columns if each.dims)], [each.name for each in columns if not each.dims]


def _cell(number: Any) -> Any:
    """What stands in a table: the word of a status, nothing where there is no number."""
    return number.word if isinstance(number, Status) else plain(number)


def whole_summary(case: Case, results: Sequence[CurveResult], facts: Mapping[str, Any]) -> str:
    """All numbers and messages of all curves in one line of JSON, as summary.json has them of few curves.

    Args:
        facts: on the run, see `facts_of`.
    """
    columns = columns_of(case)
    curves = [_summary(case, result, row_of(case, result), columns) for result in results]
    content = {**_state(case, len(results)), **facts, "curves": curves}
    return json.dumps(content, allow_nan=False, ensure_ascii=False)


def _state(case: Case, done: int) -> dict[str, Any]:
    return {**head(case), "complete": done == case.planned, "planned": case.planned, "done": done}


def _beginning(case: Case, done: int, facts: Mapping[str, Any], *, held: bool = False) -> str:
    """What summary.json has before its curves; with the parameters that these have in common, if they are held."""
    common = {"parameters": dict(case.constants)} if held else {}
    start = json.dumps({**_state(case, done), **facts, **common}, indent=1, ensure_ascii=False)
    return start.removesuffix("\n}") + ',\n "curves": ['


def _entry(case: Case, number: int, content: Mapping[str, Any]) -> str:
    """A curve in summary.json after so many others."""
    indent = 1 if case.planned <= MOST_INDENTED else None
    text = json.dumps(content, indent=indent, allow_nan=False, ensure_ascii=False).replace("\n", "\n  ")
    return (",\n  " if number else "\n  ") + text


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


def _summary(case: Case, result: CurveResult, row: Row, columns: Sequence[Quantity]) -> dict[str, Any]:
    """What a case asks for of a curve, by the names of the columns; those over p are in a list of `moments`."""
    over_p, of_curve = _names(columns)
    moments = [dict(zip(over_p, each, strict=True)) for each in rows_over_p(row, over_p)]
    return {
        **_parameters(result.curve),
        **({"moments": moments} if MOMENT.name in case.asked else {}),
        **{name: _cell(row.get(name)) for name in of_curve},
        **_beyond_tables(case, result),
        "discretisation": result.discretisation,
        **_told(result),
    }


def _short_summary(case: Case, result: CurveResult) -> dict[str, Any]:
    """The state of a curve among many, its messages, and what no other table has."""
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
            {"phase": ray.phase, "log_factor": ray.log_factor, **_pairs(of_ray)}
            for ray, of_ray in zip(result.curve.problem.system.jumps, result.jumps, strict=True)
        ]
    if result.classes:
        found["classes"] = [
            {
                "name": each.name,
                **pair("lyapunov_exponent", each.lyapunov_exponent),
                "moments": [
                    {"p": p, "moment": value, "moment_error": error}
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


def _pairs(numbers: Mapping[str, Estimate | None]) -> dict[str, float | None]:
    """Numbers and their errors by their names."""
    return {key: each for name, number in numbers.items() for key, each in pair(name, number).items()}


def _response(found: CurveResponse) -> dict[str, Any]:
    """The means and impacts with their errors, what the density does near rest, and how far these are to be trusted."""
    return {
        "means": _pairs(found.means),
        **({} if found.impact_rate is None else pair("impact_rate", found.impact_rate)),
        "has_hump": found.has_hump,
        "has_crater": found.has_crater,
        **pair("balance", found.balance),
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
        **pair("stability_index", found.stability_index),
        **pair("lower", found.lower),
        **pair("upper", found.upper),
        **pair("upcrossings", found.upcrossings),
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

    return {**numbers(lambda each: each.value), "errors": numbers(lambda each: each.error_estimate)}


def _with_errors(numbers: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {name: {"value": value, "standard_error": error} for name, (value, error) in numbers.items()}
