"""Solving all curves of a case in this process, without a folder; and parameters for cases that are solved at once."""

from __future__ import annotations

from fpsolve.case.case import Case
from fpsolve.study.results import CurveResult, Solved
from fpsolve.study.solve import Numerics, everything, solve_curve

WEAK_NOISE = """
[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1
[noise]
D0 = 0.5
tau0 = 0.5
r0 = 0.95
"""


def solve_sets(case: Case) -> list[Solved]:
    """All that a case wants of its curves, with the eigenpairs."""
    wanted, numerics = everything(case), Numerics.of(case)
    return [solve_curve(curve, wanted, numerics) for curve in case.curves()]


def solve_case(case: Case) -> list[CurveResult]:
    """The numbers alone."""
    return [solved.result for solved in solve_sets(case) if solved.result is not None]
