"""Designs as files, design.json and design.toml, and on the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fpsolve.case.case import Case
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.rewrite import rewritten
from fpsolve.case.vary import short_names
from fpsolve.data import plain_unit
from fpsolve.exponent.error import digits
from fpsolve.files import write_json, write_text
from fpsolve.output.screen import Column, Grid, Screen
from fpsolve.output.tables import head
from fpsolve.output.terminal import plural, print_message
from fpsolve.study.design import DesignOutcome


def write_design(case: Case, outcome: DesignOutcome, folder: Path, facts: Mapping[str, Any]) -> None:
    """design.json, and where there is a design, design.toml: the case with its values."""
    write_json(folder / "design.json", summary(case, outcome, facts))
    found = outcome.found
    if found is not None:
        values = {key: each.value for key, each in found.values.items()}
        write_text(folder / "design.toml", rewritten(case, values, outcome.expectation(case), folder))


def summary(case: Case, outcome: DesignOutcome, facts: Mapping[str, Any]) -> dict[str, Any]:
    """What became of a design."""
    found, target, before = outcome.found, outcome.target, case.problem.values
    changed = found.values if found else {}
    return {
        **head(case),
        "complete": found is not None,
        "target": {"quantity": target.kind, "p": target.p if target.kind == "moment" else None, "value": target.value},
        "by": [
            {
                "key": axis.key,
                "start": axis.start,
                "stop": axis.stop,
                "scale": axis.scale,
                "unit": outcome.units[axis.key],
            }
            | {"before": before[axis.key]}
            | {"after": changed[axis.key].value if found else None}
            | {"error_estimate": changed[axis.key].error_estimate if found else None}
            for axis in outcome.by
        ],
        "found": found and {"value": found.found.value, "error_estimate": found.found.error_estimate},
        "distance": found and found.distance,
        "solves": found and found.solves,
        "parameters": dict(case.curve({}).parameters),
        "message": outcome.reason and outcome.reason.words(CASE_WORDS),
        **facts,
    }


def print_design(case: Case, outcome: DesignOutcome) -> None:
    """The parameters before and after, and what is met; or why there is none."""
    found = outcome.found
    if found is None:
        print_reason(case, outcome)
        return
    screen, keys = Screen.of(), [axis.key for axis in outcome.by]
    columns = [Column("parameter"), Column("before"), Column("after"), Column("± error", 1), Column("unit", 2)]
    grid = Grid(case.headline, columns)
    for key, name in zip(keys, short_names(keys), strict=True):
        value, unit = found.values[key], case.about(key).unit
        numbers = [
            f"{found.start.values[key]:.10g}",
            digits(value.value, value.error_estimate),
            f"{value.error_estimate:.0e}",
        ]
        grid.rows.append([name, *numbers, "" if unit in ("1", "unknown") else plain_unit(unit)])
    screen.show(grid)
    symbol, value = outcome.target.quantity.symbol, found.found
    met = digits(value.value, value.error_estimate)
    solves = f"{found.solves} {plural('solve', found.solves)}"
    screen.say(f"{symbol} = {met} ± {value.error_estimate:.0e}; wanted {outcome.target.value:.10g}; {solves}")
    if len(keys) > 1:
        measures = ", ".join(f"{key} / {outcome.units[key]:.6g}" for key in keys)
        told = f"the square root of the sum of the squares of the changes of {measures}"
        screen.say(f"the nearest such point, at a distance of {found.distance:.6g}: {told}")


def found_of(outcome: DesignOutcome) -> str:
    """What was written: "design.toml, 4 solves"."""
    found = outcome.found
    return "no design" if found is None else f"design.toml, {found.solves} {plural('solve', found.solves)}"


def print_reason(case: Case, outcome: DesignOutcome) -> None:
    """Why there is no design."""
    if outcome.reason is not None:
        print_message(case, outcome.reason)
