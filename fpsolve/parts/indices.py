"""The numbers of a curve that are no function of p: λ, δ_p, Λ″(0) and those of impacts, each a part of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from fpsolve.data import Quantity
from fpsolve.errors import NoSuchExponent
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.quantities import BY_JUMP, INDICES, MOMENT, STABILITY_INDEX, Index
from fpsolve.messages import Code, Message, Remedy
from fpsolve.parts.part import Job, Numerics, Part, Reason, Settings, attempt
from fpsolve.results.table import Row, pair

if TYPE_CHECKING:
    from fpsolve.case.case import Case, Curve
    from fpsolve.study.results import CurveResult


def index_of(found: Estimate | Absent, name: str, symbol: str, place: str = "") -> Estimate | Reason:
    """An index, or why there is none; of δ_p that is a limit, as Λ(p) may have a root far out."""
    if found:
        return found
    if name == STABILITY_INDEX.name:
        return Reason("impossible", found.reason, "stability index", place)
    return Reason("absent", found.reason, symbol, place)


def is_estimate(number: Estimate) -> bool:
    """Whether a number from a record can be written."""
    return not math.isinf(number.value) and not number.error_estimate < 0


def part_of(index: Index) -> Part:
    """The part of an index."""

    def settings(case: Case, number: int) -> Settings | None:
        return {} if index.name in case.asked else None

    def solve(job: Job, settings: Settings) -> Estimate | Reason:
        moments = job.found(MOMENT.name)
        try:
            found = index.solve(job.solver, moments.root if moments else None)
        except NoSuchExponent as failure:
            return Reason("impossible", failure.message, index.symbol)
        return index_of(found, index.name, index.symbol)

    def said(found: Estimate, curve: Curve, numerics: Numerics) -> Iterator[Message]:
        if found.relative_error > numerics.rtol:
            yield Message(
                Code.INDEX_RTOL_MISSED,
                symbol=index.symbol,
                value=found.value,
                error=found.error_estimate,
                size=found.relative_error,
                rtol=numerics.rtol,
                remedy=None if numerics.mesh is None else Remedy.MESH,
            )

    def columns(case: Case) -> Sequence[Quantity]:
        return (index, index.error(), index.perturbation) if index.name in case.asked else ()

    def row(case: Case, result: CurveResult) -> Row:
        return pair(index.name, result.estimates[index.name])

    def is_whole(found: Estimate, curve: Curve, settings: Settings) -> bool:
        return is_estimate(found)

    return Part(
        index.name,
        settings,
        solve,
        Estimate,
        index.symbol,
        said=said,
        columns=columns,
        row=row,
        is_whole=is_whole,
    )


PARTS: tuple[Part, ...] = tuple(map(part_of, INDICES.values()))
"""A part for each index."""


@dataclass(frozen=True)
class JumpIndex:
    """An index of one jump of a system; or why there is none."""

    estimate: Estimate | None
    reason: Reason | None = None


OfJumps = tuple[Mapping[str, JumpIndex], ...]
"""The indices of each jump, by their names."""


def _jump_settings(case: Case, number: int) -> Settings | None:
    names = [name for name in BY_JUMP if name in case.asked] if len(case.problem.system.jumps) > 1 else []
    return {"names": names} if names else None


def _solve_jumps(job: Job, settings: Settings) -> OfJumps:
    """The indices of each jump of a system with several."""
    rays = job.curve.problem.system.jumps
    found = list[dict[str, JumpIndex]]()
    for number, ray in enumerate(rays):
        place, of_ray = f"at φ = {ray.phase:.6g}", dict[str, JumpIndex]()
        for name in settings["names"]:
            symbol = INDICES[name].symbol
            solve = partial(BY_JUMP[name], job.solver, number)
            each = attempt(lambda: index_of(solve(), name, symbol, place), symbol, place)  # noqa: B023
            of_ray[name] = JumpIndex(None, each) if isinstance(each, Reason) else JumpIndex(each)
        found.append(of_ray)
    return tuple(found)


def _content_of_jumps(case: Case, result: CurveResult) -> Mapping[str, Any]:
    rays = result.curve.problem.system.jumps if result.jumps else ()
    found = list[dict[str, Any]]()
    for ray, of_ray in zip(rays, result.jumps, strict=True):
        numbers = {key: each for name, number in of_ray.items() for key, each in pair(name, number).items()}
        found.append({"phase": ray.phase, "log_factor": ray.log_factor, **numbers})
    return {"jumps": found} if found else {}


def _jumps_are_whole(found: OfJumps, curve: Curve, settings: Settings) -> bool:
    return len(found) == len(curve.problem.system.jumps) and all(
        each.keys() <= BY_JUMP.keys() and all(is_estimate(one.estimate) for one in each.values() if one.estimate)
        for each in found
    )


def _reasons_of_jumps(found: OfJumps) -> Iterator[Message]:
    return (each.reason.message for of_jump in found for each in of_jump.values() if each.reason)


JUMPS: Part = Part(
    "jumps",
    _jump_settings,
    _solve_jumps,
    OfJumps,
    content=_content_of_jumps,
    reasons=_reasons_of_jumps,
    is_whole=_jumps_are_whole,
    is_quantity=False,
)
"""The indices of impacts, of each place of several."""


def _theory_settings(case: Case, number: int) -> Settings | None:
    return {} if any(name in case.asked for name in INDICES) else None


def _solve_theory(job: Job, settings: Settings) -> dict[str, float]:
    return {name: index.theory(job.curve.problem) for name, index in INDICES.items()}


def _row_of_theory(case: Case, result: CurveResult) -> Row:
    numbers: Mapping[str, float] = result.parts.get("theory", {})
    is_there = {name for name in case.asked if result.estimates.get(name)}
    return {INDICES[name].perturbation.name: each for name, each in numbers.items() if name in is_there}


THEORY: Part = Part(
    "theory",
    _theory_settings,
    _solve_theory,
    dict[str, float],
    row=_row_of_theory,
    is_quantity=False,
    uses_solver=False,
)
"""The indices by perturbation theory, which a record has so that tables need not make the problem of each curve."""
