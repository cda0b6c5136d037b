"""The kinds of problems, and which method finds Λ(p) of each."""

from __future__ import annotations

from fpsolve.exponent.blocks import Blocks
from fpsolve.exponent.closed import DelayMoments, EvenMoments, Simulated
from fpsolve.exponent.elements import Directions, Elements, GivenMesh, Stopped
from fpsolve.exponent.method import Method, Settings
from fpsolve.model.problem import Problem, checked_problem

METHODS: list[type[Method]] = [Simulated, DelayMoments, EvenMoments, Blocks, Stopped, Directions, Elements]
"""The first that takes a problem is its method."""


def choose(problem: Problem, settings: Settings | None = None) -> Method:
    """The method of a problem, with settings."""
    settings = settings or Settings()
    kind = next(each for each in METHODS if each.takes(checked_problem(problem)))
    return (GivenMesh if kind is Elements and settings.mesh else kind)(problem, settings, choose)
