"""Running a case: solve its curves, write tables, figures and ParaView files."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve import __version__
from fpsolve.case.case import Case
from fpsolve.errors import NotConverged, OutputError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, QUANTITIES
from fpsolve.files import atomic, prepare_folder, write_json
from fpsolve.output.plots import Series, write_figure
from fpsolve.study.simulate import SimulatedCurve
from fpsolve.study.solve import CurveResult, Progress, solve
from fpsolve.theory.second_order import second_order

if TYPE_CHECKING:
    from fpsolve.simulation.estimators import MonteCarlo


def run(case: Case, out: str | Path = "results", *, progress: Progress = lambda: None) -> tuple[CurveResult, ...]:
    """Solve a case and write `out`/<name of the case>/.

    Tables are written anew after every curve, each file whole or not at all, so that what is finished stays.

    Args:
        case: from `load_case`.
        out: folder for the results.
        progress: called after each moment, `work(case)` times in all.

    Raises:
        OutputError: the folder cannot be made or written to; nothing is solved.
        NotConverged: some p failed; everything else is written, and `partial` holds it.
    """
    folder = Path(out) / case.name
    prepare_folder(folder)
    try:
        results = _solve_and_write(case, folder, progress)
    except OSError as failure:
        raise OutputError(f"{failure.filename or folder} cannot be written: {failure.strerror}") from failure
    failures = [failure for result in results for failure in result.failures]
    if failures:
        raise NotConverged("\n".join(failure.reason for failure in failures), results)
    return results


def _solve_and_write(case: Case, folder: Path, progress: Progress) -> tuple[CurveResult, ...]:
    results: list[CurveResult] = []
    written: set[Path] = set()
    for number, result in enumerate(solve(case, progress=progress), start=1):
        written |= _write_paraview(case, result, number, folder)
        results.append(result.without_pairs())
        _write_tables(case, results, folder)
    draw(case, results, folder)
    _remove_stale(folder, written)
    return tuple(results)


def draw(case: Case, results: Sequence[CurveResult], folder: Path, simulated: Sequence[SimulatedCurve] = ()) -> None:
    """Draw the figure of a case into its folder, with the simulated curves as dots."""
    pictures = [folder / "figure.png", folder / "figure.pdf"]
    series = _series(case, results, simulated)
    write_figure(series, case.figure.x, QUANTITIES[case.figure.y], case.title, pictures, is_reduced=case.is_exact)


def _write_tables(case: Case, results: Sequence[CurveResult], folder: Path) -> None:
    """summary.json and moments.csv."""
    summary = {
        "case": case.name,
        "title": case.title,
        "fpsolve_version": __version__,
        "curves": [_summary(result) for result in results],
    }
    write_json(folder / "summary.json", summary)
    with atomic(folder / "moments.csv") as path, path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow([*case.vary, "p", "value", "derivative", "perturbation", "error_estimate", "residual"])
        for result in results:
            table.writerows([*result.curve.varied.values(), *row.values()] for row in _rows(result))


def _summary(result: CurveResult) -> dict[str, Any]:
    theory = second_order(result.curve.problem)
    return {
        "parameters": dict(result.curve.parameters),
        "varied": dict(result.curve.varied),
        "moments": _rows(result),
        **{name: _estimate(result.estimates[name], index.theory(theory)) for name, index in INDICES.items()},
        "mesh": result.mesh,
        "warnings": [*result.warnings, *(failure.reason for failure in result.failures)],
        "notes": list(result.notes),
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


def _write_paraview(case: Case, result: CurveResult, number: int, folder: Path) -> set[Path]:
    """Eigenfunctions of a curve, which are returned; with the first one also the stationary density and the script."""
    from fpsolve.output.vtk import copy_show_script, write_density, write_eigenfunctions

    stationary = result.stationary
    if stationary is None:
        return set()
    if number == 1:
        write_density(folder / "density.vtu", stationary)
    if not result.eigenpairs:
        return set()
    copy_show_script(folder)
    stem = "eigenfunctions" if number == 1 else f"eigenfunctions-{number}"
    return set(write_eigenfunctions(folder, result.eigenpairs, stationary, stem=stem))


def _remove_stale(folder: Path, written: set[Path]) -> None:
    """Eigenfunctions that an earlier run left for curves or p that are no more."""
    ours = re.compile(r"eigenfunctions(-\d+)?(\.pvd|/p[+-][\d.e+-]+\.vtu)")
    for path in {*folder.glob("*.pvd"), *folder.glob("*/*.vtu")} - written:
        if ours.fullmatch(path.relative_to(folder).as_posix()):
            path.unlink()
            if path.parent != folder and not any(path.parent.iterdir()):
                path.parent.rmdir()


def _series(case: Case, results: Sequence[CurveResult], simulated: Sequence[SimulatedCurve]) -> list[Series]:
    """The curves of the case's figure: one for each parameter set, or over x one for each set of the other keys."""
    samples = {each.curve.key: each.result for each in simulated}
    if case.figure.x == "p":
        return [_moment_series(result, samples.get(result.curve.key)) for result in results]
    groups: dict[tuple[tuple[str, float], ...], list[CurveResult]] = {}
    for result in results:
        others = tuple((key, value) for key, value in result.curve.varied.items() if key != case.figure.x)
        groups.setdefault(others, []).append(result)
    return [_parameter_series(case, dict(others), group, samples) for others, group in groups.items()]


def _moment_series(result: CurveResult, sample: MonteCarlo | None) -> Series:
    moments = result.moments
    line = np.linspace(moments.p.min(), moments.p.max(), 200) if moments.p.size else moments.p
    theory = second_order(result.curve.problem).moment_exponent(line)
    found = [(e.p, e.value, e.standard_error) for e in sample.estimates if e.value is not None] if sample else []
    dots = np.array(found, dtype=float).T if found else None
    return Series(dict(result.curve.varied), moments.p, moments.value, line, theory, dots)


def _parameter_series(
    case: Case,
    others: dict[str, float],
    group: Sequence[CurveResult],
    samples: Mapping[tuple[tuple[str, float], ...], MonteCarlo],
) -> Series:
    x = np.array([result.curve.varied[case.figure.x] for result in group])
    index = INDICES[case.figure.y]
    estimates = [result.estimates[index.name] for result in group]
    y = np.array([np.nan if estimate is None else estimate.value for estimate in estimates])
    line = np.linspace(x.min(), x.max(), 200)
    curves = [case.curve({**others, case.figure.x: float(value)}) for value in line]
    line_y = np.array([index.theory(second_order(curve.problem)) for curve in curves])
    line_y[(line_y < index.interval[0]) | (line_y > index.interval[1])] = np.nan  # δ_p has poles
    if index is not LYAPUNOV_EXPONENT:
        return Series(others, x, y, line, line_y)
    found = [(each, samples.get(result.curve.key)) for each, result in zip(x, group, strict=True)]
    dots = [(each, sample.lyapunov_exponent, sample.lyapunov_exponent_error) for each, sample in found if sample]
    return Series(others, x, y, line, line_y, np.array(dots).T if dots else None)
