"""Paths under several independent noises: each by itself moves the state by a flow that is known exactly, in turn.

Of ẋ = (A₀ + Σ ξ_k A_k) x the flow of A₀ is exp(A₀ t), and that of ξ_k A_k with the noise that drives it is exp(I_k A_k)
with I_k = ∫ξ_k dt, of white noise ∫dW, of impulses Σ w_j. A step is

    exp(A₀ h/2) · exp(I₁A₁) exp(I₂A₂) ⋯ · exp(A₀ h/2),

the factors between in this order or in the opposite one, each as likely (S. Ninomiya and N. Victoir, Appl. Math.
Finance 15, 2008): of weak order 2, whatever the noises are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from fpsolve.arrays import FloatArray
from fpsolve.model.noise import Noise
from fpsolve.model.noises.steps import ChainStep
from fpsolve.simulation.compiled import compiled
from fpsolve.simulation.motions import drawn, exact_factors, factors, flow_on, picked
from fpsolve.simulation.rays import Rays


class Driver(NamedTuple):
    """One of several noises, whose state is a row of that of all.

    Attributes:
        step: its own.
        row: the row.
    """

    step: Any
    row: int


class WideDriver(NamedTuple):
    """The same of a noise whose state has several rows, the last of them before `end`."""

    step: Any
    row: int
    end: int


class SplitMotion(NamedTuple):
    """A₀ and the matrix of each noise as rows (t, p, q, r), shape (1 + noises, 4)."""

    matrices: FloatArray
    rays: Rays

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """As that of a `DrivenMotion`, with a tuple of drivers as the step of the noise."""
        integrals = np.empty((m.matrices.shape[0] - 1, x.size))
        integrate_all(noise, xi, h, integrals, 0, room, push, rng)
        return step_split(m, h, x, u, integrals, log_norm, rng)


def drivers(noises: Mapping[str, Noise], h: float) -> tuple[Driver | WideDriver, ...]:
    """Those of some noises for a step of length h, their rows in the order of `Noises.start`."""
    found, row, rng = list[Driver | WideDriver](), 0, np.random.default_rng(0)
    for noise in noises.values():
        count = len(np.atleast_2d(noise.start(1, rng)))
        found.append(Driver(noise.step(h), row) if count == 1 else WideDriver(noise.step(h), row, row + count))
        row += count
    return tuple(found)


def _integrate_all(noises, state, h, integrals, at, room, push, rng):  # type: ignore[no-untyped-def]
    """∫ξ dt of every noise over a step; this is what numba replaces, as that of each is of a type of its own."""
    raise NotImplementedError


@overload(_integrate_all)
def _integrated_one_by_one(noises, state, h, integrals, at, room, push, rng):  # type: ignore[no-untyped-def]
    if len(noises.types) == 0:
        return lambda noises, state, h, integrals, at, room, push, rng: None

    def one_and_the_rest(noises, state, h, integrals, at, room, push, rng):  # type: ignore[no-untyped-def]
        _integrate(noises[0], state, h, integrals[at], room, push, rng)  # type: ignore[no-untyped-call]
        _integrate_all(noises[1:], state, h, integrals, at + 1, room, push, rng)  # type: ignore[no-untyped-call]

    return one_and_the_rest


@compiled
def integrate_all(noises, state, h, integrals, at, room, push, rng):  # type: ignore[no-untyped-def]
    """∫ξ dt of every noise over a step, from the row `at` on."""
    _integrate_all(noises, state, h, integrals, at, room, push, rng)  # type: ignore[no-untyped-call]


def _integrate(driver, state, h, integral, room, push, rng):  # type: ignore[no-untyped-def]
    """∫ξ dt of one noise; this is what numba replaces by its kind."""
    raise NotImplementedError


@overload(_integrate)
def _integrated_by_its_kind(driver, state, h, integral, room, push, rng):  # type: ignore[no-untyped-def]
    if driver.types[0].instance_class is ChainStep:
        return lambda driver, state, h, integral, room, push, rng: _of_chain(
            driver.step, h, state[driver.row], integral, rng
        )
    if driver.instance_class is WideDriver:

        def wide(driver, state, h, integral, room, push, rng):  # type: ignore[no-untyped-def]
            drawn(driver.step, state[driver.row : driver.end], integral, room[1, : integral.size], push, rng)
            integral *= h

        return wide

    def plain(driver, state, h, integral, room, push, rng):  # type: ignore[no-untyped-def]
        drawn(driver.step, state[driver.row], integral, room[1, : integral.size], push, rng)
        integral *= h

    return plain


@compiled
def _of_chain(chain, h, states, integral, rng):  # type: ignore[no-untyped-def]
    """∫ξ dt of a chain, or of impulses, whose states are moved."""
    for i in range(states.size):
        k, left, total = int(states[i]), h, 0.0
        while left > 0:
            stay = rng.standard_exponential() / chain.leaving[k]
            total += chain.values[k] * min(stay, left)
            left -= stay
            if left > 0:
                k = picked(chain.reached[k], rng)
                total += chain.sizes[k]
        states[i], integral[i] = k, total


@compiled
def step_split(m, h, x, u, integrals, log_norm, rng):  # type: ignore[no-untyped-def]
    """Move paths by one step of length h, in place, and return how often they crossed lines.

    Args:
        m: a `SplitMotion`.
        x, u: the state.
        integrals: ∫ξ dt of every noise over the step, shape (noises, n).
        log_norm: takes in what the norm has grown by beyond that of the state.
        rng: a `numpy.random.Generator`.
    """
    crossed, count = 0, integrals.shape[0]
    half = exact_factors(m, 0, 0.5 * h)
    for i in range(x.size):
        x1, u1, log, before = flow_on(m, 0, half, x[i], u[i])
        is_forward = rng.random() < 0.5
        for j in range(count):
            k = j if is_forward else count - 1 - j
            x1, u1, more, _ = flow_on(m, 1 + k, factors(m, 1 + k, integrals[k, i]), x1, u1)
            log += more
        x[i], u[i], more, after = flow_on(m, 0, half, x1, u1)
        log_norm[i] += log + more
        crossed += before + after
    return crossed
