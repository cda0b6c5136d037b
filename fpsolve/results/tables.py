"""Results as tables: summary.json, moments.csv, curves.csv."""

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
from typing import Any

import numpy as np

from fpsolve import __version__
from fpsolve.case.case import Case, Curve
from fpsolve.files import write_csv, write_json
from fpsolve.model.quantity import MOMENT, STATUS, Quantity
from fpsolve.results.beyond import beyond_tables
from fpsolve.results.columns import COUNTS
from fpsolve.results.datasets import write_dataset
from fpsolve.results.known import Results
from fpsolve.results.table import Table, plain
from fpsolve.solve.curve import CurveResult, Status

Facts = Mapping[str, Any]
MOST_INDENTED = 100
"""Curves of a summary that is made for eyes, too."""
MOST_SUMMARISED = 1000
"""Curves of which summary.json has all numbers; of more it leaves them to results.nc and to the CSV files."""


def facts_of(case: Case, started: datetime) -> dict[str, Any]:
    """Of a run: versions, the command, the machine, when it began, how long it took by now, the case as written."""
    name, *rest = sys.argv or [""]  # empty where Python is embedded
    packages = {each: version(each) for each in ("numpy", "scipy", "scikit-fem")}
    return {
        "versions": {"fpsolve": __version__, "python": platform.python_version(), **packages},
        "command": shlex.join(
            ["python", "-m", "fpsolve", *rest] if name.endswith("__main__.py") else [Path(name).name, *rest]
        ),
        "host": socket.gethostname(),
        "started": started.isoformat(timespec="seconds"),
        "wall_seconds": round((datetime.now(UTC) - started).total_seconds(), 3),
        "overrides": list(case.overrides),
        "case_text": case.text,
    }


def write_moments(case: Case, results: Results, path: Path, facts: Facts) -> None:
    """Write the numbers of all sets at each p that was solved."""
    table, sets = results.table, case.vary.sets
    names = [name for name, each in table.items() if each.quantity.dims]
    rows = ([*sets[each].values(), *row.values()] for each in results.places for row in _over_p(case, table, each))
    write_csv(path, [*case.vary.keys, "p", *names], rows)


def write_numbers(case: Case, results: Results, path: Path, facts: Facts) -> None:
    """Write the numbers of all sets that are no function of p."""
    table, sets = results.table, case.vary.sets
    names = [name for name, each in table.items() if not (each.quantity.dims or name.endswith("_perturbation"))]
    rows = ([*sets[each].values(), *map(_numbers(table, each).__getitem__, names)] for each in results.places)
    write_csv(path, [*case.vary.keys, *names], rows)


def write_summary(case: Case, results: Results, path: Path, facts: Facts) -> None:
    """Write whether all sets are there, their numbers, their messages and what no other table has.

    Of many sets the numbers are left to other files, see `MOST_SUMMARISED`.
    """
    content, table, sets = _head_of(case, results, facts), results.table, case.vary.sets
    states = table[STATUS.name].values
    if case.planned > MOST_SUMMARISED:
        told = {each.curve.number: _told(case, each) for each in results.telling}
        content |= {"parameters": dict(case.constants), "curves": [
            {"varied": sets[each], "status": _cell(STATUS, states[each]), **told.get(each + 1, _SILENT)}
            for each in results.places
        ]}  # fmt: skip
    else:
        content["curves"] = [_summary(case, each, table) for each in results]
    write_json(path, content, indent=1 if case.planned <= MOST_INDENTED else None)


Writer = Callable[[Case, Results, Path, Facts], None]
GROWING: dict[str, Writer] = {"summary.json": write_summary, "curves.csv": write_numbers, "moments.csv": write_moments}
"""What writes each of the files with numbers of all sets while a run grows; the first says whether all are there."""
TABLES: dict[str, Writer] = GROWING | {"results.nc": write_dataset}
"""What writes all files with numbers of all sets at the end, and takes the `facts_of` the run."""


def _numbers(table: Table, number: int) -> dict[str, Any]:
    """What tables have of a curve: the word of a status, nothing where there is no number."""
    return {
        name: _cell(each.quantity, each.values[number].item()) for name, each in table.items() if not each.quantity.dims
    }


def _cell(quantity: Quantity, value: float) -> Any:
    if quantity is STATUS:
        return Status(int(value)).word
    return int(value) if quantity in COUNTS else plain(value)


def _over_p(case: Case, table: Table, number: int) -> list[dict[str, Any]]:
    """The numbers of a curve at each p that was solved."""
    columns = {"p": case.p} | {name: each.values[number] for name, each in table.items() if each.quantity.dims}
    solved = np.flatnonzero(~np.isnan(columns[MOMENT.name])).tolist() if MOMENT.name in columns else ()
    return [{name: plain(float(values[place])) for name, values in columns.items()} for place in solved]


def whole_summary(case: Case, results: Results, facts: Facts) -> str:
    """All numbers and messages of all curves in one line of JSON, as summary.json has them of few curves."""
    content = {**_head_of(case, results, facts), "curves": [_summary(case, each, results.table) for each in results]}
    return json.dumps(content, allow_nan=False, ensure_ascii=False)


def _head_of(case: Case, results: Results, facts: Facts) -> dict[str, Any]:
    done = len(results.whole)
    return {**head(case), "complete": done == case.planned, "planned": case.planned, "done": done, **facts}


def head(case: Case) -> dict[str, Any]:
    """What every table begins with."""
    units = {"time": case.units.time}
    return {"case": case.name, "title": case.title, "fpsolve_version": __version__, "units": units}


def parameters_of(curve: Curve) -> dict[str, dict[str, Any]]:
    """What the table of a curve says of it."""
    return {"parameters": dict(curve.parameters), "varied": dict(curve.varied)}


def _summary(case: Case, result: CurveResult, table: Table) -> dict[str, Any]:
    """What a case asks for of a curve, by the names of the columns; those over p are in a list of `moments`."""
    number = result.curve.number - 1
    return {
        **parameters_of(result.curve),
        **({"moments": _over_p(case, table, number)} if MOMENT.name in case.asked else {}),
        **_numbers(table, number),
        "discretisation": result.discretisation,
        **_told(case, result),
    }


def _told(case: Case, result: CurveResult) -> dict[str, Any]:
    """What no other table has, and the messages, with those of failures among the warnings."""
    return {
        **beyond_tables(case, result),
        "warnings": [*result.warnings, *(failure.reason for failure in result.failures)],
        "notes": result.notes,
    }


_SILENT: dict[str, Any] = {"warnings": [], "notes": []}
"""What is told of a curve of which there is nothing to tell."""
