"""All questions, in the order of work: what needs another one stands after it."""

from __future__ import annotations

from importlib import import_module

from fpsolve.case.sections import PARTS
from fpsolve.solve import discretisation, eigenfunctions, intervals, moments, summary_numbers
from fpsolve.solve.question import Question

QUESTIONS: tuple[Question, ...] = (
    moments.QUESTION,
    moments.RATES,
    *summary_numbers.SUMMARY_NUMBER_QUESTIONS,
    summary_numbers.THEORY,
    moments.CLASSES,
    *(import_module(f"fpsolve.solve.{name}").QUESTION for name in PARTS),
    intervals.QUESTION,
    eigenfunctions.OF_DIRECTIONS,
    discretisation.QUESTION,
)
"""Each is solved, said and written in this order."""
BY_NAME = {each.name: each for each in QUESTIONS}
"""All of them by their names."""
