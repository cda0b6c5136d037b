"""Whether the cubic terms bring large amplitudes down, without which there is no stationary response.

Paths start at an amplitude at which the cubic terms are by far larger than the linear ones, at some phases, and follow
the equation with the noise held at its mean. In the plane paths do not cross: where one comes back to its phase lower,
none from below ever gets beyond it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
from scipy.integrate import LSODA
from scipy.optimize import brentq

from fpsolve.arrays import FloatArray
from fpsolve.model.plane import matrix_at
from fpsolve.nonlinear.operator import Flow

LEVEL = 1e6
"""Of the cubic terms over the linear ones, where paths start: far, as coefficients may be of different sizes."""
PHASES = 8
"""At which they start."""
LEAST, LOWER, HIGHER = 1e-3, math.log(2), 30.0
"""How far u must fall in a half-turn, and where the phase does not turn, and above which rise it is growing."""
MOST = 500.0
"""Of 2 ln a, for trial steps that go too far."""
MOST_STEPS = 2000
"""Of one path; one that is not lower by then counts as growing."""
Field = Callable[[float, FloatArray], tuple[float, float]]


def comes_down(flow: Flow) -> bool:
    """Whether all of the paths come lower."""
    system, inverse = flow.problem.system, np.diag(1 / np.diag(flow.frame.matrix))
    assert system.cubic is not None
    a = inverse @ matrix_at(system, flow.problem.coloured.mean) @ np.array(flow.frame.matrix)
    c = np.array(flow.frame.cubic(system.cubic).matrix)
    begin = 0.5 * math.log(LEVEL * float(np.linalg.norm(a) / np.linalg.norm(c)))
    phases = flow.half_turn[0] + math.pi * (np.arange(PHASES) + 0.5) / PHASES
    with warnings.catch_warnings(action="ignore"):  # of a path that goes to infinity
        return all(_falls(_field(flow, a, c), begin, phi) for phi in phases.tolist())


def _field(flow: Flow, a: FloatArray, c: FloatArray) -> Field:
    """du and dφ in a time that runs as fast as the path moves; a path takes some 1,000 of these, so no arrays."""
    (a11, a12), (a21, a22) = a.tolist()
    (c10, c11, c12, c13), (c20, c21, c22, c23) = c.tolist()
    first, slope = float(flow.half_turn[0]), flow.log_factor / math.pi

    def field(_: float, state: FloatArray) -> tuple[float, float]:
        u, phi = state.tolist()
        square = math.exp(min(2 * (u - slope * ((phi - first) % math.pi - 0.5 * math.pi)), MOST))
        x, y = math.cos(phi), -math.sin(phi)
        f = a11 * x + a12 * y + square * (((c10 * x + c11 * y) * x + c12 * y * y) * x + c13 * y**3)
        g = a21 * x + a22 * y + square * (((c20 * x + c21 * y) * x + c22 * y * y) * x + c23 * y**3)
        turn = (y * f - x * g) / (1 + square)
        return (x * f + y * g) / (1 + square) + slope * turn, turn

    return field


def _falls(field: Field, begin: float, phi: float) -> bool:
    """Whether one path from a u and a φ does."""
    solver = LSODA(field, 0.0, np.array([begin, phi]), math.inf, rtol=1e-7, atol=1e-9)
    for _ in range(MOST_STEPS):
        solver.step()
        if solver.status == "failed" or solver.y[0] > begin + HIGHER:
            return False
        if solver.y[0] <= begin - LOWER:
            return True
        if abs(solver.y[1] - phi) >= math.pi:
            return _height_at(solver, phi + math.copysign(math.pi, solver.y[1] - phi)) < begin - LEAST
    return False


def _height_at(solver: LSODA, phi: float) -> float:
    """u where the path passed a φ in its last step."""
    path = solver.dense_output()
    return float(path(brentq(lambda t: path(t)[1] - phi, solver.t_old, solver.t))[0])
