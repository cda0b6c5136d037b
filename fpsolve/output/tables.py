"""Results as tables: summary.json, moments.csv, curves.csv; monte_carlo.json and monte_carlo_response.csv."""

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
from fpsolve.case.sections import EXCURSIONS, SENSITIVITIES
from fpsolve.exponent.error import MEANINGLESS, Estimate
from fpsolve.exponent.quantities import INDICES, Index
from fpsolve.files import draft, write_csv, write_json
from fpsolve.messages import message_of
from fpsolve.model.kinds import version_of
from fpsolve.model.quantity import MOMENT, MOMENTS, RATE_FUNCTION
from fpsolve.study.results import CurveResult, SimulatedCurve
from fpsolve.study.uncertain import SAMPLE, Samples, spreads_of

ENDS = ("low", "high")
"""Of an interval."""
MOST_INDENTED = 100
"""Curves of a summary that is made for eyes, too."""


def facts_of(case: Case, started: datetime, seconds: float) -> dict[str, Any]:
    """Of a run: versions, the command, the machine, when it began and how long it takes, and the case as written."""
    packages = {name: version(name) for name in ("numpy", "scipy", "scikit-fem")}
    name, *rest = sys.argv
    kinds = filter(None, (version_of(type(half)) for half in case.problem.halves))  # type: ignore[arg-type]
    packages |= dict(each.rsplit(" ", 1) for each in kinds)
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


def write_results(case: Case, results: Sequence[CurveResult], folder: Path, facts: Mapping[str, Any]) -> None:
    """summary.json, which says whether all curves of the case are there, moments.csv and curves.csv, in one go.

    Args:
        facts: on the run, see `facts_of`.
    """
    state = {"complete": len(results) == case.planned, "planned": case.planned, "done": len(results)}
    start = json.dumps({**head(case), **state, **facts}, indent=1, ensure_ascii=False).removesuffix("\n}")
    indent = 1 if case.planned <= MOST_INDENTED else None
    has_moments, names = MOMENT.name in case.output.quantities, columns_of(case)
    indices = [column.name for each in asked(case) for column in (each, each.error())]
    ends = [f"{each.name}_{part}" for each in _uncertain(case) for part in ENDS]
    more = ENDS if case.uncertain else ()
    with ExitStack() as stack:
        summary, moments, curves = (
            stack.enter_context(draft(folder / name)) for name in ("summary.json", "moments.csv", "curves.csv")
        )
        by_moment, by_curve = csv.writer(moments), csv.writer(curves)
        by_moment.writerow([*case.vary.keys, *names, *more])
        by_curve.writerow([*case.vary.keys, *indices, *ends, "p_solved", "p_failed", "status", "seconds"])
        summary.write(f'{start},\n "curves": [')
        for number, result in enumerate(results):
            varied, done = result.curve.varied.values(), result.moments
            columns = [getattr(done, name).tolist() for name in names]
            finite = [[None if math.isnan(each) else each for each in row] for row in zip(*columns, strict=True)]
            rows = [dict(zip(names, row, strict=True)) for row in finite]
            content = _summary(case, result, rows)
            text = json.dumps(content, indent=indent, allow_nan=False, ensure_ascii=False).replace("\n", "\n  ")
            summary.write((",\n  " if number else "\n  ") + text)
            spreads = spreads_of(case, result)
            for row in finite:
                by_moment.writerow([*varied, *row, *(_ends(spreads.moments.get(float(row[0] or 0.0))) if more else ())])
            intervals = [end for each in _uncertain(case) for end in _ends(spreads.indices.get(each.name))]
            found = [result.estimates[each.name] for each in asked(case)]
            numbers = [number for each in found for number in ((each.value, each.error_estimate) if each else ("", ""))]
            counts = [done.p.size, (case.p.size if has_moments else 0) - done.p.size]
            by_curve.writerow([*varied, *numbers, *intervals, *counts, result.status.word, round(result.seconds, 6)])
        summary.write("\n ]\n}\n")


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
    return [*MOMENTS, *[RATE_FUNCTION.name] * (RATE_FUNCTION.name in case.output.quantities)]


def asked(case: Case) -> list[Index]:
    """The indices that a case asks for."""
    return [index for name, index in INDICES.items() if name in case.output.quantities]


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
            **{name: getattr(response, name) for name in ("impact_rate", "outside", "time")},
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


def _summary(case: Case, result: CurveResult, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What a case asks for of a curve; `rows` are those of its moments."""
    found: dict[str, Any] = {"moments": rows} if MOMENT.name in case.output.quantities else {}
    for index in asked(case):
        numbers = result.index(index)
        found[index.name] = numbers and {key: value if math.isfinite(value) else None for key, value in numbers.items()}
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
    if SENSITIVITIES in case.output.quantities:
        found["sensitivities"] = None if result.sensitivities is None else _sensitivities(result.sensitivities)
    if EXCURSIONS in case.output.quantities:
        found["excursions"] = None if result.excursion is None else _excursion(case, result.excursion)
    if case.uncertain:
        found["uncertainty"] = _spreads(case, result)
    return {
        **_parameters(result.curve),
        "status": result.status.word,
        **found,
        "discretisation": result.discretisation,
        "warnings": in_case_words([*result.warnings, *(failure.reason for failure in result.failures)]),
        "notes": in_case_words(result.notes),
        "seconds": round(result.seconds, 6),
    }


def _excursion(case: Case, found: Excursion) -> dict[str, Any]:
    """The start, the bounds and the asymptotic number of upcrossings at all levels, and what these follow from."""

    def numbers(each: Estimate | None) -> dict[str, float] | None:
        return each and {"value": each.value, "error_estimate": each.error_estimate}

    levels = np.array(case.excursions.levels)
    rows = zip(levels.tolist(), *(each.tolist() for each in found.bounds(levels)), strict=True)
    many = [None if math.isnan(each) else each for each in found.expected_upcrossings(levels).tolist()]
    return {
        "start": {"phi": found.phi, "xi": found.xi},
        "is_certain": found.is_certain,
        "stability_index": numbers(found.stability_index),
        "lower": numbers(found.lower),
        "upper": numbers(found.upper),
        "upcrossings": numbers(found.upcrossings),
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
