"""Batches of simulated paths, and the sums over them from which Λ(p) and λ are estimated."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.random import SeedSequence, default_rng

from fpsolve.kernels import RENORMALISED, advance, advance_population, advance_windows
from fpsolve.noise import AnyNoise, FloatArray, has_algebraic_tails
from fpsolve.simulation import Motion, NoiseStep, noise_step, stationary_noise

TICKS = 100
"""How many times `advance_all` reports progress."""
_PORTION_SECONDS, _STEP_SECONDS = 0.1, 2e-8
_EXPONENT = 0.5
"""Between two looks at the weights of a population, p times the growth that the noise brings about typically."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What all batches of a simulation share.

    Attributes:
        noise: the process.
        motion, noise_step, step: the motion, one step of the noise, and its length.
        p: orders of the moments, shape (n,).
        paths: in one batch.
        slice_steps: steps in one slice, the unit in which batches are advanced: one transient.
        settling: slices before the estimate begins.
        levels: the direct estimator has windows of 2⁰ … 2^(levels − 1) slices.
    """

    noise: AnyNoise
    motion: Motion
    noise_step: NoiseStep
    step: float
    p: FloatArray
    paths: int
    slice_steps: int
    settling: int
    levels: int

    @property
    def length(self) -> float:
        """The time of one slice."""
        return self.slice_steps * self.step

    @property
    def slice_seconds(self) -> float:
        """How long a batch computes for one slice, about."""
        return _STEP_SECONDS * self.paths * self.slice_steps


class _Paths:
    """Paths of a batch; in its first slices, numbered from −`settling`, they reach the law that they shall have.

    Attributes:
        slices: how many are done after those.
        impacts: how many bounces there were.
    """

    def __init__(self, plan: Plan, seed: SeedSequence) -> None:
        self.plan, self.rng = plan, default_rng(seed)
        phase = self.rng.uniform(0, math.pi, plan.paths)
        self.x, self.u = np.sin(phase), np.cos(phase)
        self.xi = stationary_noise(plan.noise, plan.paths, self.rng)
        self.log_norm, self.push = np.zeros((2, plan.paths))
        self.slices, self.impacts = -plan.settling, 0

    @property
    def state(self) -> tuple[FloatArray, ...]:
        return self.x, self.u, self.xi, self.log_norm, self.push

    def advance(self, slices: int) -> None:
        """Go on by so many slices."""
        first = min(slices, max(-self.slices, 0))
        for _ in range(first):
            self._settle()
            self.slices += 1
        if slices > first:
            self._run(slices - first)
            self.slices += slices - first

    def _settle(self) -> None:
        """One slice before the estimate begins."""
        raise NotImplementedError

    def _run(self, slices: int) -> None:
        """Slices of the estimate."""
        raise NotImplementedError


class PlainBatch(_Paths):
    """Paths without weights: the growth of ln‖x‖, and the sums of ‖x‖^p over windows of 2ʲ slices.

    Attributes:
        log_sums, log_squares: ln Σ w and ln Σ w² over paths and windows, w = ‖x(end)‖^p/‖x(start)‖^p, of shape
            (levels, p).
    """

    def __init__(self, plan: Plan, seed: SeedSequence) -> None:
        super().__init__(plan, seed)
        self.starts = np.zeros((plan.levels, plan.paths))
        self.log_sums = np.full((plan.levels, plan.p.size), -math.inf)
        self.log_squares = self.log_sums.copy()

    def growth(self) -> float:
        """The mean of ln‖x‖ since the estimate began."""
        return float(np.mean(self.log_norm))

    def _settle(self) -> None:
        plan = self.plan
        advance(plan.motion, plan.noise_step, plan.step, *self.state, plan.slice_steps, RENORMALISED, self.rng)
        self.log_norm[:] = 0

    def _run(self, slices: int) -> None:
        plan = self.plan
        self.impacts += advance_windows(
            plan.motion, plan.noise_step, plan.step, *self.state, self.starts, self.slices, slices, plan.slice_steps,
            plan.p, self.log_sums, self.log_squares, self.rng,
        )  # fmt: skip


class Population(_Paths):
    """Paths with the weights ‖x‖^p, drawn anew when these differ too much.

    So that they seldom do, the noise is pushed to where the moment is carried: with T₀(ξ) = exp(b ξ) the paths obey
    dξ = (f(ξ) + σ² b) dt + σ dW, and the weights are ‖x‖^p exp(∫(L_ξ T₀)/T₀ dt), L_ξ T₀/T₀ = b f(ξ) + ½σ² b², which
    gives the same Λ(p) for every b (Girsanov). b is the slope of ln T in the mean, −⟨f⟩/σ², sought while settling.

    Attributes:
        expected: growth of ln Z in a slice, about.
        tallies: over slices, the sums of 1, d, d², d × the d before, d × the number of the slice, and the effective
            paths among those of a slice ago, d being the growth of ln Z beyond `expected`; the first and the last d.
    """

    def __init__(self, plan: Plan, seed: SeedSequence, p: float) -> None:
        super().__init__(plan, seed)
        self.p, self.tilt, self.expected = p, 0.0, 0.0
        self.tallies = np.zeros(8)
        self._log_weights, self._ancestors = np.zeros(plan.paths), np.arange(plan.paths)
        self._log_z = np.zeros(2)  # of the weights that have been reset, and of all at the last slice
        exponent = abs(p) * plan.motion.strength * plan.noise.standard_deviation * plan.step
        self._interval = max(1, min(plan.slice_steps // 16, int(_EXPONENT / max(exponent, 1e-300))))

    def _settle(self) -> None:
        before = self._log_z[1]
        self._run(1)
        self.expected = self._log_z[1] - before
        self.tallies[:] = 0
        if self.slices < -2:
            self.tilt = self._slope()

    def _run(self, slices: int) -> None:
        plan = self.plan
        bonus = 0.5 * (plan.noise.diffusion * self.tilt) ** 2 * plan.step
        expected = self.expected if self.slices >= 0 else 0.0
        self.impacts += advance_population(
            plan.motion, noise_step(plan.noise, plan.step, self.tilt), plan.step, *self.state, self._log_weights,
            self._ancestors, (self.p, self.tilt, bonus), plan.slice_steps, self._interval, slices, self._log_z,
            expected, self.tallies, self.rng,
        )  # fmt: skip

    def _slope(self) -> float:
        """−⟨f⟩/σ²; 0 for algebraic tails, where exp(b ξ) has no mean."""
        if self.p == 0 or has_algebraic_tails(self.plan.noise):
            return 0.0
        weights = np.exp(self._log_weights - self._log_weights.max())
        return -float(np.average(self.plan.noise.drift(self.xi), weights=weights)) / self.plan.noise.diffusion**2


class Batch(Protocol):
    """Something that can be advanced by so many units."""

    def advance(self, count: int, /) -> None: ...


def _pool() -> ThreadPoolExecutor:
    """One thread for each processor that this process may use; compiled code runs in them side by side."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return ThreadPoolExecutor(count)


def advance_all(batches: Sequence[Batch], wanted: int, seconds: float, tick: Callable[[], None]) -> bool:
    """Advance batches side by side by the wanted number of units, each of which takes some `seconds`.

    `tick` is called 100 times in all. An interrupt ends this early, with all batches equally far; returns whether it
    did.
    """
    portion = max(1, min(math.ceil(wanted / TICKS), round(_PORTION_SECONDS / seconds)))
    with _pool() as pool:
        for done in range(0, wanted, portion):
            count = min(portion, wanted - done)
            futures: list[Future[None]] = []
            try:
                for batch in batches:
                    futures.append(pool.submit(batch.advance, count))
                wait(futures)
                for _ in range(TICKS * (done + count) // wanted - TICKS * done // wanted):
                    tick()
            except KeyboardInterrupt:
                futures += [pool.submit(batch.advance, count) for batch in batches[len(futures) :]]
                wait(futures)
                return True
            for future in futures:
                future.result()
    return False


def standard_error(values: FloatArray) -> float:
    """Of the mean of independent values, one from each batch."""
    return float(np.std(values, ddof=1) / math.sqrt(values.size))
