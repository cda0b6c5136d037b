"""The problem of a case beside its equation: its noises, its parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fpsolve.case.case import Case
from fpsolve.data import written
from fpsolve.model.problem import Problem
from fpsolve.tell.blocks import Block, Column, Sentence, filled
from fpsolve.tell.text import EACH


def show(case: Case) -> Iterator[Block]:
    """The noises, what the equation leaves out, and the parameters."""
    problem = next(case.curves(0, 1)).problem
    yield from map(Sentence, noise_sentences(problem))
    if problem.linear.cubic:
        yield Sentence(
            "Terms of degree 3 act on the stationary response only: Λ(p), λ and δ_p are of the linear system."
        )
    if case.planned > 1:
        keys = ", ".join(case.vary.keys)
        yield Sentence(f"{case.planned} curves, over {keys}; the equation above is that of the first one.")
    rows = []
    for key, each in problem.parameters.items():
        quantity = each.quantity.timed(case.units.time)
        values = dict.fromkeys(case.vary.values(key)) if key in case.vary.keys else [each.value]
        shown = ", ".join(map(written, values)) if len(values) <= EACH else f"{len(values)} values"
        words = "" if quantity.words == key else quantity.words
        rows.append([key, shown, quantity.unit_in_words, words])
    headings = "key", "value", "unit", "what it is"
    yield filled("", [Column(each, is_text=each != "value") for each in headings], rows)


def noise_sentences(problem: Problem) -> list[str]:
    """Each noise in a sentence: its kind, and how strong and how slow it is."""
    lines = list[str]()
    for section, noise in zip(problem.system.noise_sections, problem.noise.parts.values(), strict=False):
        size, time = noise.standard_deviation, noise.correlation_time
        numbers = [f"standard deviation {size:.6g}"] if 0 < size < math.inf else []
        numbers += [f"correlation time {time:.6g}"] if 0 < time < math.inf else []
        name = f"ξ of [{section}]" if len(problem.noise.parts) > 1 else "ξ"
        lines.append(f"{name} is noise of the kind {noise.kind}{', with ' if numbers else ''}{' and '.join(numbers)}.")
        lines[-1] += f" The equation is meant in {noise.sense} sense." if noise.sense else ""
    return lines
