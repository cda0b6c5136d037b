"""Batches of simulated paths, and the sums over them from which Λ(p) and λ are estimated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from threading import Event

import numpy as np
from numpy.random import SeedSequence, default_rng

from fpsolve.arrays import FloatArray
from fpsolve.pool import processors
from fpsolve.simulation.coefficients import Coefficients, starting_state
from fpsolve.simulation.kernels import RENORMALISED, add_windows, advance, advance_population, close_slice
from fpsolve.simulation.motions import InTurn
from fpsolve.simulation.setup import PROGRESS_STEPS, Estimator

_PORTION_SECONDS = 0.1
STEP_SECONDS = 2e-8
"""For one step of one path, about."""
_EXPONENT = 0.5
"""Between two looks at the weights of a population, p times the growth that the noise brings about typically."""
Advance = Callable[[int, Event], None]
"""Goes on by so many units, or fewer if told to stop."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What all batches of a simulation share.

    Attributes:
        known: the matrices of the problem, and its noise.
        motion, step: what moves the paths, and the length of one step.
        p: orders of the moments, shape (n,).
        paths: in one batch.
        slice_steps: steps in one slice, the unit in which batches are advanced: one transient, of populations beyond
            the plane without the time in which modes share the motion.
        burn_in: slices before the estimate begins.
        wanted: slices for the estimate.
        levels: the direct estimator has windows of 2⁰ … 2^(levels − 1) slices.
    """

    known: Coefficients
    motion: InTurn
    step: float
    p: FloatArray
    estimator: Estimator
    paths: int
    slice_steps: int
    burn_in: int
    wanted: int
    levels: int

    @property
    def length(self) -> float:
        """The time of one slice."""
        return self.slice_steps * self.step

    @property
    def rougher(self) -> Plan:
        """The same in rough steps."""
        known, count = self.known, self.known.together
        h = count * self.step
        steps = self.slice_steps // count
        return replace(self, motion=known.motion(h), step=h, slice_steps=steps)

    @property
    def slice_seconds(self) -> float:
        """How long a batch computes for one slice, about."""
        return STEP_SECONDS * self.paths * self.slice_steps

    @property
    def pieces(self) -> list[int]:
        """The steps of a slice in pieces, between which a batch looks whether it shall stop."""
        count = min(self.slice_steps, math.ceil(self.slice_seconds / _PORTION_SECONDS))
        size, longer = divmod(self.slice_steps, count)
        return [size + 1] * longer + [size] * (count - longer)


class _Paths:
    """Paths of a batch; in its first slices, numbered from −`burn_in`, they reach the law that they shall have.

    Attributes:
        slices: how many are done after those.
        tally: how many bounces there were after those; at a wall of several variables see `Floor`.
    """

    def __init__(self, plan: Plan, seed: SeedSequence) -> None:
        self.plan, self.rng = plan, default_rng(seed)
        self.y, self.xi = starting_state(plan.known.noise, plan.paths, self.rng, plan.known.size(plan.step))
        self.log_norm, self.tally = np.zeros(plan.paths), np.zeros(2)
        self.state = self.y, self.xi, self.log_norm, np.zeros(plan.paths), self.tally
        self.slices = -plan.burn_in

    def advance(self, slices: int, stop: Event) -> None:
        """Go on by so many slices, or fewer if told to stop; one that was begun then does not count."""
        pieces = self.plan.pieces
        for _ in range(slices):
            for steps in pieces:
                if stop.is_set():
                    return
                self._move(steps)
            self._close()
            self.slices += 1

    def _move(self, steps: int) -> None:
        """Some steps of a slice."""
        raise NotImplementedError

    def _close(self) -> None:
        """What is done at the end of a slice."""
        raise NotImplementedError


class PlainBatch(_Paths):
    """Paths without weights: the growth of ln‖x‖, and the sums of ‖x‖^p over windows of 2ʲ slices.

    Attributes:
        log_sums, log_squares: ln Σ w and ln Σ w² over paths and windows, w = ‖x(end)‖^p/‖x(start)‖^p, of shape
            (levels, p).
        growth, variance: mean and variance of ln‖x‖ over the paths at the end of the last slice.
    """

    def __init__(self, plan: Plan, seed: SeedSequence) -> None:
        super().__init__(plan, seed)
        self.starts = np.zeros((plan.levels, plan.paths))
        self.log_sums = np.full((plan.levels, plan.p.size), -math.inf)
        self.log_squares = self.log_sums.copy()
        self.growth = self.variance = 0.0

    def _move(self, steps: int) -> None:
        plan = self.plan
        advance(plan.motion, plan.step, *self.state, steps, RENORMALISED, self.rng)

    def _close(self) -> None:
        if self.slices < 0:
            self.log_norm[:] = self.tally[:] = 0
            return
        add_windows(self.log_norm, self.starts, self.slices + 1, self.plan.p, self.log_sums, self.log_squares)
        self.growth, self.variance = float(np.mean(self.log_norm)), float(np.var(self.log_norm))


class Population(_Paths):
    """Paths with the weights ‖x‖^p, drawn anew when these differ too much.

    So that they seldom do, the noise is pushed to where the moment is carried: with T₀(ξ) = exp(b ξ) the paths obey
    dξ = (f(ξ) + σ² b) dt + σ dW, and the weights are ‖x‖^p exp(∫(L_ξ T₀)/T₀ dt), L_ξ T₀/T₀ = b f(ξ) + ½σ² b², which
    gives the same Λ(p) for every b (Girsanov). b is sought in the burn-in: it is the one that belongs to the mean of ξ.

    Slow noise may carry a moment in two places, between which a population does not pass in any time: so some start
    with the b that T has where the oscillator does not turn, ln ‖x‖ growing by ε ξ, b = p ε/α₀.

    Attributes:
        bias: b, which stays 0 where exp(b ξ) has no mean, or σ depends on ξ.
        found: the growth of ln Z in each slice after the burn-in, and how many paths of its beginning carry it, shape
            (2, slices).
    """

    def __init__(self, plan: Plan, seed: SeedSequence, p: float, *, is_far: bool) -> None:
        super().__init__(plan, seed)
        self.p, self.bias, self.found = p, 0.0, np.empty((2, plan.wanted))
        self._is_biased = p != 0 and plan.known.noise.takes_bias
        if is_far and self._is_biased:
            self.bias = p * plan.known.strength * plan.known.noise.relaxation_time
        self._motion = plan.known.motion(plan.step, self.bias)
        self._log_weights, self._ancestors = np.zeros(plan.paths), np.arange(plan.paths)
        self._log_z = np.zeros(2)  # of the weights that have been reset, and of all at the last slice
        exponent = abs(p) * plan.known.spread(plan.step)
        self._interval = max(1, min(plan.slice_steps // 16, int(_EXPONENT / max(exponent, 1e-300))))

    def _move(self, steps: int) -> None:
        plan = self.plan
        bonus = 0.5 * (plan.known.noise.diffusion * self.bias) ** 2 * plan.step if self._is_biased else 0.0
        advance_population(
            self._motion, plan.step, *self.state, self._log_weights, self._ancestors, (self.p, self.bias, bonus), steps,
            self._interval, self._log_z, self.rng,
        )  # fmt: skip

    def _close(self) -> None:
        found = close_slice(self._log_weights, self._ancestors, self._log_z)
        if self.slices >= 0:
            self.found[:, self.slices] = found
        if self._is_biased and 2 - self.plan.burn_in <= self.slices < -2:
            # α₀⟨ξ⟩/σ², under which Ornstein-Uhlenbeck noise has this mean
            weights = np.exp(self._log_weights - self._log_weights.max())
            self.bias = float(np.average(self.xi[0], weights=weights)) / (
                2 * self.plan.known.noise.standard_deviation**2
            )
            self._motion = self.plan.known.motion(self.plan.step, self.bias)


def advance_all(
    advances: Sequence[Advance], wanted: int, seconds: float, progress: Callable[[], None], calls: int = PROGRESS_STEPS
) -> bool:
    """Advance batches by the wanted number of units, each of which takes some `seconds`.

    Each processor has a thread, in which compiled code runs beside that in the others.

    `progress` is called so often in all. An interrupt ends this early; returns whether it did.
    """
    portion = max(1, min(math.ceil(wanted / PROGRESS_STEPS), round(_PORTION_SECONDS / seconds)))
    stop = Event()
    with ThreadPoolExecutor(processors()) as pool:
        for done in range(0, wanted, portion):
            count = min(portion, wanted - done)
            futures: list[Future[None]] = []
            try:
                for each in advances:
                    futures.append(pool.submit(each, count, stop))
                wait(futures)
                for _ in range(calls * (done + count) // wanted - calls * done // wanted):
                    progress()
            except KeyboardInterrupt:
                stop.set()
                wait(futures)
                return True
            for future in futures:
                future.result()
    return False


def standard_error(values: FloatArray) -> float:
    """Of the mean of independent values, one from each batch."""
    return float(np.std(values, ddof=1) / math.sqrt(values.size))
