"""The files of a design: design.json, design.toml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import tomlkit

from fpsolve.case.case import Case
from fpsolve.case.rewrite import rewritten
from fpsolve.exponent.error import Estimate
from fpsolve.files import write_json, write_text
from fpsolve.results.csv_json import Content, head
from fpsolve.solve.design import DesignOutcome


def write_design(case: Case, outcome: DesignOutcome, folder: Path, facts: Content) -> None:
    """design.json, and where there is a design, design.toml: the case with its values."""
    write_json(folder / "design.json", summary(case, outcome, facts))
    found = outcome.found
    if found is not None:
        values = {key: each.value for key, each in found.values.items()}
        expected = outcome.expectation(case)
        more = f"\n{tomlkit.dumps({'expect': [expected]})}" if expected else ""
        write_text(folder / "design.toml", rewritten(case, folder, values, without=["expect"], more=more))


def summary(case: Case, outcome: DesignOutcome, facts: Content) -> Content:
    """What became of a design."""
    found, target, before = outcome.found, outcome.target, case.problem.values
    changed: Mapping[str, Estimate] = found.values if found else {}
    return {
        **head(case),
        "complete": found is not None,
        "target": {"quantity": target.kind, "p": target.p if target.kind == "moment" else None, "value": target.value},
        "by": [
            {
                **{name: vars(axis)[name] for name in ("key", "start", "stop", "scale")},
                "unit": outcome.units[axis.key],
                "before": before[axis.key],
                "after": after and after.value,
                "error_estimate": after and after.error_estimate,
            }
            for axis in outcome.by
            for after in [changed.get(axis.key)]
        ],
        "found": found and {"value": found.found.value, "error_estimate": found.found.error_estimate},
        "distance": found and found.distance,
        "solves": found and found.solves,
        "parameters": dict(before),
        "message": outcome.reason,
        **facts,
    }
