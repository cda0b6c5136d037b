"""How far ‖x‖ may rise above its start."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.analysis.excursions import SYMBOL, Excursion, solve_excursion
from fpsolve.messages import Message
from fpsolve.parts.indices import is_estimate
from fpsolve.parts.part import Job, Numerics, Part, Settings
from fpsolve.results.table import pair

if TYPE_CHECKING:
    from fpsolve.case.case import Case, Curve
    from fpsolve.study.results import CurveResult

NAME = "excursions"


def _settings(case: Case, number: int) -> Settings | None:
    """The start; levels are looked up in what was found."""
    return {"phi": case.excursions.phi, "xi": case.excursions.xi} if NAME in case.asked else None


def _solve(job: Job, settings: Settings) -> Excursion:
    return solve_excursion(job.solver, phi=settings["phi"], xi=settings["xi"], root=job.root)


def _said(found: Excursion, curve: Curve, numerics: Numerics) -> Iterable[Message]:
    return found.notes


def _content(case: Case, result: CurveResult) -> Mapping[str, Any]:
    """The start, the bounds and the asymptotic number of upcrossings at all levels, and what these follow from."""
    found: Excursion | None = result.parts.get(NAME)
    if NAME not in case.asked or found is None:
        return {NAME: None} if NAME in case.asked else {}
    levels = np.array(case.excursions.levels)
    rows = zip(levels.tolist(), *(each.tolist() for each in found.bounds(levels)), strict=True)
    many = [None if math.isnan(each) else each for each in found.expected_upcrossings(levels).tolist()]
    content = {
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
    return {NAME: content}


def _is_whole(found: Excursion, curve: Curve, settings: Settings) -> bool:
    numbers = found.lyapunov_exponent, found.stability_index, found.lower, found.upper, found.upcrossings
    return all(is_estimate(each) for each in numbers if each)


PART: Part = Part(NAME, _settings, _solve, Excursion, SYMBOL, said=_said, content=_content, is_whole=_is_whole)
