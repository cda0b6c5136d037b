"""What the sections of a case say about each other: every contradiction, with the value and the remedy.

Each section is judged by what is valid of those before it, and by the context: the folder of the case file, and
whether the case varies anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import product
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.analysis.zero import said
from fpsolve.arrays import FloatArray
from fpsolve.case.chart import ChartAxis, ChartSection
from fpsolve.case.figure import FigureSection, figure_refusals
from fpsolve.case.kinds import parameters_of, problem_of, varying
from fpsolve.case.messages import Refusal, nearest, shown
from fpsolve.case.output import OutputSection
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.sections import (
    Expectation,
    MeshSection,
    Moments,
    MonteCarloSection,
    Varied,
    same,
)
from fpsolve.case.vary import FileVary, Vary, assignments
from fpsolve.errors import FpsolveError, MeshError, NoSuchExponent
from fpsolve.fem.discretisation import Discretisation
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.problem import Problem, refuse_infinite
from fpsolve.simulation.setup import obstacles, simulated_parts
from fpsolve.theory.perturbation import second_order_or_none

Known = Mapping[str, Any]
MAX_CURVES = 1_000_000
_MODERATE = "parameters and p must have moderate sizes; bring the extreme ones nearer to 1"


def _of_moments(moments: Moments, valid: Known, context: Known) -> Iterator[Refusal]:
    is_varied = context.get("varies", False)  # then the curves decide which moments exist
    return _of_curves({**valid, "moments": moments}, Vary(), with_existence=not is_varied)


def _of_vary(vary: Vary, valid: Known, context: Known) -> Iterator[Refusal]:
    """Too many curves, or one that cannot be solved; of a file every one."""
    if len(vary) > MAX_CURVES:
        yield (), None, f"makes {len(vary)} curves; must be at most {MAX_CURVES}; list fewer values"
    elif isinstance(vary, FileVary):
        reasons = ((vary.lines[place], text) for place, text in (_unsolvable(valid, vary) if vary.lines else ()))
        for line, text in sorted([*vary.faults, *reasons], key=itemgetter(0)):
            yield ("file",), None, f"{vary.file}:{line}: {text}"
    else:
        yield from _of_curves(valid, vary)


def _of_curves(valid: Known, vary: Vary, *, with_existence: bool = True) -> Iterator[Refusal]:
    """The first of these."""
    for _, text in _unsolvable(valid, vary, with_existence=with_existence):
        yield (), None, text
        return


def _unsolvable(valid: Known, vary: Vary, *, with_existence: bool = True) -> Iterator[tuple[int, str]]:
    """The places of sets that contradict themselves or overflow, or whose moments are infinite, with the reasons."""
    problem = problem_of(valid)
    if problem is None or "moments" not in valid:
        return
    p, at = valid["moments"].values, varying(problem)
    for place, varied in enumerate(vary.sets()):
        reason = _obstacle(at, varied, p, with_existence=with_existence)
        if reason:
            yield place, _with(varied) + reason


def _with(varied: Varied) -> str:
    """Beginning of a sentence on one of several curves."""
    return f"with {assignments(varied)}: " if varied else ""


def _obstacle(at: Callable[[Varied], Problem], varied: Varied, p: FloatArray, *, with_existence: bool = True) -> str:
    """Why there is no such curve, or why some Λ(p) of it is infinite, or nothing."""
    extremes = [float(p.max()), float(p.min())]
    try:
        problem = at(varied)
        with np.errstate(all="ignore"):
            factors = [math.exp(each * jump.log_factor) for jump in problem.system.jumps for each in extremes]
            theory = second_order_or_none(problem)
            sizes = np.array([*factors, *([] if theory is None else [*theory.scale.moment(p), theory.stability_index])])
    except ValueError as error:
        return said(error)
    except OverflowError:  # of R^p
        sizes = np.array([math.inf])
    if not np.all(np.isfinite(sizes)):
        return f"Eqs. (37)-(38) or R^p overflow; {_MODERATE}"
    try:
        for extreme in extremes if with_existence else ():
            refuse_infinite(problem, extreme)
    except NoSuchExponent as error:
        return error.message.words(CASE_WORDS)
    return ""


def _of_mesh(mesh: MeshSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """A mesh that cannot be read or made, is larger than the budget, or too wide for the noise of some curve."""
    try:
        with np.errstate(all="ignore"):
            made = mesh.mesh(context.get("folder", Path()))
            reason = _misfit(made, valid) if made and {"system", "noise", "budget", "vary"} <= valid.keys() else ""
    except MeshError as error:
        reason = error.message.words(CASE_WORDS)
    except (OSError, ValueError) as error:
        reason = str(error)
    if reason:
        text = f"got {shown(mesh.file)}; {reason}" if mesh.file else reason
        yield ("file",) if mesh.file else (), mesh.file, text


def _misfit(mesh: CylinderMesh, valid: Known) -> str:
    """Why the mesh does not serve some noise, or nothing; those of one law in noise units are judged once."""
    judged, base = set[tuple[object, ...]](), valid["noise"]
    for varied in valid["vary"].among([f"{base.section}.{name}" for name in base.values]):
        noise = base.at({key.partition(".")[2]: value for key, value in varied.items()})
        shaping = {f"{noise.section}.{name}": noise.values[name] for name in (*noise.shaped_by, *noise.words)}
        if (shape := tuple(shaping.items())) in judged:
            continue
        judged.add(shape)
        told = _with({key: value for key, value in varied.items() if key in shaping})
        chosen = Discretisation.on(mesh, noise)
        size, most = chosen.size, valid["budget"].unknowns
        if size > most:
            return (
                f"{told}makes {size} unknowns; must be at most budget.unknowns = {most}; use fewer cells or "
                "lower degrees, or a larger [budget]"
            )
        try:
            for each in (chosen, chosen.enriched().enriched()):  # the finer one tells the error
                each.noise.axis(noise, 0.0)
        except MeshError as failure:
            lines = chosen.noise.lines
            return f"{told}from xi = {lines[0]:g} to {lines[-1]:g} {failure}"
    return ""


def _of_monte_carlo(section: MonteCarloSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """The first parameter set for which the time, the step or a p of the simulation is not right."""
    base = problem_of(valid)
    if base is None or "vary" not in valid:
        return
    p = np.array(section.p or (0.0,))
    vary: Vary = valid["vary"]
    is_known = section.p is None and "moments" in valid  # then there are such curves, and λ is finite
    for place, varied in enumerate(vary.sets()):
        row = f"{vary.file}:{vary.lines[place]}: " if isinstance(vary, FileVary) else ""
        reason, faults = "" if is_known else _obstacle(base.at, varied, p), {}
        with suppress(ValueError):  # that is the reason
            try:
                faults = obstacles(*simulated_parts(base.at(varied)), time=section.time, step=section.step)
            except FpsolveError as error:
                yield (), None, row + _with(varied) + error.message.words(CASE_WORDS)
                return
        for name, text in faults.items():
            if getattr(section, name) is not None:
                yield (name,), getattr(section, name), row + _with(varied) + text
        if reason:
            yield ("p",), section.p, row + _with(varied) + reason
        if faults or reason:
            return


def _of_figure(figure: FigureSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """What the other sections do not allow."""
    return figure_refusals(figure, valid)


def _of_output(output: OutputSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """Eigenfunctions at p that are not among the moments, and a figure of what is not computed."""
    wanted = ((("eigenfunctions", i), p) for i, p in enumerate(output.eigenfunctions or ()))
    yield from _of_orders(valid, wanted, "output.eigenfunctions")
    figure: FigureSection | None = valid.get("figure")
    if figure is None:
        return
    if figure.model_fields_set & {"x", "y"} and figure.needed not in output.quantities:
        text = f"has no {shown(figure.needed)}, which figure.y draws; add it, or let figure.y be one of the names here"
        yield ("quantities",), output.quantities, text
    for name in figure.mark if "mark" in figure.model_fields_set else ():
        if name not in output.quantities:
            text = f"has no {shown(name)}, which figure.mark marks; add it, or remove it from figure.mark"
            yield ("quantities",), output.quantities, text


def _of_expect(expect: tuple[Expectation, ...], valid: Known, context: Known) -> Iterator[Refusal]:
    """Each p that is not among the moments, and each key of a `where` that is not varied, or not with that value."""
    yield from _of_orders(valid, (((i, "p"), item.p) for i, item in enumerate(expect) if item.p is not None), "expect")
    vary: Vary | None = valid.get("vary")
    if vary is None:
        return
    stated = ((i, key, value) for i, item in enumerate(expect) for key, value in item.where.items())
    for i, key, value in stated:
        if key not in vary.keys:
            guess, known = nearest(key, vary.keys), ", ".join(vary.keys) or "none"
            text = f"is not varied;{guess} varied keys: {known}; add it to [vary], {_without('expect')}"
            yield (i, "where", key), value, text
        elif not any(same(value, other) for other in vary.columns[key]):
            is_possible = isinstance(value, str) == vary.is_text(key)
            remedy = f"add it to [vary], {_without('expect')}" if is_possible else "write one of these"
            text = f"got {shown(value)}; must be one of {shown(vary.values(key))}; {remedy}"
            yield (i, "where", key), value, text


def _of_chart(chart: ChartSection | None, valid: Known, context: Known) -> Iterator[Refusal]:
    """Axes that are none of this case, or a frame in which there is no such problem or a moment is infinite."""
    problem, parameters = problem_of(valid), parameters_of(valid, context)
    if chart is None or problem is None or parameters is None:
        return
    axes = {"x": chart.x, "y": chart.y}
    found = [
        ((name, *path), value, text)
        for name, axis in axes.items()
        for path, value, text in axis.refusals(problem, parameters)
    ]
    yield from found
    corners = [dict(zip((chart.x.key, chart.y.key), ends, strict=True)) for ends in product(*map(_ends, axes.values()))]
    if found:
        return
    for corner in corners:
        with suppress(ValueError):
            noise = problem.at(corner).noise
            if noise.has_algebraic_tails and noise.tails_beyond is not None:
                limit, most, remedy = noise.tails_beyond
                key = f"{noise.section}.{limit}"
                axis = next((name for name, each in axes.items() if each.key == key), None)
                highest = max([float(problem.values[key]), *(each.stop for each in axes.values() if each.key == key)])
                text = (
                    f"{key} reaches {highest:g} in the frame; for {limit} > {most:g} Λ(p) is infinite or carried by "
                    f"rare paths, and no line of stability; let it end at {most:g}, or {remedy}"
                )
                yield (axis, "stop") if axis else (), highest, text
                return
    p = np.array([zero.p for zero in chart.zero])
    reason = next(
        filter(None, (_with(each) + text for each in corners if (text := _obstacle(problem.at, each, p)))), ""
    )
    if reason:
        yield (), None, f"{reason}; choose another frame"


def _ends(axis: ChartAxis) -> tuple[float, float]:
    return axis.start, axis.stop


def _without(key: str) -> str:
    """How to go on without what a key lists."""
    return f"or go without by --set '{key}=[]'"


def _of_orders(valid: Known, wanted: Iterable[tuple[tuple[str | int, ...], float]], key: str) -> Iterator[Refusal]:
    """Each wanted p of a key, with its path, that is not among the moments."""
    moments: Moments | None = valid.get("moments")
    for path, p in wanted:
        if moments is not None and not moments.has(p):
            first, last = moments.values[[0, -1]]
            known = f"moments.p ({moments.values.size} values, {first:g} to {last:g})"
            yield path, p, f"got {p}; must be among {known}; add it there, choose one of them, {_without(key)}"


REFUSALS: Mapping[str, Callable[[Any, Known, Known], Iterator[Refusal]]] = {
    "moments": _of_moments,
    "vary": _of_vary,
    "mesh": _of_mesh,
    "monte_carlo": _of_monte_carlo,
    "figure": _of_figure,
    "output": _of_output,
    "chart": _of_chart,
    "expect": _of_expect,
}
"""What is wrong with each section."""
