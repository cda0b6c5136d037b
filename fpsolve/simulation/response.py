"""The stationary response of a system with cubic terms by simulation: histograms and means."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from threading import Event
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import canvas_of, draw_line, draw_plane, finish
from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message
from fpsolve.model.confinement import amplitude_frame, no_response
from fpsolve.model.plane import Jump, LinearMotion
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import IMPACT_RATE, OSCILLATOR_RESPONSE, ResponseQuantities
from fpsolve.simulation.batches import STEP_SECONDS, advance_all, standard_error
from fpsolve.simulation.bounces import CubicMotion, advance_and_count, motion_of
from fpsolve.simulation.coefficients import coefficients, starting_state
from fpsolve.simulation.setup import BATCHES, simulated_parts

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

BINS = 100
SUMS = 5
"""x, x², u² and the amplitude of the tally states, and how many they are."""
OUTSIDE = Quantity("outside", "outside", "share of the counts outside of the cells")
_MARGIN = 1.5
"""Range of the histograms over the largest amplitude after the transient; what lies outside is tally apart."""
PHASES = 64
"""Over which the damping is averaged."""
LEAST_DAMPING = 0.01
"""The least damping with which paths start, over the largest one at a phase."""
_LOOKS = 8
"""How often in a half-turn π/ω the state is tally."""


@dataclass(frozen=True, eq=False, repr=False)
class Response(Result):
    """Stationary response to the noise.

    Attributes:
        means: stationary means and their standard errors: the variable of the wall, if there is one, the squares of x
            and v, the first and the second variable, the amplitude A = √(x² + v²/s²), s the system's `aspect`, and of
            the oscillator the energy ½v² + ½ω²x².
        x_edges, v_edges, density: joint density of x and v on a grid of cells, shapes (n + 1,), (m + 1,) and (n, m).
        amplitude_edges, amplitude_density, amplitude_error: density of A on cells, and its standard error.
        outside: the share of the counts that lies outside the histograms.
        impact_rate: impacts in unit time; None without a wall.
        time: over which the paths were averaged.
        interrupted: whether the simulation was stopped early.
        parameters: of the problem, by keys such as "noise.D0".
        about: what the variables and means are called.
    """

    means: dict[str, tuple[float, float]]
    x_edges: FloatArray
    v_edges: FloatArray
    density: FloatArray
    amplitude_edges: FloatArray
    amplitude_density: FloatArray
    amplitude_error: FloatArray
    outside: float
    impact_rate: float | None
    time: float
    interrupted: bool = False
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    about: ResponseQuantities = OSCILLATOR_RESPONSE

    @property
    def reach(self) -> float:
        """The amplitude below which nearly all is, up to which pictures go."""
        share = np.cumsum(self.amplitude_density * np.diff(self.amplitude_edges))
        return float(self.amplitude_edges[1:][np.searchsorted(share, 0.9995 * share[-1])])

    def to_xarray(self) -> xarray.Dataset:
        """The densities over the middles of their cells, and the means."""
        kind, about = "standard error", self.about
        numbers: dict[Quantity, ArrayLike] = {
            about.density: self.density,
            about.amplitude_density: self.amplitude_density,
            about.amplitude_density.error(kind): self.amplitude_error,
        }
        for name, (value, deviation) in self.means.items():
            mean = about.means[name]
            numbers |= {mean: value, mean.error(kind): deviation}
        if self.impact_rate is not None:
            numbers[replace(IMPACT_RATE, latex="", equation="")] = self.impact_rate
        numbers[OUTSIDE] = self.outside
        coordinates: dict[Quantity, FloatArray] = {}
        sides = (about.first, self.x_edges), (about.second, self.v_edges), (about.amplitude, self.amplitude_edges)
        for side, edges in sides:
            name, words = f"{side.name}_edges", f"edges of the cells of {side.name}"
            ends = Quantity(name, name, words, unit=side.unit, dims=(name,))
            coordinates |= {side: (edges[1:] + edges[:-1]) / 2, ends: edges}
        more = {"time": self.time, "interrupted": int(self.interrupted)}
        return dataset("stationary response", "Monte Carlo", numbers, coordinates, self.parameters, **more)

    def _table(self) -> xarray.Dataset:
        """The density of the amplitude: beside that of (x, v) it would be repeated for every cell."""
        return self.to_xarray()[["amplitude_density", "amplitude_density_error"]]

    def plot_amplitude(self, ax: Axes | None = None, **line_kwargs: object) -> Axes:
        """Draw the density of the amplitude in a band of two standard errors, into `ax` or a new figure."""
        found = self.to_xarray()
        style = {"marker": "", "label": f"{found.attrs['method']}\n± 2 standard errors", **line_kwargs}
        with canvas_of(ax) as axes:
            draw_line(axes, found.amplitude_density, 2 * found.amplitude_density_error, **style)
            finish(axes, **style)
            axes.set(xlim=(0, self.reach), ylim=(0, 1.15 * axes.get_ylim()[1]))  # with room for the legend
            if ax is None:
                axes.set_title(found.attrs["title"], parse_math=False)
        return axes

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        most = self.density.max()
        ends = {"vmin": max(self.density[self.density > 0].min(), most * 1e-4), "vmax": most}
        draw_plane(axes, found.density.where(found.density > 0), **({"norm": "log", **ends} | kwargs))
        scale = self.reach / self.amplitude_edges[-1]
        axes.set(xlim=scale * self.x_edges[[0, -1]], ylim=scale * self.v_edges[[0, -1]])

    def _said(self) -> str:
        mean, error = self.means["amplitude"]
        return f"mean amplitude {mean:.6g} ± {error:.0e}, {self.density.size} cells"


class _Batch:
    """Paths of the nonlinear system, and what has been tally of them."""

    def __init__(
        self, motion: CubicMotion, step: float, steps: int, state: tuple[FloatArray, ...], rng: np.random.Generator
    ) -> None:
        self.motion, self.step, self.steps, self.rng = motion, step, steps, rng
        self.y, _ = state
        self.tally, self.reach = np.zeros(2), 0.0
        self.state = *state, *np.zeros((2, self.y.shape[1])), self.tally
        self.plane, self.radial = np.zeros((BINS, 2 * BINS)), np.zeros(BINS)
        self.sums = np.zeros(SUMS)

    def advance(self, looks: int, stop: Event) -> None:
        """Go on for some looks; with reach > 0 count the states up to this amplitude."""
        if not stop.is_set():
            advance_and_count(
                self.motion, self.step, *self.state, self.steps, looks, self.reach, self.plane, self.radial, self.sums,
                self.rng,
            )  # fmt: skip


def simulated_response(
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
    """Simulate a system with cubic terms, as of an oscillator with c₂ or c₃ > 0, until it is stationary, and then on.

    Args:
        problem: the system and its noise.
        exponent, variance_rate: λ > 0 and Λ″(0) of the linear system. ln A forgets its start in 1/λ, or, where it
            wanders more than it drifts, in 2Λ″(0)/λ².
        paths, time, step, seed: as for `simulate`; the time is at least 20 times that.
        progress: called 200 times in all.

    Raises:
        FpsolveError: as `simulate`, or there is no such response, or none that is simulated.
        KeyboardInterrupt: before the response was stationary.
    """
    system, noise = simulated_parts(problem)
    if reason := no_simulation(problem):
        raise FpsolveError(reason)
    [load] = coefficients(system, noise).loads
    motion, first = motion_of(system, noise.step(step), load.rows)
    rate = system.angular_frequency() or float(np.linalg.norm(system.matrix_at(0.0))) or 1.0
    steps = max(1, round(math.pi / (rate * step * _LOOKS)))
    between = steps * step
    memory = max(1 / exponent, 2 * variance_rate / exponent**2)
    burn_in, looks = math.ceil(5 * memory / between), math.ceil(max(time, 20 * memory) / between)
    size = math.ceil(paths / BATCHES)
    amplitude = math.sqrt(exponent / _damping(system))
    rngs = [np.random.default_rng(each) for each in np.random.SeedSequence(seed, spawn_key=(1,)).spawn(BATCHES)]
    batches = [_Batch(motion, step, steps, starting_state(noise, size, rng, 2, amplitude), rng) for rng in rngs]
    seconds = STEP_SECONDS * size * steps
    advances = [batch.advance for batch in batches]
    if advance_all(advances, burn_in, seconds, progress):
        raise KeyboardInterrupt
    reach = _MARGIN * max(float(np.max(np.hypot(*batch.y))) for batch in batches)
    for batch in batches:
        batch.tally[:], batch.reach = 0, reach
    interrupted = advance_all(advances, looks, seconds, progress)
    count = np.array([batch.sums[-1] for batch in batches])
    if count.min() == 0:
        raise KeyboardInterrupt
    duration = float(count.mean() / size * between)
    sums = (np.array([batch.sums[:-1] for batch in batches]) / count[:, None]).T
    radial = np.array([batch.radial for batch in batches]) / count[:, None] / (reach / BINS)
    cells = sum(batch.plane for batch in batches) / count.sum() / (reach / BINS) ** 2
    x_edges, v_edges, density = _in_variables(system, first, reach, cells)
    impacts = sum(batch.tally[0] for batch in batches) / (size * len(batches) * duration)
    return Response(
        means={name: (float(each.mean()), standard_error(each)) for name, each in _means(system, first, sums).items()},
        x_edges=x_edges,
        v_edges=v_edges,
        density=density,
        amplitude_edges=np.linspace(0, reach, BINS + 1),
        amplitude_density=radial.mean(axis=0),
        amplitude_error=np.std(radial, axis=0, ddof=1) / math.sqrt(len(batches)),
        outside=1 - float(sum(batch.radial.sum() for batch in batches) / count.sum()),
        impact_rate=impacts if system.jumps else None,
        time=duration,
        interrupted=interrupted,
        parameters=dict(problem.values),
        about=system.response,
    )


def no_simulation(problem: Problem) -> Message | None:
    """Why the response of a problem is not simulated, or there is none."""
    reason = no_response(problem)
    if reason is None and any(not _is_wall(problem.linear, jump) for jump in problem.linear.jumps):
        reason = Message(Code.RESPONSE_WALLS)
    return reason


def _is_wall(system: LinearMotion, jump: Jump) -> bool:
    """Whether a variable is 0 where a jump is, whose rate there grows with the other one."""
    matrix = system.matrix_at(0.0)
    at = np.array([math.cos(jump.phase), math.sin(jump.phase)])
    k = int(np.argmin(np.abs(at)))
    return abs(at[k]) < 1e-12 and matrix[k, 1 - k] > 0


def _damping(system: LinearMotion) -> float:
    """κ of the averaged equation (ln A)˙ = λ − κA² of a uniform phase; at least a share of the largest damping."""
    assert system.cubic is not None
    rates = amplitude_frame(system).cubic(system.cubic).q(2 * math.pi * np.arange(PHASES) / PHASES)
    return max(-float(rates.mean()), LEAST_DAMPING * float(np.max(np.abs(rates))))


def _means(system: LinearMotion, first: int, sums: FloatArray) -> dict[str, FloatArray]:
    """The means by their names, for each batch."""
    about, scales = system.response, (1.0, system.aspect)
    x, xx, uu, amplitude = sums
    names = [f"{each.name}_squared" for each in (about.first, about.second)]
    squares = {name: s**2 * each for name, s, each in zip(names, scales, ((xx, uu), (uu, xx))[first], strict=True)}
    of_wall = {(about.first, about.second)[first].name: scales[first] * x} if system.jumps else {}
    energy = {"energy": system.aspect**2 * (xx + uu) / 2} if "energy" in about.means else {}
    return {**of_wall, **squares, "amplitude": amplitude, **energy}


def _in_variables(
    system: LinearMotion, first: int, reach: float, cells: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The edges of the variables, and their density, from that of x ≥ 0 and u; without a wall both sides have half."""
    sides = [np.linspace(0, reach, BINS + 1), np.linspace(-reach, reach, 2 * BINS + 1)]
    if not system.jumps:
        sides, cells = [sides[1]] * 2, np.concatenate([cells[::-1, ::-1], cells]) / 2
    x, v = sides[first], sides[1 - first]
    return x, system.aspect * v, (cells.T if first else cells) / system.aspect
