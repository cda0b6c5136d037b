# mypy: allow-untyped-defs, allow-untyped-calls
"""What moves paths, compiled: each noise with its share of A₀ by itself, in turn, between what happens to a path.

Under a diffusion A(ξ) = A₀ + ξ A₁. A step of length h knows the mean m of ξ and, from its ends, the slope 2r/h of a
line with that mean. The flow of this line is exp Ω to the order 4 (W. Magnus, Comm. Pure Appl. Math. 7, 1954),

    Ω = h A₀ + a A₁ + b [A₀, A₁] + c [A₁, [A₁, A₀]],   a = h m,   b = −h² r/6,   c = 3b²/(5h).

Under white noise a = ΔW and b = ∫(W − ½ΔW) dt are those of the path itself, A₁ with the factor s, and for these c has
the mean 3b²/(5h) + h²/30 (J. Foster, T. Lyons and H. Oberhauser, SIAM J. Numer. Anal. 58, 2020), whose second part
stands in A₀: a scheme of strong order 3/2 and weak order 2.

Under a chain the motion between two jumps of ξ is exp(A t), and these come after exponential times: nothing is left
out. So it is between impulses, each of which multiplies the state: they are a chain whose state is the last one's size.

Of K noises each moves the state with A₀/K, in their order or in the opposite one, each as likely (S. Ninomiya and
N. Victoir, Appl. Math. Finance 15, 2008): of weak order 2, whatever the noises are.

With delays the variables at past times stand below those of now, as variables that do not change in a step. They are
those at its beginning or those at its end, each as likely, and the same for all: the means of their products are those
of the trapezoidal rule.

State: y of shape (variables, paths), with delays with those a step ago below those of now, and so on; that of the
noises, ξ or the number of a state, of noise with more numbers a row for each, ξ being the first, shape (rows, paths).
Both are changed in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.extending import overload

from fpsolve.arrays import FloatArray
from fpsolve.simulation.compiled import compiled, inlined
from fpsolve.simulation.flows import crossed, flow, load, multiplied, step_driven, store, tamed
from fpsolve.simulation.stops import flow_to_floor, step_to_floor
from fpsolve.simulation.walls import Floor, Rays


def _draw(step, xi, xi_mean, xi_end, push, rng):
    """`draw` of the class of a step; this is what numba replaces by it."""
    raise NotImplementedError


@overload(_draw)
def _drawn_by_its_kind(step, xi, xi_mean, xi_end, push, rng):
    return step.instance_class.draw


@compiled
def draw(step, xi, xi_mean, xi_end, push, rng):
    """The mean and the end of the noise in one step that begins at `xi`, see `Noise.step`."""
    _draw(step, xi, xi_mean, xi_end, push, rng)


def _first_row(state):
    """ξ of the state of a noise; this is what numba replaces."""
    raise NotImplementedError


@overload(_first_row)
def _first_row_by_shape(state):
    return (lambda state: state) if state.ndim == 1 else (lambda state: state[0])


@compiled
def drawn(step, state, xi_mean, xi_rise, push, rng):
    """Move the state of a noise by one step, in which ξ is about mean + rise (2t/h − 1)."""
    draw(step, state, xi_mean, xi_rise, push, rng)
    xi = _first_row(state)
    for i in range(xi.size):
        xi[i], xi_rise[i] = xi_rise[i], 0.5 * (xi_rise[i] - xi[i])


@inlined
def _picked(reached, rng):
    """A random number of a law, whose chances up to each are given."""
    mark, k = rng.random(), 0
    while reached[k] < mark:
        k += 1
    return k


class Driven(NamedTuple):
    """A diffusion or white noise: A₀, A₁, [A₀, A₁] and [A₁, [A₁, A₀]], shape (4, n, n), and the step of the noise.

    `rows` are those of its state among those of all noises, a number where it is one.
    """

    matrices: FloatArray
    wall: Rays | Floor
    step: object
    rows: int | slice

    @staticmethod
    def move(m, h, y, xi, log_norm, push, tally, rng):
        """One step of length h, in place.

        Args:
            m: this.
            y, xi: the state of the paths, and that of all noises.
            log_norm: takes in what the norm has grown by beyond that of the state.
            push: takes in ∫f(ξ) dt, see `draw`.
            tally: takes in how often lines were crossed; at a `Floor` fast impacts and the time at rest of all.
            rng: a `numpy.random.Generator`.
        """
        mean, rise = np.empty(y.shape[1]), np.empty(y.shape[1])
        drawn(m.step, xi[m.rows], mean, rise, push, rng)
        _step(m.matrices, m.wall, h, y, mean, rise, log_norm, tally, rng)


class Switched(NamedTuple):
    """A chain or impulses: A of each state, exp(A h), what multiplies y on arrival, and ‖A‖, one for each state."""

    matrices: FloatArray
    whole: FloatArray
    arrivals: FloatArray
    sizes: FloatArray
    wall: Rays | Floor
    step: object
    rows: int | slice

    @staticmethod
    def move(m, h, y, xi, log_norm, push, tally, rng):
        """One step, of the length h of `whole`, as that of a `Driven`, with the number of a state in place of ξ."""
        states, chain, n = xi[m.rows], m.step, y.shape[0]
        state, other, start = np.empty(n), np.empty(n), np.empty(n)
        for i in range(y.shape[1]):
            k, left = int(states[i]), h
            load(y, i, state)
            while left > 0:
                stay = rng.standard_exponential() / chain.leaving[k]
                log_norm[i] += _flow(m.wall, m, k, min(stay, left), h, state, tally, other, start)
                left -= stay
                if left > 0:
                    k = _picked(chain.reached[k], rng)
                    multiplied(m.arrivals[k], state, other)
            log_norm[i] += tamed(state)
            store(y, i, state)
            states[i] = k


def _step(matrices, wall, h, y, mean, rise, log_norm, tally, rng):
    """One step under a line of ξ; this is what numba replaces by what the wall needs."""
    raise NotImplementedError


@overload(_step)
def _step_by_wall(matrices, wall, h, y, mean, rise, log_norm, tally, rng):
    return (step_to_floor if wall.instance_class is Floor else step_driven).py_func


def _flow(wall, m, k, t, h, state, tally, other, start):
    """The motion in a state of a chain; this is what numba replaces by what the wall needs."""
    raise NotImplementedError


@overload(_flow)
def _flow_by_wall(wall, m, k, t, h, state, tally, other, start):
    if wall.instance_class is Floor:
        return lambda wall, m, k, t, h, state, tally, other, start: flow_to_floor(
            wall, m.matrices[k], t, m.sizes[k], state, tally
        )

    def over_rays(wall, m, k, t, h, state, tally, other, start):
        if t < h or m.sizes[k] * h > 1:
            return flow(wall, m.matrices[k], t, m.sizes[k], state, tally, other, start)
        for r in range(state.size):
            start[r] = state[r]
        multiplied(m.whole[k], state, other)
        return crossed(wall, start, state, tally)

    return over_rays


class InTurn(NamedTuple):
    """The motions by all noises, as a tuple, of `size` variables now, and the row of each past value below them."""

    motions: object
    size: int
    rows: FloatArray

    @staticmethod
    def move(m, h, y, xi, log_norm, push, tally, rng):
        """One step as that of a `Driven`, of paths that take the noises in one order."""
        n, paths, past = m.size, y.shape[1], m.rows.size
        state = np.empty((n + past, paths))
        for r in range(n):
            for i in range(paths):
                state[r, i] = y[r, i]
        for i in range(paths if past else 0):
            later = n if rng.random() < 0.5 else 0  # rows by which values at the end of the step are nearer
            for c in range(past):
                state[n + c, i] = y[m.rows[c] - later, i]
        is_forward = len(m.motions) == 1 or rng.random() < 0.5
        _move_all(m.motions, is_forward, h, state, xi, log_norm, push, tally, rng)
        for r in range(y.shape[0] - 1, -1, -1):
            for i in range(paths):
                y[r, i] = state[r, i] if r < n else y[r - n, i]


def move(m, h, y, xi, log_norm, push, tally, rng):
    """One step of any motion, see `Driven`; this is what numba replaces by `move` of its class."""
    raise NotImplementedError


@overload(move)
def _moved_by_its_kind(m, h, y, xi, log_norm, push, tally, rng):
    return m.instance_class.move


def _move_all(motions, is_forward, h, y, xi, log_norm, push, tally, rng):
    """Motions in one order or in the other; this is what numba replaces, as each is of a type of its own."""
    raise NotImplementedError


@overload(_move_all)
def _moved_one_by_one(motions, is_forward, h, y, xi, log_norm, push, tally, rng):
    if len(motions.types) == 0:
        return lambda motions, is_forward, h, y, xi, log_norm, push, tally, rng: None

    def one_and_the_rest(motions, is_forward, h, y, xi, log_norm, push, tally, rng):
        if is_forward:
            move(motions[0], h, y, xi, log_norm, push, tally, rng)
        _move_all(motions[1:], is_forward, h, y, xi, log_norm, push, tally, rng)
        if not is_forward:
            move(motions[0], h, y, xi, log_norm, push, tally, rng)

    return one_and_the_rest
