"""The table of a case as sets.csv and moments.csv, and with all that is known of few sets as summary.json."""

from __future__ import annotations

import json
import platform
import shlex
import socket
import sys
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from fpsolve import __version__
from fpsolve.analysis.excursions import Excursion
from fpsolve.analysis.sensitivity import RECORDS, Sensitivities, Slopes
from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread
from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.sections import EXCURSIONS, RESPONSE, SENSITIVITIES
from fpsolve.exponent.error import MEANINGLESS, Estimate, InvariantClass
from fpsolve.files import write_csv, write_json
from fpsolve.model.quantity import LYAPUNOV_EXPONENT
from fpsolve.results.known import Results
from fpsolve.results.netcdf import write_dataset
from fpsolve.results.table import plain
from fpsolve.solve.intervals import spreads_of
from fpsolve.solve.moments import CLASSES
from fpsolve.solve.set_result import SetResponse, SetResult

Content = dict[str, object]
"""What JSON holds by its name."""
MOST_SUMMARISED = 1000
"""Sets of which there is a summary.json; of more all is in results.nc and in the CSV files."""


def facts_of(case: Case, started: datetime) -> Content:
    """Of a run: versions, the command, the machine, when it began, how long it took by now, the case as written."""
    packages = {each: version(each) for each in ("numpy", "scipy", "scikit-fem")}
    return {
        "versions": {"fpsolve": __version__, "python": platform.python_version(), **packages},
        "command": shlex.join(sys.argv),
        "host": socket.gethostname(),
        "started": started.isoformat(timespec="seconds"),
        "wall_seconds": round((datetime.now(UTC) - started).total_seconds(), 3),
        "overrides": list(case.overrides),
        "case_text": case.text,
    }


def write_moments(results: Results, path: Path, facts: Content) -> None:
    """Write the numbers of all sets at each p that was solved."""
    table, vary = results.table, results.case.vary
    names = [name for name, each in table.items() if each.quantity.dims]
    rows = ([*vary.sets[each - 1].values(), *row.values()] for each in results.numbers for row in table.over_p(each))
    write_csv(path, [*vary.keys, "p", *names], rows)


def write_numbers(results: Results, path: Path, facts: Content) -> None:
    """Write the numbers of all sets that are no function of p, and the messages."""
    table, vary = results.table, results.case.vary
    names = [name for name, each in table.items() if not each.quantity.dims]
    rows = (
        [*vary.sets[each - 1].values(), *table.row(each).values(), table.messages[each - 1]] for each in results.numbers
    )
    write_csv(path, [*vary.keys, *names, "messages"], rows)


def write_summary(results: Results, path: Path, facts: Content) -> None:
    """Write all that is known of all sets, unless there are many."""
    if results.case.planned <= MOST_SUMMARISED:
        write_json(path, summary(results, facts))


Writer = Callable[[Results, Path, Content], None]
GROWING: dict[str, Writer] = {"summary.json": write_summary, "sets.csv": write_numbers, "moments.csv": write_moments}
"""What writes each of the files with numbers of all sets while a run grows."""
TABLES: dict[str, Writer] = GROWING | {"results.nc": write_dataset}
"""What writes all files with numbers of all sets at the end, and takes the `facts_of` the run."""


def summary_line(results: Results, facts: Content) -> str:
    """What summary.json has of few sets, in one line."""
    return json.dumps(summary(results, facts), allow_nan=False, ensure_ascii=False)


def summary(results: Results, facts: Content) -> Content:
    """Whether all sets are there, and of each the numbers of the table, those that no table has, and the messages."""
    case, done, table = results.case, len(results.whole), results.table
    sets = [
        {
            **parameters_of(each.parameter_set),
            **({"moments": table.over_p(each.parameter_set.number)} if table.p.size else {}),
            **table.row(each.parameter_set.number),
            "discretisation": each.discretisation,
            **_beyond(case, each),
            "warnings": [*each.warnings, *(failure.reason for failure in each.failures)],
            "notes": each.notes,
        }
        for each in results
    ]
    state = {"complete": done == case.planned, "planned": case.planned, "done": done}
    return {**head(case), **state, **facts, "sets": sets}


def head(case: Case) -> Content:
    """What every file of JSON of a case begins with."""
    units = {"time": case.units.time}
    return {"case": case.name, "title": case.title, "fpsolve_version": __version__, "units": units}


def parameters_of(parameter_set: ParameterSet) -> Content:
    """Those of a parameter set, in JSON."""
    return {"parameters": dict(parameter_set.parameters), "varied": dict(parameter_set.varied)}


def with_error(name: str, found: Estimate | None) -> Content:
    """A number and its error in JSON; None where there is none."""
    return {name: found and found.value, f"{name}_error": found and found.error_estimate}


def sampled(value: float, error: float | None) -> Content:
    """A number and its standard error in JSON."""
    return {"value": value, "standard_error": error}


def _beyond(case: Case, result: SetResult) -> Content:
    """What no table has of a parameter set, by its name; None where it is asked for and not there."""
    found = Content()
    if classes := result.parts.get(CLASSES.name):
        found[CLASSES.name] = [_class(each) for each in classes]
    if EXCURSIONS in case.asked:
        found[EXCURSIONS] = result.excursion and _excursion(case, result.excursion)
    if RESPONSE in case.asked:
        found[RESPONSE] = result.response and _response(result.response)
    if SENSITIVITIES in case.asked:
        found[SENSITIVITIES] = result.sensitivities and _sensitivities(result.sensitivities)
    if case.uncertain and result.parameter_set.is_possible:
        found["uncertainty"] = _uncertainty(case, result)
    return found


def _class(found: InvariantClass) -> Content:
    """λ and Λ(p) of a block or a ray."""
    rows = np.stack([found.p, found.value, found.error_estimate], axis=1).tolist()
    moments = [{"p": p, "moment": value, "moment_error": error} for p, value, error in rows]
    return {"name": found.name, **with_error(LYAPUNOV_EXPONENT.name, found.lyapunov_exponent), "moments": moments}


def _sensitivities(known: Sensitivities) -> Content:
    """∂/∂θ by the key of θ, null where its error leaves it no meaning, and the estimates of these errors alike."""

    def numbers(of: Callable[[Estimate], float]) -> Content:
        def row(slopes: Slopes) -> Mapping[str, float | None]:
            return {key: of(each) if each.relative_error <= MEANINGLESS else None for key, each in slopes.items()}

        moments = zip(known.p.tolist(), known.moments, strict=True)
        summary_numbers = {
            name: row(known.summary_numbers[name]) if name in known.summary_numbers else None for name in RECORDS
        }
        return {"moments": [{"p": p, **row(slopes)} for p, slopes in moments], **summary_numbers}

    errors = numbers(lambda each: each.error_estimate)
    return {**numbers(lambda each: each.value), "errors": errors}


def _excursion(case: Case, found: Excursion) -> Content:
    """The start, the bounds and the asymptotic number of upcrossings at all levels, and what these follow from."""
    levels = np.array(case.excursions.levels)
    rows = np.stack([levels, *found.bounds(levels), found.expected_upcrossings(levels)], axis=1).tolist()
    return {
        "start": {"phi": found.phi, "xi": found.xi},
        "is_certain": found.is_certain,
        **{
            key: number
            for name in ("stability_index", "lower", "upper", "upcrossings")
            for key, number in with_error(name, vars(found)[name]).items()
        },
        "levels": [
            {"level": level, "least_probable": low, "most_probable": high, "upcrossings": plain(count)}
            for level, low, high, count in rows
        ],
    }


def _response(found: SetResponse) -> Content:
    """What the density does near rest, and how far the means, which are in the table, are to be trusted."""
    if found.balance is None:
        return {}
    return {
        "has_hump": found.has_hump,
        "has_crater": found.has_crater,
        **with_error("balance", found.balance),
        "least_over_largest_density": found.least,
        "unknowns": found.unknowns,
    }


def _uncertainty(case: Case, result: SetResult) -> Content:
    """What is uncertain of a parameter set, and how that of the parameters is."""
    found, laws = spreads_of(case, result), case.uncertain.laws(result.parameter_set.problem)
    return {
        "level": LEVEL,
        "laws": {
            key: {"value": each.value, "sd": each.sd, "mean": each.mean, "deviation": each.deviation}
            for key, each in laws.items()
        },
        **{name: _spread(found.summary_numbers[name]) if name in found.summary_numbers else None for name in UNCERTAIN},
        "moments": [{"p": p, **_spread(each)} for p, each in found.moments.items()],
    }


def _spread(found: Spread) -> Content:
    """A spread to first order."""
    ends = {"low": found.low, "high": found.high}
    return {"mean": found.mean, "deviation": found.deviation, **ends, "probability_below_0": found.below}
