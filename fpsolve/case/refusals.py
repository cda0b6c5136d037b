"""What the sections of a case say about each other: every contradiction, with the value and the remedy.

Each section is judged by what is valid of those before it, and by the context: the folder of the case file, and
whether the case varies anything.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from fpsolve.analysis.excursions import STATIONARY, check_start
from fpsolve.analysis.target import said
from fpsolve.arrays import FloatArray, is_log_spaced
from fpsolve.case.explain import Refusal
from fpsolve.case.kinds import problem_of
from fpsolve.case.sections import (
    EXCURSIONS,
    RESPONSE,
    ExcursionSection,
    Expectation,
    FigureSection,
    Moments,
    OutputSection,
    ResponseSection,
    Varied,
    same,
)
from fpsolve.case.vary import Vary, assignments, map_key
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.quantities import SUMMARY_NUMBERS
from fpsolve.model.faults import nearest, quoted, shown
from fpsolve.model.parameters import Section
from fpsolve.model.problem import Problem
from fpsolve.theory.perturbation import second_order_or_none

Known = Mapping[str, Any]
MAX_SETS = 100_000


def _of_moments(moments: Moments, valid: Known, context: Known) -> Iterator[Refusal]:
    """One of the first set; where keys are varied each has those that exist, but even ones alone are so for all."""
    if problem := problem_of(valid):
        method = choose(problem)
        is_told = method.is_computed and not (context.get("varies") and method.has_pairs)
        if text := obstacle(problem, {}, moments.values, with_moments=is_told):
            yield (), text


def _of_vary(vary: Vary, valid: Known, context: Known) -> Iterator[Refusal]:
    """Too many parameter sets, or a first one that cannot be solved; the others are told of when they are solved."""
    problem, moments = problem_of(valid), valid.get("moments")
    if len(vary) > MAX_SETS:
        yield (), f"makes {len(vary)} parameter sets; must be at most {MAX_SETS}; list fewer values"
    elif problem and moments and (text := obstacle(problem, vary.sets[0], moments.values, with_moments=False)):
        yield ("file",) if vary.file else (), vary.line_of(1) + _with(vary.sets[0]) + text


def _with(varied: Varied) -> str:
    return f"with {assignments(varied)}: " if varied else ""


def obstacle(base: Problem, varied: Varied, p: FloatArray, *, with_moments: bool = True) -> str:
    """Why there is no such parameter set, or why some Λ(p) of it is not computed, or nothing."""
    extremes = [float(p.max()), float(p.min())] if p.size else []
    try:
        problem = base.at(varied)
        with np.errstate(all="ignore"):
            factors = [np.exp(each * jump.log_factor) for jump in problem.linear.jumps for each in extremes]
            theory = second_order_or_none(problem)
            if theory is not None:
                factors += [*theory.scale.moment(p), theory.stability_index if theory.quadratic else 0.0]
    except ValueError as error:
        return said(error)
    if not np.all(np.isfinite(factors)):
        text = "parameters and p must have moderate sizes; bring the extreme ones nearer to 1"
        return f"Eqs. (37)-(38) or R^p overflow; {text}"
    if with_moments:
        method = choose(problem)
        for each in extremes if method.has_pairs else p.tolist():
            if told := method.reason(each):
                return told
    return ""


def _of_figure(figure: FigureSection, valid: Known, context: Known) -> Iterator[Refusal]:
    if figure.moment is not None:
        yield from _of_orders(valid, [(("y", "moment"), figure.moment)], "or choose one of them")
    vary: Vary | None = valid.get("vary")
    if vary is None:
        return
    known = ["p", *(key for key in vary.keys if not vary.is_text(key))]
    if figure.x not in known:
        text = f";{nearest(figure.x, known)} must be p or a key of [vary]: {', '.join(known)}; add it to [vary]"
        if figure.x in vary.keys:
            text = f", whose values are texts; must be one of {', '.join(known)}; choose one of them"
        yield ("x",), f"got {shown(figure.x)}{text}"
        return
    if figure.map and vary.crossing(figure.x) is None:
        text = (
            'got true; a map needs a [vary] with mode = "product" of two keys, each with several numbers, and x must '
            "be one of them; vary two such keys, or remove it"
        )
        yield ("map",), text
    for name, key, limits in (("xlim", figure.x, figure.xlim), ("ylim", map_key(figure, vary), figure.ylim)):
        if key in vary.keys and limits and limits[0] <= 0 and is_log_spaced(vary.values(key)):
            text = f"got {shown(limits)}; must be > 0, as the values of {key} differ by factors, so that its axis is "
            yield (name,), f"{text}logarithmic; raise the smaller one"


def _of_output(output: OutputSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """Eigenfunctions at p that are not among the moments, a figure of what is not computed, and what is none."""
    problem = problem_of(valid)
    if problem and output.lists_quantities:
        for name in {*(output.names or ())} & SUMMARY_NUMBERS.keys():
            if told := choose(problem).reason(0.0, SUMMARY_NUMBERS[name].symbol):
                yield ("quantities",), told
    wanted = ((("eigenfunctions", i), p) for i, p in enumerate(output.eigenfunctions or ()))
    yield from _of_orders(valid, wanted, f"choose one of them, {_without('output.eigenfunctions')}")
    figure: FigureSection = valid.get("figure", FigureSection())
    drawn = figure.model_fields_set
    if drawn & {"x", "y"} and output.lacks(figure.needed):
        text = f"has no {shown(figure.needed)}, which figure.y draws; add it, or let figure.y be one of the names here"
        yield ("quantities",), text
    for name in figure.mark if "mark" in drawn else ():
        if output.lacks(name):
            text = f"has no {shown(name)}, which figure.mark marks; add it, or remove it from figure.mark"
            yield ("quantities",), text


def _of_expect(expect: tuple[Expectation, ...], valid: Known, context: Known) -> Iterator[Refusal]:
    """Each p that is not among the moments, and each key of a `where` that is not varied, or not with that value."""
    problem, remove = problem_of(valid), _without("expect")
    vary: Vary | None = valid.get("vary")
    numbers = problem.linear.response.numbers if problem else {}
    for i, item in enumerate(expect):
        if item.p is not None:
            yield from _of_orders(valid, [((i, "p"), item.p)], f"choose one of them, {remove}")
        if problem and item.of_response and item.of_response not in numbers:
            names = quoted(f"{RESPONSE}.{each}" for each in numbers)
            text = f'got "{item.quantity}"; must be one of {names} for this system; choose one of these'
            yield (i, "quantity"), text
        if vary is None:
            continue
        for key, value in item.where.items():
            if key not in vary.keys:
                guess, known = nearest(key, vary.keys), ", ".join(vary.keys) or "none"
                text = f"is not varied;{guess} varied keys: {known}; add it to [vary], {remove}"
                yield (i, "where", key), text
            elif not any(same(value, other) for other in vary.values(key)):
                is_possible = (type(value) is str) == vary.is_text(key)
                remedy = f"add it to [vary], {remove}" if is_possible else "write one of these"
                text = f"got {shown(value)}; must be one of {shown(vary.values(key))}; {remedy}"
                yield (i, "where", key), text


def _of_excursions(section: ExcursionSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """Excursions that are not computed, or a start that the noise of the first parameter set does not have."""
    yield from _unwanted(EXCURSIONS, section, valid)
    problem, vary = problem_of(valid), valid.get("vary", Vary())
    if problem is None or section.xi == STATIONARY:
        return
    try:
        made = problem.at(vary.sets[0])
    except ValueError:  # another fault tells why
        return
    try:
        check_start(made, section.phi, section.xi)
    except ValueError as error:
        yield ("xi",), f"{_with(vary.sets[0])}{error}"


def _of_response(section: ResponseSection, valid: Known, context: Known) -> Iterator[Refusal]:
    """A response that is not computed, or one that is left out and asked for."""
    output: OutputSection = valid.get("output", OutputSection())
    yield from () if section.off else _unwanted(RESPONSE, section, valid)
    if section.off and output.lists_quantities and not output.lacks(RESPONSE):
        text = f'got true, but output.quantities names "{RESPONSE}"; remove one of the two'
        yield ("off",), text


def _unwanted(name: str, section: Section, valid: Known) -> Iterator[Refusal]:
    """The section of a quantity that is not computed."""
    output: OutputSection = valid.get("output", OutputSection())
    if section.model_fields_set and output.lacks(name):
        text = f'stands here, but output.quantities has no "{name}"; add it there, or remove this section'
        yield (), text


def _without(key: str) -> str:
    return f"or remove it by --set '{key}=[]'"


def _of_orders(valid: Known, wanted: Iterable[tuple[tuple[str | int, ...], float]], remedy: str) -> Iterator[Refusal]:
    """Each wanted p, with its path, that is not among the moments."""
    moments: Moments | None = valid.get("moments")
    for path, p in wanted:
        if moments is not None and not moments.has(p):
            values = moments.values
            ends = f"{values[0]:g} to {values[-1]:g}" if values.size else "none is stated"
            known = f"moments.p ({values.size} values, {ends})"
            yield path, f"got {p}; must be among {known}; add it there, {remedy}"


REFUSALS: Mapping[str, Callable[[Any, Known, Known], Iterator[Refusal]]] = {
    "moments": _of_moments,
    "vary": _of_vary,
    "figure": _of_figure,
    "output": _of_output,
    "expect": _of_expect,
    EXCURSIONS: _of_excursions,
    RESPONSE: _of_response,
}
"""What is wrong with each section."""
