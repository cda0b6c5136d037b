"""Solving the curves of a case, and comparing them with what it expects."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.case.remedies import in_words_of_a_case
from fpsolve.case.sections import Expectation
from fpsolve.errors import MeshError, NotConverged, Remedy
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.moments import solve_moments
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, STABILITY_INDEX, VARIANCE_RATE
from fpsolve.exponent.solver import ExponentSolver, MomentLyapunov
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.space import CylinderSpace
from fpsolve.study.results import Comparison, CurveResult
from fpsolve.theory import validity
from fpsolve.theory.perturbation import second_order

UNRESOLVED = 0.1
"""The share of an eigenfunction with the wrong sign from which on its picture misleads."""


def solving_work(case: Case) -> int:
    """How often `solve_curves` reports progress: once for each moment of each curve."""
    return len(case.curves()) * case.p.size


def solve_curves(case: Case, *, progress: Callable[[], None] = lambda: None) -> Iterator[CurveResult]:
    """Solve the curves of a case one after the other; what did not converge is in their `failures`."""
    mesh = case.cylinder_mesh()
    for curve in case.curves():
        try:
            yield _solve_curve(case, curve, mesh, progress)
        except MeshError as failure:
            raise MeshError(f"{case.path}: mesh, or the finer one that measures its error: {failure}") from failure


def compare(case: Case, results: Sequence[CurveResult]) -> list[Comparison]:
    """Every expectation of a case against every curve that it selects."""
    return [
        _comparison(expectation, result)
        for expectation in case.expect
        for result in results
        if expectation.selects(result.curve.varied)
    ]


def _solve_curve(case: Case, curve: Curve, mesh: CylinderMesh | None, progress: Callable[[], None]) -> CurveResult:
    solver = ExponentSolver(curve.problem, mesh, rtol=case.rtol, budget=case.budget)
    moments = solve_moments(solver, case.p, progress=progress)
    estimates, missing = _solve_indices(solver, moments.root)
    attempts = (_pair(solver, float(p)) for p in case.shown if np.any(moments.p == p))
    pairs = tuple(pair for pair in attempts if pair is not None)
    warnings = [*moments.warnings, *missing, *_imprecise(estimates, case.rtol, mesh is None), *_unresolved(pairs)]
    return CurveResult(
        curve=curve,
        moments=moments,
        moments_perturbation=second_order(curve.problem).moment_exponent(moments.p),
        estimates=estimates,
        eigenpairs=pairs,
        stationary=_pair(solver, 0.0),
        mesh=None if (space := solver.largest()) is None else _mesh(space),
        warnings=tuple(map(in_words_of_a_case, warnings)),
        notes=tuple(map(in_words_of_a_case, _notes(case, curve, moments))),
        failures=tuple(replace(each, reason=in_words_of_a_case(each.reason)) for each in moments.failures),
    )


def _solve_indices(solver: ExponentSolver, root: float | None) -> tuple[dict[str, Estimate | None], list[str]]:
    """All indices, δ_p first, and why some are missing."""
    estimates: dict[str, Estimate | None] = dict.fromkeys(INDICES)
    missing = []
    for index in (STABILITY_INDEX, LYAPUNOV_EXPONENT, VARIANCE_RATE):
        low, high = np.clip(index.interval, *solver.problem.noise.moments)
        try:
            estimates[index.name] = index.solve(solver, root)
            reason = f"Λ(p) has no root p ≠ 0 in [{low:g}, {high:g}]"
        except NotConverged as failure:
            reason = str(failure)
        if estimates[index.name] is None:
            missing.append(f"no stability index: {reason}" if index is STABILITY_INDEX else reason)
    return estimates, missing


def _notes(case: Case, curve: Curve, moments: MomentLyapunov) -> tuple[str, ...]:
    """Where the reduction of the noise, the impact law or Eq. (37) is not valid."""
    notes = [
        None if case.is_exact else validity.reduction_note(curve.original_noise),
        validity.impact_note(curve.oscillator),
        validity.weak_noise_note(curve.problem, moments.p, moments.value),
    ]
    return tuple(note for note in notes if note)


def _unresolved(pairs: Sequence[PrincipalPair]) -> list[str]:
    """Which eigenfunctions are not positive, as layers of slow or strong noise are thinner than the cells."""
    return [
        f"{name} at p = {pair.p:g} is not resolved, {defect:.0%} of it has the wrong sign; its errors have next to no "
        "effect on Λ, but do not read its picture"
        for pair in pairs
        for name, defect in zip(("T", "T_adjoint"), pair.sign_defects, strict=True)
        if defect > UNRESOLVED
    ]


def _imprecise(estimates: Mapping[str, Estimate | None], rtol: float, is_adaptive: bool) -> list[str]:
    """Which indices miss rtol."""
    return [
        f"rtol = {rtol:g} is not met by {INDICES[name].symbol}: {estimate.value:.6g} has an estimated error of "
        f"{estimate.error_estimate:.1e}; {'' if is_adaptive else Remedy.MESH + ', or '}use a larger rtol"
        for name, estimate in estimates.items()
        if estimate and estimate.relative_error > rtol
    ]


def _pair(solver: ExponentSolver, p: float) -> PrincipalPair | None:
    try:
        return solver.pair(p)
    except NotConverged:
        return None


def _comparison(expectation: Expectation, result: CurveResult) -> Comparison:
    if expectation.p is not None:
        found = np.isclose(result.moments.p, expectation.p, rtol=0, atol=1e-12)
        value = float(result.moments.value[found][0]) if np.any(found) else None
    else:
        estimate = result.estimates[expectation.quantity]
        value = None if estimate is None else estimate.value
    tolerance = max(expectation.atol or 0.0, (expectation.rtol or 0.0) * abs(expectation.value))
    met = value is not None and abs(value - expectation.value) <= tolerance
    return Comparison(expectation, dict(result.curve.varied), value, tolerance, met)


def _mesh(space: CylinderSpace) -> dict[str, Any]:
    mesh = space.mesh
    return {
        "full_circle": mesh.is_full_circle,
        "phi_cells": mesh.phi_lines.size - 1,
        "phi_degree": mesh.phi_degree,
        "xi_cells": mesh.z_lines.size - 1,
        "xi_degree": mesh.xi_degree,
        "xi_min": float(mesh.z_lines[0]),
        "xi_max": float(mesh.z_lines[-1]),
        "unknowns": space.size,
    }
