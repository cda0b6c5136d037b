"""The stationary response of the nonlinear system, c₂ or c₃ > 0, by simulation: histograms and means."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import canvas_of, draw_line, draw_plane, finish
from fpsolve.errors import FpsolveError
from fpsolve.model.problem import Problem, of_problem
from fpsolve.model.quantity import IMPACT_RATE, OSCILLATOR_RESPONSE, ResponseQuantities
from fpsolve.simulation.batches import STEP_SECONDS, advance_all, standard_error
from fpsolve.simulation.bounces import advance_and_count
from fpsolve.simulation.setup import BATCHES, simulated_parts, starting_state

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

BINS = 100
MEANS = ("x", "x_squared", "v_squared", "amplitude", "energy")
OUTSIDE = Quantity("outside", "outside", "share of the counts outside of the cells")
_MARGIN = 1.5
"""Range of the histograms over the largest amplitude after the transient; what lies outside is counted apart."""
_LOOKS = 8
"""How often in a half-turn π/ω the state is counted."""


@dataclass(frozen=True, eq=False, repr=False)
class Response(Result):
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
    impact_rate: float
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
        numbers: dict[Quantity, Any] = {
            about.density: self.density,
            about.amplitude_density: self.amplitude_density,
            about.amplitude_density.error(kind): self.amplitude_error,
        }
        for name, (value, deviation) in self.means.items():
            mean = about.means[name]
            numbers |= {mean: value, mean.error(kind): deviation}
        numbers |= {replace(IMPACT_RATE, latex="", equation=""): self.impact_rate, OUTSIDE: self.outside}
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

    def plot_amplitude(self, ax: Axes | None = None, **line_kwargs: Any) -> Axes:
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

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        from matplotlib.colors import LogNorm

        most = self.density.max()
        scale = LogNorm(max(self.density[self.density > 0].min(), most * 1e-4), most)
        draw_plane(axes, found.density.where(found.density > 0), **{"norm": scale, **kwargs})
        velocity = self.reach * self.v_edges[-1] / self.x_edges[-1]
        axes.set(xlim=(0, self.reach), ylim=(-velocity, velocity))

    def _said(self) -> str:
        mean, error = self.means["amplitude"]
        return f"mean amplitude {mean:.6g} ± {error:.0e}, {self.density.size} cells"


class _Batch:
    """Paths of the nonlinear system, and what has been counted of them."""

    def __init__(
        self, laws: tuple[Any, Any, float], steps: int, state: tuple[FloatArray, ...], rng: np.random.Generator
    ) -> None:
        self.laws, self.steps, self.rng = laws, steps, rng
        self.x, self.u, self.xi = state
        self.push = np.zeros(self.x.size)
        self.plane, self.radial = np.zeros((BINS, 2 * BINS)), np.zeros(BINS)
        self.sums = np.zeros(len(MEANS))
        self.impacts, self.reach = 0, 0.0

    def advance(self, looks: int, stop: Event) -> None:
        """Go on for some looks; with reach > 0 count the states up to this amplitude."""
        if stop.is_set():
            return
        self.impacts += advance_and_count(
            *self.laws, self.x, self.u, self.xi, self.push, self.steps, looks, self.reach, self.plane, self.radial,
            self.sums, self.rng,
        )  # fmt: skip


@of_problem
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
    """Simulate the nonlinear system of Eq. (3) until it is stationary, and then for `time` at least.

    Args:
        oscillator, noise: the motion, with c₂ or c₃ > 0, and its noise; or one `Problem` of both, in their place or as
            `problem`.
        exponent, variance_rate: λ > 0 and Λ″(0) of the linear system. ln A forgets its start in 1/λ, or, where it
            wanders more than it drifts, in 2Λ″(0)/λ².
        paths, time, step, seed: as for `simulate`; the time is at least 20 times that.
        progress: called 200 times in all.

    Raises:
        FpsolveError: as `simulate`.
        KeyboardInterrupt: before the response was stationary.
    """
    oscillator: Any
    oscillator, noise = simulated_parts(problem)
    if (motion := oscillator.motion()) is None or noise.has_states:
        raise FpsolveError(
            "the nonlinear response is that of a VibroImpactOscillator under coloured noise, but this is a "
            f"{type(oscillator).__name__} under {type(noise).__name__}; simulate its moments"
        )
    steps = max(1, round(math.pi / (oscillator.omega * step * _LOOKS)))
    damping = oscillator.epsilon**2 * (oscillator.c2 + 3 * oscillator.omega**2 * oscillator.c3) / 8
    between = steps * step
    memory = max(1 / exponent, 2 * variance_rate / exponent**2)
    settling, looks = math.ceil(5 * memory / between), math.ceil(max(time, 20 * memory) / between)
    laws, size = (motion, noise.step(step), step), math.ceil(paths / BATCHES)
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
    count = np.array([batch.sums[-1] for batch in batches])
    if count.min() == 0:
        raise KeyboardInterrupt
    duration = float(count.mean() / size * between)
    x, xx, uu, mean_amplitude = (np.array([batch.sums[:-1] for batch in batches]) / count[:, None]).T
    square = oscillator.omega**2
    values = dict(zip(MEANS, (x, xx, square * uu, mean_amplitude, square * (xx + uu) / 2), strict=True))
    edges = np.linspace(0, reach, BINS + 1)
    radial = np.array([batch.radial for batch in batches]) / count[:, None] / (reach / BINS)
    cell = (reach / BINS) ** 2 * oscillator.omega
    return Response(
        means={name: (float(each.mean()), standard_error(each)) for name, each in values.items()},
        x_edges=edges,
        v_edges=oscillator.omega * np.linspace(-reach, reach, 2 * BINS + 1),
        density=sum(batch.plane for batch in batches) / count.sum() / cell,
        amplitude_edges=edges,
        amplitude_density=radial.mean(axis=0),
        amplitude_error=np.std(radial, axis=0, ddof=1) / math.sqrt(len(batches)),
        outside=1 - float(sum(batch.radial.sum() for batch in batches) / count.sum()),
        impact_rate=sum(batch.impacts for batch in batches) / (size * len(batches) * duration),
        time=duration,
        interrupted=interrupted,
        parameters=problem.values,
    )
