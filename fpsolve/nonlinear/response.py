"""The stationary response of a system with cubic terms, as Eq. (3) with c₂ or c₃ > 0: its density, means and impacts.

Near rest ρ(a) ~ a^(−δ_p − 1) and ρ(x₁, x₂) ~ a^(−δ_p − 2), δ_p < 0 the stability index of the linear system: the
density of the amplitude has a hump away from 0 for δ_p < −1, and that of (x₁, x₂) a crater around rest for δ_p < −2.
These are the P-bifurcations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, is_whole, one, shown
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import canvas_of, draw_line, draw_plane, finish
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget
from fpsolve.exponent.quantities import lyapunov_exponent, stability_index
from fpsolve.messages import Code, Message
from fpsolve.model.confinement import no_response
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.model.quantity import IMPACT_RATE
from fpsolve.nonlinear.adapt import Search, Settled
from fpsolve.nonlinear.elimination import Solution
from fpsolve.nonlinear.operator import Flow
from fpsolve.nonlinear.rest import NearRest

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from fpsolve.fem.noise_axes import LineAxis

AT_ONE_PHASE = 2.0
"""By what the error estimate of the flux at the impacts is larger: it converges like n^(−3/2) or slower in φ."""


@dataclass(frozen=True, eq=False, repr=False)
class StationaryResponse(Result, NearRest):
    """The stationary density over amplitude, phase and noise, x₁ = a cos φ and x₂ = −s a sin φ.

    s is the `aspect` of the system, ω for an oscillator. φ is in the half-turn before the wall, x₁ ≥ 0 for a wall at
    x₁ = 0. Without a wall (x₁, x₂) and (−x₁, −x₂) are alike, and densities of a, φ and ξ are of both.

    Attributes:
        problem: what it is of.
        rtol: what was asked for.
        means: by their names in files, with error estimates.
        impact_rate: impacts in unit time; None without a wall.
        balance: E[q] + ln R times the flux of ρ at the impacts, q the growth rate of ln a: 0 but for its error.
        stability_index: δ_p of the linear system.
        unknowns: of the largest system solved.
        interval: of ln a in the middle of the half-turn, below which the tail of the linear system holds.
        settled: the density's coefficients, and coarser ones.
    """

    problem: Problem
    rtol: float
    means: Mapping[str, Estimate]
    impact_rate: Estimate | None
    balance: Estimate
    stability_index: float
    unknowns: int
    interval: tuple[float, float]
    settled: Settled = field(repr=False)

    @property
    def solution(self) -> Solution:
        """The density's coefficients."""
        return self.settled.solution

    @property
    def flow(self) -> Flow:
        """The motion."""
        return self.solution.plane.flow

    def moment(self, n: int, m: int) -> Estimate:
        """E x₁ⁿ x₂ᵐ; its scale is E |x₁ⁿ x₂ᵐ|. Without a wall it is 0 for odd n + m.

        Raises `ValueError` unless both are whole numbers >= 0.
        """
        if not (is_whole(n, 0) and is_whole(m, 0)):
            raise ValueError(f"got n = {shown(n)}, m = {shown(m)}; must be whole numbers >= 0")
        scale = abs(_moment(self.solution, n, m, np.abs))
        if (n + m) % 2 and not self.flow.has_wall:
            return Estimate(0.0, 0.0, scale)
        found, changes = self.settled.compared(lambda solution: _moment(solution, n, m))
        return Estimate(float(found), float(self.settled.errors(changes, scale, n + m)), scale)

    def _at(self, u: FloatArray, phi: FloatArray) -> FloatArray:
        """∫ρ dξ over u and φ at some places, any common shape."""
        shape, plane = np.broadcast_shapes(u.shape, phi.shape), self.solution.plane
        u, phi = (np.ravel(np.broadcast_to(each, shape)) for each in (u, phi))
        table = self.solution.at(u, lambda values: values.reshape(-1, *plane.shape) @ plane.xi_mean)
        return np.sum(table * plane.circle.at(phi), axis=1).reshape(shape)

    def amplitude_density(self, a: ArrayLike) -> FloatArray:
        """ρ(a), a > 0, per length; the shape of `a`."""
        a = np.asarray(a, dtype=float)
        circle, flow = self.solution.plane.circle, self.solution.plane.flow
        with np.errstate(divide="ignore"):
            u = np.log(a)[..., None] - flow.gauge(circle.points)
        return np.asarray(self._at(u, circle.points) @ circle.weights / a)

    def energy_density(self, e: ArrayLike) -> FloatArray:
        """The density of ½ẋ² + ½ω²x² of an oscillator at e > 0; the shape of `e`. Raises `ValueError` for others."""
        if "energy" not in self.means:
            raise ValueError("the energy is that of a VibroImpactOscillator; take amplitude_density")
        e, omega = np.asarray(e, dtype=float), self.problem.linear.aspect
        a = np.sqrt(2 * e) / omega
        return self.amplitude_density(a) / (omega**2 * a)

    def joint_density(self, x: ArrayLike, v: ArrayLike) -> FloatArray:
        """ρ(x₁, x₂), 0 beyond a wall; x and v broadcast."""
        x, v = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(v, dtype=float) / self.problem.linear.aspect)
        first = self.flow.half_turn[0]
        turns = (np.arctan2(-v, x) - first) / math.pi
        beyond = np.where(turns == 0, 0, np.ceil(turns) - 1)  # both ends are in the half-turn
        found = self.polar_density(np.hypot(x, v), first + math.pi * (turns - beyond))
        return np.where(beyond % 2 != 0, 0.0, found) if self.flow.has_wall else found

    def polar_density(self, a: ArrayLike, phi: ArrayLike) -> FloatArray:
        """ρ(x₁, x₂) at x₁ = a cos φ and x₂ = −s a sin φ, φ in the half-turn; a and phi broadcast."""
        a, phi = np.asarray(a, dtype=float), np.asarray(phi, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self._at(np.maximum(np.log(a) - self.flow.gauge(phi), -300.0), phi)
            return np.asarray(found / ((1 if self.flow.has_wall else 2) * self.problem.linear.aspect * a**2))

    def density(self, a: ArrayLike, phi: ArrayLike, xi: ArrayLike) -> FloatArray:
        """ρ(a, φ, ξ) on the grid of three lists, φ in the half-turn, shape (len(a), len(phi), len(xi)).

        For a noise with one state, a number, and a density.
        """
        a, phi, xi = (np.atleast_1d(np.asarray(each, dtype=float)) for each in (a, phi, xi))
        plane = self.solution.plane
        axis = cast("LineAxis", plane.axis)
        samples = axis.at(xi / axis.unit)
        noise = samples.values * (samples.weight / samples.factor)[:, None]
        u = np.log(a)[:, None] - plane.flow.gauge(phi)
        table = self.solution.at(u.ravel()).reshape(*u.shape, *plane.shape)
        return np.asarray(np.einsum("abjk,bj,ck->abc", table, plane.circle.at(phi), noise) / a[:, None, None])

    @cached_property
    def minimum_over_maximum(self) -> float:
        """The least density of (u, φ) over the largest, at the points of a grid; negative where it is not resolved."""
        lines = self.solution.height.lines
        u, phi = np.linspace(lines[0], lines[-1], 400)[:, None], self.flow.phases(80)
        values = self._at(u, phi)
        return float(values.min() / values.max())

    @cached_property
    def reach(self) -> float:
        """The amplitude below which all but 5e-4 is, up to which pictures go."""
        a = np.exp(np.linspace(*self.interval, 2000))
        rho = self.amplitude_density(a)
        above = np.cumsum((rho * np.gradient(a))[::-1])[::-1]
        return float(a[np.searchsorted(-above, -5e-4)])

    def to_xarray(self, *, points: int = 100) -> xarray.Dataset:
        """The densities of both variables and of the amplitude on grids of so many points, and the means."""
        about, aspect = self.problem.linear.response, self.problem.linear.aspect
        a = (np.arange(points) + 0.5) * self.reach / points
        both = (np.arange(2 * points) + 0.5 - points) * self.reach / points
        x, v = (a if self.flow.is_positive(k) else both for k in (0, 1))
        numbers: dict[Quantity, ArrayLike] = {
            about.density: self.joint_density(x[:, None], aspect * v),
            about.amplitude_density: self.amplitude_density(a),
        }
        for name, found in self.means.items():
            mean = about.means[name]
            numbers |= {mean: found.value, mean.error(): found.error_estimate}
        if self.impact_rate is not None:
            rate = replace(IMPACT_RATE, latex="", equation="")
            numbers |= {rate: self.impact_rate.value, rate.error(): self.impact_rate.error_estimate}
        coordinates = {about.first: x, about.second: aspect * v, about.amplitude: a}
        return dataset("stationary response", "finite elements", numbers, coordinates, self.problem.values)

    def _table(self) -> xarray.Dataset:
        return self.to_xarray()[["amplitude_density"]]

    def plot_amplitude(self, ax: Axes | None = None, **line_kwargs: object) -> Axes:
        """Draw the density of the amplitude into `ax` or a new figure."""
        found = self.to_xarray(points=400)
        style = {"marker": "", "label": found.attrs["method"], **line_kwargs}
        with canvas_of(ax) as axes:
            draw_line(axes, found.amplitude_density, None, **style)
            finish(axes, **style)
            axes.set(xlim=(0, self.reach), ylim=(0, 1.15 * float(found.amplitude_density.max())))
            if ax is None:
                axes.set_title(found.attrs["title"], parse_math=False)
        return axes

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        most = float(found.density.max())
        draw_plane(
            axes,
            found.density.where(found.density > 0),
            **({"norm": "log", "vmin": most * 1e-4, "vmax": most} | kwargs),
        )

    def _said(self) -> str:
        return f"mean amplitude {self.means['amplitude']}, {self.unknowns} unknowns"


def stationary_response(problem: Problem, *, rtol: float = 1e-6, budget: Budget | None = None) -> StationaryResponse:
    """Solve the Fokker-Planck equation of a system with cubic terms, as of an oscillator with c₂ or c₃ > 0, and λ > 0.

    >>> bent = problem.at({"oscillator.c1": 0.8, "oscillator.c2": 0.5})
    >>> stationary_response(bent, rtol=1e-2)
    StationaryResponse(mean amplitude ... ± ..., ... unknowns)

    Args:
        problem: the system and its noise.
        rtol: how large the error estimate of every mean may be, relative to the mean, 1e-10 to 0.1.
        budget: what it may cost, and λ and δ_p of the linear system before it.

    Raises:
        FpsolveError: there is no stationary response, or none that is computed; the message says why.
        NotConverged: the means do not settle within the budget.
        ValueError: rtol is out of its range.
    """
    if not 1e-10 <= rtol <= 0.1:
        raise ValueError(f"got rtol = {rtol!r}; must be from 1e-10 to 0.1")
    budget = budget or Budget()
    rate, index = _linear(problem, budget)
    search = Search(Flow(problem), -index, rate, _numbers, rtol)
    with budget.meter().running():
        settled, found, errors = search.settled()
    scales = np.append(np.abs(found[:-1]), rate)
    errors[-1] *= AT_ONE_PHASE
    estimates = list(map(Estimate, found.tolist(), errors.tolist(), scales.tolist()))
    numbers = dict(zip(problem.linear.response.numbers, estimates, strict=False))
    lines = settled.solution.height.lines + search.flow.log_unit
    return StationaryResponse(
        problem, rtol, numbers, numbers.pop("impact_rate", None), estimates[-1], index, search.unknowns,
        (float(lines[0]), float(lines[-1])), settled,
    )  # fmt: skip


def _linear(problem: Problem, budget: Budget) -> tuple[float, float]:
    """λ and δ_p of the linear system. Raises `FpsolveError` where there is no stationary response."""
    if reason := no_response(checked_problem(problem)):
        raise FpsolveError(reason)
    method = choose(problem)
    if method.ray is not None:
        raise FpsolveError(Message(Code.RESPONSE_RAYS, phase=method.ray))
    if method.reason(1.0):
        raise FpsolveError(Message(Code.RESPONSE_TAILS))
    rate = lyapunov_exponent(problem, budget=budget)
    if not rate.value > rate.error_estimate:
        raise FpsolveError(Message(Code.RESPONSE_DIES, value=rate.value, error=rate.error_estimate))
    index = stability_index(problem, budget=budget)
    if not index:
        raise FpsolveError(Message(Code.RESPONSE_NO_INDEX, reason=index.reason))
    return rate.value, index.value


def _moment(solution: Solution, n: int, m: int, of: Callable[[FloatArray], FloatArray] = np.asarray) -> float:
    """E x₁ⁿ x₂ᵐ, or that of a function of cosⁿφ sinᵐφ in place of it."""
    plane, phi = solution.plane, solution.plane.circle.points
    aspect = plane.flow.problem.linear.aspect
    return solution.mean(n + m, _scaled(solution, n + m) * of(np.cos(phi) ** n * (-aspect * np.sin(phi)) ** m), one)


def _scaled(solution: Solution, n: int) -> FloatArray:
    """e^{nγ} at the points of φ."""
    return np.exp(n * solution.plane.flow.gauge(solution.plane.circle.points))


def _numbers(solution: Solution) -> FloatArray:
    """The numbers of the response in the order of their names, and E q + ln R times the flux of ρ at the wall."""
    flow, phi = solution.plane.flow, solution.plane.circle.points
    system = flow.problem.linear
    found = [solution.mean(n, _scaled(solution, n), one) for n in (1, 2, 4)]
    squares = [_moment(solution, 2, 0), _moment(solution, 0, 2)]
    found += squares
    if "energy" in system.response.means:
        found.append(0.5 * (squares[1] + system.aspect**2 * squares[0]))
    flux = 0.0
    if flow.has_wall:
        turns = [solution.mean(0, each.h(phi), each.g) for each in flow.linear]
        turn = math.fsum([*turns, solution.mean(2, flow.cubic.h(phi), one)])
        found.append(flow.sense * turn / math.pi)  # each is half a turn
        flux = solution.plane.flux(solution.moments(0))
    return np.array([*found, _growth(solution) + flow.log_factor * flux])


def _growth(solution: Solution) -> float:
    """E q, the mean growth rate of ln a between impacts."""
    flow, phi = solution.plane.flow, solution.plane.circle.points
    linear: Sequence[float] = [solution.mean(0, each.q(phi), each.g) for each in flow.linear]
    return math.fsum([*linear, solution.mean(2, flow.cubic.q(phi), one)])
