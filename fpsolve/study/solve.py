"""Solving a curve of a case, and comparing curves with what the case expects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import thread_time
from typing import Any

import numpy as np

from fpsolve.analysis.density import negative_share, stationary_density
from fpsolve.analysis.sensitivity import DIFFERENTIATED, Sensitivities, solve_sensitivities
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.case.output import EIGENFUNCTIONS, SENSITIVITIES
from fpsolve.case.remedies import in_words_of_a_case
from fpsolve.case.sections import Expectation
from fpsolve.errors import NoSuchExponent, NotConverged, Remedy
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.fields import MOST_NEGATIVE, UNRESOLVED
from fpsolve.exponent.moments import solve_moments
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX
from fpsolve.exponent.solver import ExponentSolver, MomentLyapunov
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import message_of
from fpsolve.study.results import Comparison, CurveResult, Moments, Solved
from fpsolve.theory import validity
from fpsolve.theory.perturbation import second_order


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is asked of a curve.

    Attributes:
        p: the moments, shape (n,).
        indices: names of `INDICES`.
        shown: the p whose eigenfunctions are kept.
        density: whether the stationary density is.
        differentiated: the p at which Λ is differentiated by the parameters; None where no sensitivities are wanted.
    """

    p: FloatArray
    indices: tuple[str, ...]
    shown: tuple[float, ...] = ()
    density: bool = False
    differentiated: tuple[float, ...] | None = None

    @property
    def draws(self) -> bool:
        """Whether functions are wanted, and not numbers only."""
        return self.density or bool(self.shown)


@dataclass(frozen=True, eq=False)
class Numerics:
    """How all curves of a case are solved.

    Attributes:
        rtol, mesh, budget: as for `moment_lyapunov`.
    """

    rtol: float
    budget: Budget
    mesh: CylinderMesh | None

    @classmethod
    def of(cls, case: Case) -> Numerics:
        return cls(case.rtol, case.budget, case.cylinder_mesh())


def everything(case: Case, number: int = 1) -> Wanted:
    """What [output] names as `quantities`, of the curve with a number; the density goes with what is drawn of it."""
    names = set(case.output.quantities)
    draws, has_moments = EIGENFUNCTIONS in names, MOMENT.name in names
    slopes = tuple(case.differentiated) if has_moments else ()
    return Wanted(
        case.p if has_moments else np.zeros(0),
        tuple(name for name in INDICES if name in names),
        shown=tuple(case.shown),
        density=draws and (number == 1 or case.shown.size > 0),
        differentiated=slopes if SENSITIVITIES in names else None,
    )


def expected(case: Case, curve: Curve) -> Wanted:
    """What the expectations of a case compare."""
    chosen = [each for each in case.expect if each.selects(curve.varied)]
    p = np.unique([each.p for each in chosen if each.p is not None])
    return Wanted(p, tuple(name for name in INDICES if any(each.quantity == name for each in chosen)))


def compare(case: Case, results: Sequence[CurveResult]) -> list[Comparison]:
    """Every expectation of a case against every curve that it selects."""
    return [
        _comparison(expectation, result)
        for expectation in case.expect
        for result in results
        if expectation.selects(result.curve.varied)
    ]


def solve_curve(
    curve: Curve, wanted: Wanted, numerics: Numerics, progress: Callable[[], None] = lambda: None
) -> Solved:
    """Solve one parameter set; what did not converge is in its `failures`.

    Args:
        curve: the parameter set.
        wanted: what is asked of it.
        numerics: how it is solved.
        progress: called after each moment.
    """
    started = thread_time()
    solver = ExponentSolver(curve.problem, numerics.mesh, rtol=numerics.rtol, budget=numerics.budget)
    found = solve_moments(solver, wanted.p, progress=progress)
    estimates, unsolved, missing, absent = _solve_indices(solver, wanted.indices, found)
    failures = found.failures or tuple(Failure(None, message_of(text)) for text in unsolved)
    pairs, stationary = _functions(solver, without_failed(wanted, found.failures))
    lost = _lost(stationary, solver.near.refinement)
    warnings = [*found.warnings, *missing, *(unsolved if found.failures else ()), *_imprecise(estimates, numerics)]
    warnings += lost or _unresolved(pairs)
    slopes = _sensitivities(solver, curve, wanted, found, estimates)
    notes = [*_notes(curve, found, estimates[LYAPUNOV_EXPONENT.name]), *absent, *(slopes.notes if slopes else ())]
    result = CurveResult(
        curve=curve,
        moments=_moments(found),
        estimates=estimates,
        discretisation=_discretisation(solver),
        warnings=tuple(map(in_words_of_a_case, warnings)),
        sensitivities=slopes,
        notes=tuple(map(in_words_of_a_case, notes)),
        failures=tuple(replace(each, reason=message_of(in_words_of_a_case(each.reason))) for each in failures),
        seconds=thread_time() - started,
    )
    return Solved(result, pairs, None if lost else stationary)


def solve_functions(
    curve: Curve, wanted: Wanted, numerics: Numerics
) -> tuple[tuple[PrincipalPair, ...], PrincipalPair | None]:
    """The eigenpairs of a parameter set whose numbers are known: those to be drawn, and that at p = 0."""
    solver = ExponentSolver(curve.problem, numerics.mesh, rtol=numerics.rtol, budget=numerics.budget)
    pairs, stationary = _functions(solver, wanted)
    return pairs, None if _lost(stationary, "") else stationary


def without_failed(wanted: Wanted, failures: Sequence[Failure]) -> Wanted:
    """The same without the eigenfunctions at the p that failed."""
    failed = {failure.p for failure in failures}
    return replace(wanted, shown=tuple(p for p in wanted.shown if p not in failed))


def _functions(solver: ExponentSolver, wanted: Wanted) -> tuple[tuple[PrincipalPair, ...], PrincipalPair | None]:
    """The eigenpairs to be drawn that converge, and that at p = 0."""
    attempts = (_pair(solver, p) for p in wanted.shown)
    pairs = tuple(pair for pair in attempts if pair is not None)
    return pairs, _pair(solver, 0.0) if wanted.density else None


def _moments(found: MomentLyapunov) -> Moments:
    """The numbers, with Eq. (37) beside them."""
    theory = second_order(found.solver.problem).moment_exponent(found.p)
    return Moments(found.p, found.value, found.derivative, found.error_estimate, found.residual, theory, found.rare)


def _solve_indices(
    solver: ExponentSolver, names: Sequence[str], moments: MomentLyapunov
) -> tuple[dict[str, Estimate | None], list[str], list[str], list[str]]:
    """Indices, δ_p first, None for those not asked for; why some did not converge, are infinite, or do not exist."""
    estimates: dict[str, Estimate | None] = dict.fromkeys(INDICES)
    failed: dict[str, list[str]] = {}
    infinite: dict[str, list[str]] = {}
    absent: dict[str, list[str]] = {}
    missing = []
    for index in sorted(INDICES.values(), key=lambda index: index != STABILITY_INDEX):
        if index.name not in names:
            continue
        try:
            found = index.solve(solver, moments.root)
        except (NotConverged, NoSuchExponent) as failure:
            reasons = failed if isinstance(failure, NotConverged) else infinite
            reasons.setdefault(str(failure), []).append(index.symbol)
            continue
        if isinstance(found, Estimate):
            estimates[index.name] = found
        elif index != STABILITY_INDEX:
            absent.setdefault(found.reason, []).append(index.symbol)
        elif found.reason != validity.NO_INDEX:  # of which a note tells
            missing.append(f"no stability index: {found.reason}")
    told: dict[str, str] = {
        failure.reason: f"as there is no Λ({failure.p:g})" for failure in moments.failures if failure.p is not None
    }
    failed = {told.get(reason, reason): symbols for reason, symbols in failed.items()}
    unsolved, warnings, notes = (
        [f"no {', '.join(symbols)}: {reason}" for reason, symbols in each.items()]
        for each in (failed, infinite, absent)
    )
    return estimates, unsolved, missing + warnings, notes


def _sensitivities(
    solver: ExponentSolver,
    curve: Curve,
    wanted: Wanted,
    moments: MomentLyapunov,
    estimates: Mapping[str, Estimate | None],
) -> Sensitivities | None:
    """The derivatives of what was found by all parameters of the case, if they are wanted."""
    if wanted.differentiated is None:
        return None
    index = estimates[STABILITY_INDEX.name]
    return solve_sensitivities(
        solver,
        np.array([p for p in wanted.differentiated if np.any(moments.p == p)]),
        curve.problem.directions(),
        indices=[name for name in DIFFERENTIATED if estimates[name] is not None],
        root=None if index is None else index.value,
    )


def _notes(curve: Curve, moments: MomentLyapunov, exponent: Estimate | None) -> tuple[str, ...]:
    """What heavy tails make of the numbers, and where the reduction of the noise, the impact law or Eq. (37) fails."""
    notes = [
        validity.heavy_tail_note(curve.problem, None if exponent is None else exponent.value),
        *moments.notes,
        validity.reduction_note(curve.noise),
        validity.impact_note(curve.oscillator),
        validity.weak_noise_note(curve.problem, moments.p, moments.value),
    ]
    return tuple(note for note in notes if note)


def _unresolved(pairs: Sequence[PrincipalPair]) -> list[str]:
    """Which eigenfunctions or T T* are not positive, as layers of slow or strong noise are thinner than the cells."""
    return [
        f"{name} at p = {pair.p:g} is not resolved, {defect:.0%} of it has the wrong sign; its errors have next to no "
        "effect on Λ, but do not read its picture"
        for pair in pairs
        for name, defect, most in (
            ("T", pair.sign_defects[0], UNRESOLVED),
            ("T_adjoint", pair.sign_defects[1], UNRESOLVED),
            ("tilted_density", negative_share(pair), MOST_NEGATIVE),
        )
        if defect > most
    ]


def _lost(stationary: PrincipalPair | None, remedy: str) -> list[str]:
    """Why the stationary density of a pair at p = 0 is not written, and what to do, or nothing."""
    try:
        if stationary is not None:
            stationary_density(stationary)
    except NotConverged as failure:
        return [f"neither the stationary density nor eigenfunctions are written: {failure.reason}; {remedy}"]
    return []


def _imprecise(estimates: Mapping[str, Estimate | None], numerics: Numerics) -> list[str]:
    """Which indices miss rtol."""
    return [
        f"rtol = {numerics.rtol:g} is not met by {INDICES[name].symbol}: {estimate.value:.6g} has an estimated error "
        f"of {estimate.error_estimate:.1e}; {'' if numerics.mesh is None else Remedy.MESH + ', or '}use a larger rtol"
        for name, estimate in estimates.items()
        if estimate and estimate.relative_error > numerics.rtol
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


def _discretisation(solver: ExponentSolver) -> dict[str, Any] | None:
    """That of the p of the largest size that was solved, z in noise units; None where none was."""
    known = solver.near.known
    p = max(known, key=abs, default=None)
    if p is None:
        return None
    generator = known[p].pair.generator
    phase, noise = generator.chosen.phase, generator.chosen.noise
    interval = {"xi_min": float(noise.lines[0]), "xi_max": float(noise.lines[-1])} if noise.lines.size else {}
    return {
        "phi_cells": phase.lines.size - 1,
        "phi_degrees": [int(degree) for degree in phase.degrees],
        "xi": noise.kind,
        "xi_size": noise.size,
        **interval,
        "tilt": noise.slope * p,
        "unknowns": generator.size,
    }
