"""Λ(p) of even p by the equations of the moments, whose matrices are read off a problem of any variables and noises."""

from functools import partial

import numpy as np

from fpsolve import ExponentSolver, Problem
from fpsolve.model import Noises
from tests.numbers import second
from tests.numbers.values import Quantity, Row, moment


def matrices_of(problem: Problem):
    """A₀, and A of each noise by its name, for terms that are linear in ξ."""
    terms = [(each, problem.linear.epsilon**each.order * np.array(each.matrix)) for each in problem.linear.terms]
    driven = {}
    for term, matrix in terms:
        if term.noise or term.g(1.0) != term.g(0.0):
            driven[term.noise] = driven.get(term.noise, 0.0) + (term.g(1.0) - term.g(0.0)) * matrix
    return sum(term.g(0.0) * matrix for term, matrix in terms), driven


def by_moments(problem: Problem, p: int, count: int = 16, near: float = 0.0) -> float:
    """Λ(p), by so many functions of each noise."""
    steady, driven = matrices_of(problem)
    noises = dict(problem.noise.named) if isinstance(problem.noise, Noises) else {"": problem.noise}
    driving = [(driven[name], noise) for name, noise in noises.items()]
    return second.even(p, steady, *driving, count=count, near=near)


def even_rows(
    problem: Problem, source: str, most: float, p=(2, 4), doubt=1e-13, count=16, quantity=moment, slow=False, **more
):
    """Rows of Λ(p) of even p."""
    return [
        Row(problem, quantity(q, **more), partial(by_moments, problem, q, count), doubt, most, source, slow) for q in p
    ]


def elements(p: float, **options):
    """Λ(p) by eigenfunctions, also where the moments have equations of their own."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = ExponentSolver(problem, **options).solution(p)
        return found.pair.value, found.error

    return Quantity(f"Λ({p:g}) by elements", solved)
