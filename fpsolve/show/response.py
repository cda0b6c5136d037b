"""The stationary response of a nonlinear system: its numbers, the shape of its densities, its picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.model.quantity import ResponseQuantities
from fpsolve.output.figures import draw_stationary_responses
from fpsolve.page.page import Block, Drawing, Sentence, filled
from fpsolve.parts.response import CurveResponse
from fpsolve.show.text import NUMBER_COLUMNS, row_of
from fpsolve.study.results import CurveResult, SimulatedCurve


def show(case: Case, result: CurveResult) -> Iterator[Block]:
    """The means and the impacts with their errors, and where the densities are largest."""
    if result.response is None:
        return
    about = case.system.response
    rows = [row_of(about.numbers[name], each, case.units.time) for name, each in result.response.numbers.items()]
    yield filled(f"Stationary response{result.curve.of}", NUMBER_COLUMNS, rows)
    yield Sentence(shape(result.response, about))


def shape(found: CurveResponse, about: ResponseQuantities) -> str:
    """Where the densities of a response are largest: what changes at δ_p = −1 and −2, the P-bifurcations."""
    both = about.joint_symbol
    if not found.has_hump:
        return f"ρ(A) and {both} are infinite at rest, as δ_p > -1."
    plane = "a crater around rest, as δ_p < -2" if found.has_crater else "is infinite there, as δ_p > -2"
    return f"ρ(A) has a hump away from rest, as δ_p < -1, and {both} {plane}."


def draw(case: Case, result: CurveResult, simulated: Sequence[SimulatedCurve], folder: Path) -> Iterator[Drawing]:
    """Its densities, where they are there, beside those of a simulation."""
    if result.response and result.response.density:
        job = partial(draw_stationary_responses, case, [result], simulated, folder)
        yield Drawing(f"Stationary response{result.curve.of}", job)
