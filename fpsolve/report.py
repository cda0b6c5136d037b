"""Running a case: solve its curves, write tables, figures and ParaView files, compare with its expectations."""

from __future__ import annotations

import csv
import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fpsolve import perturbation
from fpsolve.case import Case, Curve
from fpsolve.eigen import PrincipalPair
from fpsolve.errors import MeshError, NotConverged, OutputError
from fpsolve.exponent import REMEDY, SEARCH_INTERVAL, Estimate, ExponentSolver, MomentLyapunov
from fpsolve.files import atomic
from fpsolve.mesh import CylinderMesh
from fpsolve.noise import FloatArray, finite_moments
from fpsolve.plots import Series, write_figure
from fpsolve.schema import Expectation
from fpsolve.space import CylinderSpace

Advance = Callable[[], None]
Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class CurveResult:
    """What was computed for one parameter set.

    Attributes:
        curve: the parameters, the oscillator and the noise.
        moments: Λ(p); where some p failed, of the others.
        moments_perturbation: Eq. (37) at the same p.
        lyapunov_exponent, variance_rate: λ and Λ″(0); None where p = 0 did not converge.
        stability_index: δ_p; None where there is none in the interval searched, or it did not converge.
        stationary: the eigenpair at p = 0; None once it is no longer needed.
        mesh: what was used, ξ in noise units.
        warnings: what limits these numbers.
        failures: why some p are missing.
    """

    curve: Curve
    moments: MomentLyapunov
    moments_perturbation: FloatArray
    lyapunov_exponent: Estimate | None
    stability_index: Estimate | None
    variance_rate: Estimate | None
    stationary: PrincipalPair | None
    mesh: dict[str, Any]
    warnings: tuple[str, ...]
    failures: tuple[str, ...] = ()

    def without_pairs(self) -> CurveResult:
        """The numbers without the eigenpairs, whose matrices take some 20 MB a curve."""
        return replace(self, moments=replace(self.moments, pairs=()), stationary=None)


@dataclass(frozen=True)
class Comparison:
    """One expectation of a case and what was computed; `met` says whether they agree."""

    expectation: Expectation
    varied: dict[str, float]
    value: float | None
    tolerance: float
    met: bool


def run(case: Case, out: str | Path = "results", *, advance: Advance = lambda: None) -> tuple[CurveResult, ...]:
    """Solve a case and write `out`/<name of the case>/.

    Tables are written anew after every curve, each file whole or not at all, so that what is finished stays.

    Args:
        case: from `load_case`.
        out: folder for the results.
        advance: called after each moment, `work(case)` times in all.

    Raises:
        OutputError: the folder cannot be made or written to; nothing is solved.
        NotConverged: some p failed; everything else is written, and `partial` holds it.
    """
    folder = Path(out) / case.name
    _prepare(folder)
    try:
        results = _solve_and_write(case, folder, advance)
    except OSError as failure:
        raise OutputError(f"{failure.filename or folder} cannot be written: {failure.strerror}") from failure
    failures = [failure for result in results for failure in result.failures]
    if failures:
        raise NotConverged("\n".join(failures), results)
    return results


def _solve_and_write(case: Case, folder: Path, advance: Advance) -> tuple[CurveResult, ...]:
    results: list[CurveResult] = []
    written: set[Path] = set()
    for number, result in enumerate(solve(case, advance=advance), start=1):
        written |= _write_paraview(case, result, number, folder)
        results.append(result.without_pairs())
        _write_tables(case, results, folder)
    write_figure(
        _series(case, results), case.figure.x, case.figure.y, case.title, _pictures(folder), is_reduced=case.is_exact
    )
    _remove_stale(folder, written)
    return tuple(results)


def work(case: Case) -> int:
    """How many moments a case has in all its curves."""
    return len(case.curves()) * case.p.size


def solve(case: Case, *, advance: Advance = lambda: None) -> Iterator[CurveResult]:
    """Solve the curves of a case one after the other; what did not converge is in their `failures`."""
    mesh = case.cylinder_mesh()
    for curve in case.curves():
        try:
            yield _solve_curve(curve, mesh, case.p, case.rtol, advance)
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


def _prepare(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        raise OutputError(f"{folder} cannot be made: {failure.strerror}; choose another --out") from failure
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{folder} cannot be written to; choose another --out")


def _solve_curve(curve: Curve, mesh: CylinderMesh | None, p: FloatArray, rtol: float, advance: Advance) -> CurveResult:
    solver = ExponentSolver(curve.oscillator, curve.noise, mesh)
    failures: tuple[str, ...] = ()
    try:
        moments = solver.moments(p, rtol=rtol, advance=advance)
    except NotConverged as failure:
        moments, failures = failure.partial, (str(failure),)
    warnings = list(moments.warnings)
    index, obstacle = _attempt(solver.stability_index)
    if index is None and not obstacle:
        low, high = np.clip(SEARCH_INTERVAL, *finite_moments(curve.noise))
        warnings.append(f"no stability index: Λ(p) has no root p ≠ 0 in [{low:g}, {high:g}]")
    exponent, no_exponent = _attempt(solver.lyapunov_exponent)
    rate, no_rate = _attempt(solver.variance_rate)
    stationary, _ = _attempt(lambda: solver.pair(0.0))
    warnings += [f"no stability index: {obstacle}"] * bool(obstacle) + [no_exponent] * bool(no_exponent)
    warnings += [no_rate] * bool(no_rate) + _imprecise({"λ": exponent, "δ_p": index, "Λ″(0)": rate}, rtol)
    return CurveResult(
        curve=curve,
        moments=moments,
        moments_perturbation=perturbation.moment_exponent(curve.oscillator, curve.noise, moments.p),
        lyapunov_exponent=exponent,
        stability_index=index,
        variance_rate=rate,
        stationary=stationary,
        mesh=_mesh(solver.generator.space),
        warnings=(*warnings, *(line for failure in failures for line in failure.splitlines())),
        failures=failures,
    )


def _imprecise(estimates: dict[str, Estimate | None], rtol: float) -> list[str]:
    """Which of some named numbers miss rtol."""
    return [
        f"rtol = {rtol:g} is not met by {name}: {estimate.value:.6g} has an estimated error of "
        f"{estimate.error_estimate:.1e}; {REMEDY}, or use a larger rtol"
        for name, estimate in estimates.items()
        if estimate and estimate.relative_error > rtol
    ]


def _attempt(compute: Callable[[], Found]) -> tuple[Found | None, str]:
    """What is computed, or why it did not converge."""
    try:
        return compute(), ""
    except NotConverged as failure:
        return None, str(failure)


def _comparison(expectation: Expectation, result: CurveResult) -> Comparison:
    if expectation.p is not None:
        found = np.isclose(result.moments.p, expectation.p, rtol=0, atol=1e-12)
        value = float(result.moments.value[found][0]) if np.any(found) else None
    else:
        estimate = getattr(result, expectation.quantity)
        value = None if estimate is None else estimate.value
    tolerance = max(expectation.atol or 0.0, (expectation.rtol or 0.0) * abs(expectation.value))
    met = value is not None and abs(value - expectation.value) <= tolerance
    return Comparison(expectation, dict(result.curve.varied), value, tolerance, met)


def _write_tables(case: Case, results: Sequence[CurveResult], folder: Path) -> None:
    """summary.json and moments.csv."""
    summary = {
        "case": case.name,
        "title": case.title,
        "fpsolve_version": version("fpsolve"),
        "curves": [_summary(result) for result in results],
    }
    with atomic(folder / "summary.json") as path:
        path.write_text(json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8")
    with atomic(folder / "moments.csv") as path, path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow([*case.vary, "p", "value", "derivative", "perturbation", "error_estimate", "residual"])
        for result in results:
            table.writerows([*result.curve.varied.values(), *row.values()] for row in _rows(result))


def _summary(result: CurveResult) -> dict[str, Any]:
    oscillator, noise = result.curve.oscillator, result.curve.noise
    return {
        "parameters": dict(result.curve.parameters),
        "varied": dict(result.curve.varied),
        "moments": _rows(result),
        "lyapunov_exponent": _estimate(result.lyapunov_exponent, perturbation.lyapunov_exponent(oscillator, noise)),
        "stability_index": _estimate(result.stability_index, perturbation.stability_index(oscillator, noise)),
        "variance_rate": _estimate(result.variance_rate, perturbation.variance_rate(oscillator, noise)),
        "mesh": result.mesh,
        "warnings": list(result.warnings),
    }


def _rows(result: CurveResult) -> list[dict[str, float]]:
    moments = result.moments
    columns = {
        "p": moments.p,
        "value": moments.value,
        "derivative": moments.derivative,
        "perturbation": result.moments_perturbation,
        "error_estimate": moments.error_estimate,
        "residual": moments.residual,
    }
    return [{name: float(values[i]) for name, values in columns.items()} for i in range(moments.p.size)]


def _estimate(estimate: Estimate | None, theory: float) -> dict[str, float] | None:
    if estimate is None:
        return None
    return {"value": estimate.value, "error_estimate": estimate.error_estimate, "perturbation": theory}


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


def _write_paraview(case: Case, result: CurveResult, number: int, folder: Path) -> set[Path]:
    """Eigenfunctions of a curve, which are returned; with the first one also the stationary density and the script."""
    from fpsolve.vtk import copy_show_script, write_density, write_eigenfunctions

    stationary = result.stationary
    if stationary is None:
        return set()
    if number == 1:
        write_density(folder / "density.vtu", stationary)
    wanted = case.output.eigenfunctions
    pairs = [k for k in result.moments.pairs if wanted is None or np.any(np.isclose(k.p, wanted, rtol=0, atol=1e-12))]
    if not pairs:
        return set()
    copy_show_script(folder)
    stem = "eigenfunctions" if number == 1 else f"eigenfunctions-{number}"
    return set(write_eigenfunctions(folder, pairs, stationary, stem=stem))


def _remove_stale(folder: Path, written: set[Path]) -> None:
    """Eigenfunctions that an earlier run left for curves or p that are no more."""
    ours = re.compile(r"eigenfunctions(-\d+)?(\.pvd|/p[+-][\d.e+-]+\.vtu)")
    for path in {*folder.glob("*.pvd"), *folder.glob("*/*.vtu")} - written:
        if ours.fullmatch(path.relative_to(folder).as_posix()):
            path.unlink()
            if path.parent != folder and not any(path.parent.iterdir()):
                path.parent.rmdir()


def _pictures(folder: Path) -> list[Path]:
    return [folder / "figure.png", folder / "figure.pdf"]


def _series(case: Case, results: Sequence[CurveResult]) -> list[Series]:
    """The curves of the case's figure: one for each parameter set, or over x one for each set of the other keys."""
    if case.figure.x == "p":
        return [_moment_series(result) for result in results]
    groups: dict[tuple[tuple[str, float], ...], list[CurveResult]] = {}
    for result in results:
        others = tuple((key, value) for key, value in result.curve.varied.items() if key != case.figure.x)
        groups.setdefault(others, []).append(result)
    return [_parameter_series(case, dict(others), group) for others, group in groups.items()]


def _moment_series(result: CurveResult) -> Series:
    moments = result.moments
    line = np.linspace(moments.p.min(), moments.p.max(), 200) if moments.p.size else moments.p
    theory = perturbation.moment_exponent(result.curve.oscillator, result.curve.noise, line)
    return Series(dict(result.curve.varied), moments.p, moments.value, line, theory)


def _parameter_series(case: Case, others: dict[str, float], group: Sequence[CurveResult]) -> Series:
    x = np.array([result.curve.varied[case.figure.x] for result in group])
    estimates = [getattr(result, case.figure.y) for result in group]
    y = np.array([np.nan if estimate is None else estimate.value for estimate in estimates])
    line = np.linspace(x.min(), x.max(), 200)
    theory = getattr(perturbation, case.figure.y)
    curves = [case.curve({**others, case.figure.x: float(value)}) for value in line]
    line_y = np.array([theory(curve.oscillator, curve.noise) for curve in curves])
    if case.figure.y == "stability_index":  # it has poles, and is sought in this interval only
        line_y[(line_y < SEARCH_INTERVAL[0]) | (line_y > SEARCH_INTERVAL[1])] = np.nan
    return Series(others, x, y, line, line_y)
