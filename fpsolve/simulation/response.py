"""The stationary response of the nonlinear system, c₂ or c₃ > 0, by simulation: histograms and means."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.problem import Problem, of_problem
from fpsolve.model.vibro_impact import VibroImpactOscillator
from fpsolve.simulation.batches import STEP_SECONDS, advance_all, standard_error
from fpsolve.simulation.kernels import advance_and_count
from fpsolve.simulation.setup import BATCHES, simulated_parts
from fpsolve.simulation.step import Motion, NoiseStep, motion, noise_step, starting_state

BINS = 100
MEANS = ("x", "x_squared", "v_squared", "amplitude", "energy")
_MARGIN = 1.5
"""Range of the histograms over the largest amplitude after the transient; what lies outside is counted apart."""
_LOOKS = 8
"""How often in a half-turn π/ω the state is counted."""


@dataclass(frozen=True, eq=False)
class Response:
    """Stationary response to the noise.

    Attributes:
        means: stationary means and their standard errors: x, x², v², the amplitude A = √(x² + v²/ω²) and the energy
            ½v² + ½ω²x², v = ẋ.
        x_edges, v_edges, density: joint density of x and v on a grid of cells, shapes (n + 1,), (m + 1,) and (n, m).
        amplitude_edges, amplitude_density, amplitude_error: density of A on cells, and its standard error.
        outside: the share of the counts that lies outside the histograms.
        impact_rate: impacts in unit time.
        time: over which the paths were averaged.
        interrupted: whether the simulation was stopped early.
    """

    means: dict[str, tuple[float, float]]
    x_edges: FloatArray
    v_edges: FloatArray
    density: FloatArray
    amplitude_edges: FloatArray
    amplitude_density: FloatArray
    amplitude_error: FloatArray
    outside: float
    impact_rate: float
    time: float
    interrupted: bool = False


class _Batch:
    """Paths of the nonlinear system, and what has been counted of them."""

    def __init__(
        self, laws: tuple[Motion, NoiseStep, float], steps: int, state: tuple[FloatArray, ...], rng: np.random.Generator
    ) -> None:
        self.laws, self.steps, self.rng = laws, steps, rng
        self.x, self.u, self.xi = state
        self.spare = np.zeros((2, self.x.size))
        self.plane, self.radial = np.zeros((BINS, 2 * BINS)), np.zeros(BINS)
        self.sums = np.zeros(len(MEANS))
        self.impacts, self.reach = 0, 0.0

    def advance(self, looks: int, stop: Event) -> None:
        """Go on for some looks; with reach > 0 count the states up to this amplitude."""
        if stop.is_set():
            return
        self.impacts += advance_and_count(
            *self.laws, self.x, self.u, self.xi, self.spare, self.steps, looks, self.reach, self.plane, self.radial,
            self.sums, self.rng,
        )  # fmt: skip


@of_problem
def stationary_response(
    problem: Problem,
    exponent: float,
    variance_rate: float,
    *,
    paths: int,
    time: float,
    step: float,
    seed: int,
    progress: Callable[[], None] = lambda: None,
) -> Response:
    """Simulate the nonlinear system of Eq. (3) until it is stationary, and then for `time` at least.

    Args:
        problem: the oscillator, with c₂ or c₃ > 0, and its noise, in one argument or two.
        exponent, variance_rate: λ > 0 and Λ″(0) of the linear system. ln A forgets its start in 1/λ, or, where it
            wanders more than it drifts, in 2Λ″(0)/λ².
        paths, time, step, seed: as for `simulate`; the time is at least 20 times that.
        progress: called 200 times in all.

    Raises:
        FpsolveError: as `simulate`.
        KeyboardInterrupt: before the response was stationary.
    """
    oscillator, noise = simulated_parts(problem)
    steps = max(1, round(math.pi / (oscillator.omega * step * _LOOKS)))
    damping = oscillator.epsilon**2 * (oscillator.c2 + 3 * oscillator.omega**2 * oscillator.c3) / 8
    between = steps * step
    memory = max(1 / exponent, 2 * variance_rate / exponent**2)
    settling, looks = math.ceil(5 * memory / between), math.ceil(max(time, 20 * memory) / between)
    laws, size = (motion(oscillator), noise_step(noise, step), step), math.ceil(paths / BATCHES)
    amplitude = math.sqrt(exponent / damping)
    rngs = [np.random.default_rng(each) for each in np.random.SeedSequence(seed, spawn_key=(1,)).spawn(BATCHES)]
    batches = [_Batch(laws, steps, starting_state(noise, size, rng, amplitude), rng) for rng in rngs]
    seconds = STEP_SECONDS * size * steps
    advances = [batch.advance for batch in batches]
    if advance_all(advances, settling, seconds, progress):
        raise KeyboardInterrupt
    reach = _MARGIN * max(float(np.max(np.hypot(batch.x, batch.u))) for batch in batches)
    for batch in batches:
        batch.impacts, batch.reach = 0, reach
    interrupted = advance_all(advances, looks, seconds, progress)
    return _collect(oscillator, batches, between, reach, interrupted)


def _collect(
    oscillator: VibroImpactOscillator, batches: list[_Batch], between: float, reach: float, interrupted: bool
) -> Response:
    count = np.array([batch.sums[-1] for batch in batches])
    if count.min() == 0:
        raise KeyboardInterrupt
    time = float(count.mean() / batches[0].x.size * between)
    paths = sum(batch.x.size for batch in batches)
    sums = np.array([batch.sums[:-1] for batch in batches]) / count[:, None]
    x, xx, uu, amplitude = sums.T
    square = oscillator.omega**2
    values = dict(zip(MEANS, (x, xx, square * uu, amplitude, square * (xx + uu) / 2), strict=True))
    edges = np.linspace(0, reach, BINS + 1)
    radial = np.array([batch.radial for batch in batches]) / count[:, None] / (reach / BINS)
    plane = sum(batch.plane for batch in batches)
    cell = (reach / BINS) ** 2 * oscillator.omega
    return Response(
        means={name: (float(each.mean()), standard_error(each)) for name, each in values.items()},
        x_edges=edges,
        v_edges=oscillator.omega * np.linspace(-reach, reach, 2 * BINS + 1),
        density=plane / count.sum() / cell,
        amplitude_edges=edges,
        amplitude_density=radial.mean(axis=0),
        amplitude_error=np.std(radial, axis=0, ddof=1) / math.sqrt(len(batches)),
        outside=1 - float(sum(batch.radial.sum() for batch in batches) / count.sum()),
        impact_rate=sum(batch.impacts for batch in batches) / (time * paths),
        time=time,
        interrupted=interrupted,
    )
