"""Λ(p) for even p without a phase: the moments of order p of the state obey a closed set of linear equations.

Without walls the functions √(p over k) x^(p−k) v^k are moved by ẋ = Ax with a matrix K(A) of size p + 1, which is the
symmetric power of A: linear in A, and skew-symmetric for a rotation. White noises Bx ∘ dW add ½K(B)². Of a chain there
is such a block in each state, and its rates couple them. Impulses exp(B) add their rate times exp K(B) − 1. Λ(p) is the
largest real part of an eigenvalue, as ‖x‖^p is between two of the moments.
"""

from __future__ import annotations

import math
import sys

import numpy as np
import scipy.linalg

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoHierarchy
from fpsolve.model.plane import matrix_at
from fpsolve.model.problem import Problem

MOST = 2000
"""Equations at most."""


def hierarchy_exponent(problem: Problem, p: float) -> tuple[float, float]:
    """Λ(p), and its error by rounding.

    Raises:
        NoHierarchy: the equations do not close for this problem and this p, or are too many.
    """
    refuse_open_hierarchy(problem, p)
    noises, order = problem.coloured.parts.values(), int(p)
    rates: FloatArray = np.zeros((1, 1))
    states = problem.at_values([noise.reached for noise in noises])  # ξ = 0 of white noise
    for noise in noises:
        own = np.array(noise.rates)  # type: ignore[attr-defined]
        rates = np.asarray(np.kron(rates, np.eye(len(own))) + np.kron(np.eye(len(rates)), own), dtype=float)
    total = np.kron(rates.T, np.eye(order + 1))
    diffused = [
        _moved(problem.system.epsilon**each.order * np.array(each.matrix), order) for each in problem.diffusions
    ]
    struck = np.zeros((order + 1, order + 1))
    for impulse in problem.impulses:
        gain = scipy.linalg.expm(_moved(np.array(impulse.exponent), order))
        struck += impulse.rate * (gain - np.eye(order + 1))
    for i, matrix in enumerate(matrix_at(problem.motion, states).reshape(-1, 2, 2)):
        here = slice(i * (order + 1), (i + 1) * (order + 1))
        total[here, here] += _moved(matrix, order) + sum(0.5 * each @ each for each in diffused) + struck
    values, left, right = scipy.linalg.eig(total, left=True)
    at = int(np.argmax(values.real))
    condition = 1 / max(abs(np.vdot(left[:, at], right[:, at])), sys.float_info.epsilon)
    return float(values[at].real), 10 * sys.float_info.epsilon * float(np.linalg.norm(total)) * float(condition)


def refuse_open_hierarchy(problem: Problem, p: float) -> None:
    """Refuse a problem whose moments of order p do not close, or are too many. Raises `NoHierarchy`."""
    noises = problem.coloured.parts.values()
    if not (p > 0 and p % 2 == 0):
        raise NoHierarchy(f"got p = {p:g}; the equations of the moments close for even p > 0 only; choose p = 2, 4, …")
    if problem.dimension > 2:
        raise NoHierarchy(
            f"got {problem.dimension} variables; the moment hierarchy is for two variables only; compare with "
            "`fpsolve simulate`"
        )
    for noise in (each for each in noises if not each.has_states):
        raise NoHierarchy(
            "the equations of the moments close for white noise, impulses and chains, but not for "
            f"{noise.kind} noise, where each contains a moment with a higher power of the noise; compare with "
            "`fpsolve simulate`"
        )
    if any(jump.log_factor for jump in problem.system.jumps):
        raise NoHierarchy(
            "the equations of the moments do not close where a wall changes the state, as that happens at one phase; "
            "compare with `fpsolve simulate`, or remove the wall"
        )
    count = math.prod(noise.reached.size for noise in noises) * (int(p) + 1)
    if count > MOST:
        raise NoHierarchy(f"got p = {p:g}; its {count:.12g} equations are more than {MOST}; use a smaller p")


def _moved(matrix: FloatArray, order: int) -> FloatArray:
    """K(A), shape (order + 1, order + 1)."""
    k = np.arange(order + 1)
    ladder = np.sqrt(k[1:] * (order + 1 - k[1:]))
    own = (order - k) * matrix[0, 0] + k * matrix[1, 1]
    return np.asarray(np.diag(own) + np.diag(matrix[0, 1] * ladder, 1) + np.diag(matrix[1, 0] * ladder, -1))
