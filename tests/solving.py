"""Solving all curves of a case in this process, without a folder."""

from __future__ import annotations

from fpsolve.case.case import Case
from fpsolve.study.results import CurveResult, Solved
from fpsolve.study.solve import Numerics, everything, solve_curve


def solve_sets(case: Case) -> list[Solved]:
    """All that a case wants of its curves, with the eigenpairs."""
    wanted, numerics = everything(case), Numerics.of(case)
    return [solve_curve(curve, wanted, numerics) for curve in case.curves()]


def solve_case(case: Case) -> list[CurveResult]:
    """The numbers alone."""
    return [solved.result for solved in solve_sets(case) if solved.result is not None]
