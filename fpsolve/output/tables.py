"""Results as tables: summary.json, moments.csv, curves.csv."""

from __future__ import annotations

import csv
import json
import platform
import shlex
import socket
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from datetime import datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpsolve import __version__
from fpsolve.case.case import Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.files import draft
from fpsolve.messages import message_of
from fpsolve.model.quantity import MOMENT, STATUS, Quantity
from fpsolve.output.beyond import BEYOND
from fpsolve.results.curve import CurveResult, Status
from fpsolve.results.table import Table, plain
from fpsolve.study.columns import COUNTS, table_of

MOST_INDENTED = 100
"""Curves of a summary that is made for eyes, too."""
MOST_SUMMARISED = 1000
"""Curves of which summary.json has all numbers; of more it leaves them to results.nc and to the CSV files."""
_END = "\n ]\n}\n"


def facts_of(case: Case, started: datetime, seconds: float) -> dict[str, Any]:
    """Of a run: versions, the command, the machine, when it began and how long it takes, and the case as written."""
    name, *rest = sys.argv or [""]  # empty where Python is embedded
    return {
        "versions": {"fpsolve": __version__, "python": platform.python_version(), **_packages()},
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
    case: Case,
    results: Sequence[CurveResult],
    folder: Path,
    facts: Mapping[str, Any],
    finished: int,
    table: Table,
    says: NDArray[np.bool_],
) -> None:
    """Write summary.json, which says whether all curves are there, moments.csv and curves.csv.

    Of many curves summary.json has the state, the messages and what no other table has; see `MOST_SUMMARISED`.

    Args:
        facts: on the run, see `facts_of`.
        finished: how many of them are.
        table: their numbers.
        says: of which curves of the case there is more.
    """
    is_short, known = case.planned > MOST_SUMMARISED, np.flatnonzero(~np.isnan(table[STATUS.name].values)).tolist()
    over_p = ["p", *(each.quantity.name for each in table.values() if each.quantity.dims)]
    of_curve = [each.quantity.name for each in table.values() if not each.quantity.dims]
    of_curve = [name for name in of_curve if not name.endswith("_perturbation")]  # which others have
    with ExitStack() as stack:
        summary, moments, curves = (
            stack.enter_context(draft(folder / name)) for name in ("summary.json", "moments.csv", "curves.csv")
        )
        by_moment, by_curve = csv.writer(moments), csv.writer(curves)
        by_moment.writerow([*case.vary.keys, *over_p])
        by_curve.writerow([*case.vary.keys, *of_curve])
        common = {"parameters": dict(case.constants)} if is_short else {}
        start = json.dumps({**_state(case, finished), **facts, **common}, indent=1, ensure_ascii=False)
        summary.write(start.removesuffix("\n}") + ',\n "curves": [')
        for place, number in enumerate(known):
            varied, numbers, rows = case.vary.sets[number], _numbers(table, number), _over_p(case, table, number)
            by_curve.writerow([*varied.values(), *(numbers[name] for name in of_curve)])
            by_moment.writerows([*varied.values(), *row.values()] for row in rows)
            if not is_short:
                content = _summary(case, results[place], numbers, rows)
            elif says[number]:
                content = _short_summary(case, results[place])
            else:
                content = {"varied": varied, "status": numbers[STATUS.name], "warnings": [], "notes": []}
            summary.write(_entry(case, place, content))
        summary.write(_END)


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


def whole_summary(case: Case, results: Sequence[CurveResult], facts: Mapping[str, Any]) -> str:
    """All numbers and messages of all curves in one line of JSON, as summary.json has them of few curves.

    Args:
        facts: on the run, see `facts_of`.
    """
    table = table_of(case, results)
    of = ((result, result.curve.number - 1) for result in results)
    curves = [_summary(case, result, _numbers(table, number), _over_p(case, table, number)) for result, number in of]
    content = {**_state(case, len(results)), **facts, "curves": curves}
    return json.dumps(content, allow_nan=False, ensure_ascii=False)


def _state(case: Case, done: int) -> dict[str, Any]:
    return {**head(case), "complete": done == case.planned, "planned": case.planned, "done": done}


def _entry(case: Case, number: int, content: Mapping[str, Any]) -> str:
    """A curve in summary.json after so many others."""
    indent = 1 if case.planned <= MOST_INDENTED else None
    text = json.dumps(content, indent=indent, allow_nan=False, ensure_ascii=False).replace("\n", "\n  ")
    return (",\n  " if number else "\n  ") + text


def in_case_words(messages: Sequence[str]) -> list[str]:
    """Messages as those read them who work with case files."""
    return [message_of(each).words(CASE_WORDS) for each in messages]


def head(case: Case) -> dict[str, Any]:
    """What every table begins with."""
    units = {"units": {"time": case.units.time}}
    return {"case": case.name, "title": case.title, "fpsolve_version": __version__, **units}


def parameters_of(curve: Curve) -> dict[str, dict[str, Any]]:
    """What the table of a curve says of it."""
    return {"parameters": dict(curve.parameters), "varied": dict(curve.varied)}


def _summary(
    case: Case, result: CurveResult, numbers: Mapping[str, Any], moments: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """What a case asks for of a curve, by the names of the columns; those over p are in a list of `moments`."""
    return {
        **parameters_of(result.curve),
        **({"moments": moments} if MOMENT.name in case.asked else {}),
        **numbers,
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


def says_more(case: Case, result: CurveResult) -> bool:
    """Whether there is more of a curve than its numbers in tables."""
    return any(result.remarks.values()) or bool(_beyond_tables(case, result))


def _beyond_tables(case: Case, result: CurveResult) -> dict[str, Any]:
    """What neither results.nc nor a CSV file has."""
    return {name: each for about in BEYOND for name, each in about(case, result).items()}
