"""Results as tables: summary.json, moments.csv, curves.csv."""

from __future__ import annotations

import csv
import json
import platform
import shlex
import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
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
from fpsolve.parts.every import PARTS
from fpsolve.results.curve import CurveResult, Status
from fpsolve.results.table import Column, Row, Table, plain, rows_over_p
from fpsolve.study.columns import COUNTS, columns_of, row_of

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
    columns, is_short = columns_of(case), case.planned > MOST_SUMMARISED
    over_p, of_curve = _names(columns)
    of_curve = [name for name in of_curve if not name.endswith("_perturbation")]  # which others have
    known = np.flatnonzero(~np.isnan(table[STATUS.name].values))
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
        sets = [case.vary.sets[number] for number in known.tolist()]
        cells = zip(*(_cells(table[name], known) for name in of_curve), strict=True)
        by_curve.writerows([*varied.values(), *row] for varied, row in zip(sets, cells, strict=True))
        for at, row in _over_p(case, table, over_p[1:], known):
            by_moment.writerow([*sets[at].values(), *row])
        for place, (number, varied) in enumerate(zip(known.tolist(), sets, strict=True)):
            if not is_short:
                result = results[place]
                content = _summary(case, result, row_of(case, result), columns)
            elif says[number]:
                content = _short_summary(case, results[place])
            else:
                word = Status(int(table[STATUS.name].values[number])).word
                content = {"varied": varied, "status": word, "warnings": [], "notes": []}
            summary.write(_entry(case, place, content))
        summary.write(_END)


def _names(columns: Sequence[Quantity]) -> tuple[list[str], list[str]]:
    """Of the columns over p, which comes first, and of the others."""
    return ["p", *(each.name for each in columns if each.dims)], [each.name for each in columns if not each.dims]


def _cells(column: Column, places: NDArray[np.int64]) -> list[Any]:
    """What stands in a table at some curves: the word of a status, nothing where there is no number."""
    values = column.values[places]
    if column.quantity in (STATUS, *COUNTS):
        numbers = values.astype(int).tolist()
        return [Status(each).word for each in numbers] if column.quantity is STATUS else numbers
    return list(map(plain, values.tolist()))


def _over_p(
    case: Case, table: Table, names: Sequence[str], places: NDArray[np.int64]
) -> Iterator[tuple[int, tuple[Any, ...]]]:
    """Of some curves a row for each p that was solved, after the number of the curve among these."""
    if not names:
        return
    solved = ~np.isnan(table[MOMENT.name].values[places])
    at, of_p = np.nonzero(solved)
    columns = [map(plain, table[name].values[places][solved].tolist()) for name in names]
    yield from zip(at.tolist(), zip(case.p[of_p].tolist(), *columns, strict=True), strict=True)


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


def _summary(case: Case, result: CurveResult, row: Row, columns: Sequence[Quantity]) -> dict[str, Any]:
    """What a case asks for of a curve, by the names of the columns; those over p are in a list of `moments`."""
    over_p, of_curve = _names(columns)
    moments = [dict(zip(over_p, each, strict=True)) for each in rows_over_p(row, over_p)]
    return {
        **parameters_of(result.curve),
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


def says_more(case: Case, result: CurveResult) -> bool:
    """Whether there is more of a curve than its numbers in tables."""
    return any(result.remarks.values()) or bool(_beyond_tables(case, result))


def _beyond_tables(case: Case, result: CurveResult) -> dict[str, Any]:
    """What neither results.nc nor a CSV file has."""
    return {name: each for part in PARTS for name, each in part.content(case, result).items()}
