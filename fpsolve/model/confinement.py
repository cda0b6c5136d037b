"""Whether there is a stationary response, as far as the equation tells: the cubic terms bring large amplitudes down.

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

from fpsolve.arrays import ROUNDED, FloatArray
from fpsolve.messages import Code, Message
from fpsolve.model.coordinates import Frame
from fpsolve.model.plane import CoefficientMatrix, LinearMotion
from fpsolve.model.problem import Problem

LEVEL = 1e6
"""Cubic terms over the linear ones where paths start: far, as coefficients may be of different sizes."""
PHASES = 8
"""Number of φ at which they start."""
LEAST = 1e-3
"""Smallest fall of ln a in a half-turn."""
LOWER = math.log(2)
"""Fall of ln a that suffices where the phase does not turn."""
HIGHER = 30.0
"""Rise of ln a from which on a path grows."""
MOST = 500.0
"""Largest 2 ln a, for trial steps that go too far."""
MOST_STEPS = 2000
"""Largest number of steps of one path; one that is not lower by then counts as growing."""
Field = Callable[[float, FloatArray], tuple[float, float]]


def amplitude_frame(system: LinearMotion) -> Frame:
    """The frame in which ‖y‖ is the amplitude of a system with cubic terms, see `LinearMotion.aspect`."""
    return Frame(((1.0, 0.0), (0.0, system.aspect / system.second_unit)))


def no_response(problem: Problem) -> Message | None:
    """Why there is no stationary response, or none is computed, whatever λ is."""
    system = problem.linear
    if system.cubic is None:
        return Message(Code.RESPONSE_LINEAR)
    if len(problem.noise.parts) > 1 or problem.noise.has_states:
        return Message(Code.RESPONSE_NOISE)
    size = ROUNDED * float(np.max(np.abs(system.cubic.matrix)))
    is_passed = [abs(float(system.cubic.h(each.phase))) <= size for each in system.jumps]
    if len(is_passed) > 1 or not all(is_passed):
        return Message(Code.RESPONSE_WALLS)
    return None if comes_down(problem) else Message(Code.RESPONSE_GROWS)


def mean_terms(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """The linear terms with the noise at its mean and the cubic terms, shapes (2, 2) and (2, 4), where ‖y‖ is a."""
    system, frame = problem.linear, amplitude_frame(problem.linear)
    assert system.cubic is not None
    linear = frame.term(CoefficientMatrix(0, system.matrix_at(problem.valued.mean)))
    return np.array(linear.matrix), np.array(frame.cubic(system.cubic).matrix)


def comes_down(problem: Problem) -> bool:
    """Whether all of the paths come lower."""
    linear, cubic = mean_terms(problem)
    begin = 0.5 * math.log(LEVEL)
    most = begin - LEAST - math.fsum(jump.log_factor for jump in problem.linear.jumps)
    field = _field(linear / (np.linalg.norm(linear) or 1.0), cubic / np.linalg.norm(cubic))  # in units of their own
    with warnings.catch_warnings(action="ignore"):  # of a path that goes to infinity
        return all(_falls(field, begin, most, math.pi * k / PHASES) for k in range(PHASES))


def _field(linear: FloatArray, cubic: FloatArray) -> Field:
    """d ln a and dφ in a time that runs as fast as the path moves."""
    whole = np.hstack([linear, cubic])

    def field(_: float, state: FloatArray) -> tuple[float, float]:
        height, phi = state.tolist()
        square, x, y = math.exp(min(2 * height, MOST)), math.cos(phi), -math.sin(phi)
        f, g = (whole @ [x, y, *(square * x ** (3 - k) * y**k for k in range(4))]).tolist()
        return (x * f + y * g) / (1 + square), (y * f - x * g) / (1 + square)

    return field


def _falls(field: Field, begin: float, most: float, phi: float) -> bool:
    """Whether the path from ln a = `begin` and a φ falls, in a half-turn to below `most`."""
    solver = LSODA(field, 0.0, np.array([begin, phi]), math.inf, rtol=1e-7, atol=1e-9)
    for _ in range(MOST_STEPS):
        solver.step()
        if solver.status != "running" or solver.y[0] > begin + HIGHER:  # or it stands still
            return False
        if solver.y[0] <= begin - LOWER:
            return True
        if abs(solver.y[1] - phi) >= math.pi:
            return _height_at(solver, phi + math.copysign(math.pi, solver.y[1] - phi)) < most
    return False


def _height_at(solver: LSODA, phi: float) -> float:
    """ln a where the path passed a φ in its last step."""
    path = solver.dense_output()
    return float(path(brentq(lambda t: path(t)[1] - phi, solver.t_old, solver.t))[0])
