"""All questions, in the order of work: what needs another one stands after it."""

from __future__ import annotations

from fpsolve.parts import (
    directions,
    discretisation,
    eigenfunctions,
    excursions,
    indices,
    intervals,
    moments,
    rate_function,
    response,
    sensitivities,
)
from fpsolve.parts.question import Question

QUESTIONS: tuple[Question, ...] = (
    moments.QUESTION,
    rate_function.QUESTION,
    *indices.INDEX_QUESTIONS,
    indices.THEORY,
    moments.CLASSES,
    excursions.QUESTION,
    response.QUESTION,
    sensitivities.QUESTION,
    intervals.QUESTION,
    eigenfunctions.QUESTION,
    directions.QUESTION,
    discretisation.QUESTION,
)
"""Each is solved, said and written in this order."""
BY_NAME = {each.name: each for each in QUESTIONS}
"""All of them by their names."""
