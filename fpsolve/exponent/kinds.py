"""The kinds of problems, and which method finds Λ(p) of each."""

from __future__ import annotations

from fpsolve.exponent.blocks import Blocks
from fpsolve.exponent.closed import DelayMoments, EvenMoments, NotComputed, StruckMoments
from fpsolve.exponent.elements import GivenMesh, PlaneElements
from fpsolve.exponent.method import Method, Settings
from fpsolve.exponent.modes import Directions
from fpsolve.exponent.stopped import Stopped
from fpsolve.exponent.subsystem import blocks_of
from fpsolve.model.problem import Problem, checked_problem

MOST_BY_DIRECTIONS = 4
"""Largest number of variables of which functions of a direction are discretised."""
METHODS: list[type[Method]] = []
"""Methods of one's own: the first that takes a problem is its method."""


def choose(problem: Problem, settings: Settings | None = None) -> Method:
    """The method of a problem, with settings. Raises `ValueError`: there is a mesh for more than two variables."""
    settings, problem = settings or Settings(), checked_problem(problem)
    kind = next((each for each in METHODS if each.takes(problem)), None) or kind_of(problem)
    if settings.mesh:
        if problem.dimension > 2:
            raise ValueError(
                "got a mesh, but meshes are for two variables only, as their lines are those of a phase; leave it out"
            )
        kind = GivenMesh if kind is PlaneElements else kind
    return kind(problem, settings, choose)


def kind_of(problem: Problem) -> type[Method]:
    """The method of a problem, if it is none of one's own."""
    is_in_plane, stop = problem.dimension <= 2, problem.linear.stop
    impulses = problem.noise.motion(problem.linear).impulses
    if stop and (problem.dimension != MOST_BY_DIRECTIONS or impulses):
        return NotComputed
    if problem.linear.pasts:
        return DelayMoments
    if problem.dimension > MOST_BY_DIRECTIONS:
        return EvenMoments
    if not is_in_plane and impulses:
        return StruckMoments
    if blocks_of(problem):
        return Blocks
    if is_in_plane:
        return PlaneElements
    return Stopped if stop else Directions
