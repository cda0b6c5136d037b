"""The stationary response of the nonlinear oscillator, Eq. (3) with c₂ or c₃ > 0: its density, means and impacts.

Near rest ρ(a) ~ a^(−δ_p − 1) and ρ(x, ẋ) ~ a^(−δ_p − 2), δ_p < 0 the stability index of the linear system: the density
of the amplitude has a hump away from 0 for δ_p < −1, and that of (x, ẋ) a crater around rest for δ_p < −2. These are
the P-bifurcations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, is_whole, one, shown
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import canvas_of, draw_line, draw_plane, finish
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import lyapunov_exponent, stability_index
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem, of_problem
from fpsolve.model.quantity import (
    AMPLITUDE,
    AMPLITUDE_DENSITY,
    DISPLACEMENT,
    IMPACT_RATE,
    JOINT_DENSITY,
    STATIONARY_MEANS,
    VELOCITY,
)
from fpsolve.nonlinear.adapt import Search, Settled
from fpsolve.nonlinear.elimination import Solution
from fpsolve.nonlinear.operator import HALF_TURN, Flow
from fpsolve.nonlinear.rest import NearRest

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

AT_ONE_PHASE = 2.0
"""By what the error estimate of the flux at the impacts is larger: it converges like n^(−3/2) or slower in φ."""
SEEN = 1e-8
"""Of the largest density, above which its sign counts."""
MEANS = ("amplitude", "amplitude_squared", "amplitude_fourth", "x_squared", "v_squared", "energy")


@dataclass(frozen=True, eq=False, repr=False)
class StationaryResponse(Result, NearRest):
    """The stationary density over amplitude, phase and noise, x = a cos φ ≥ 0 and ẋ = −aω sin φ.

    Attributes:
        problem: what it is of.
        rtol: what was asked for.
        means: of `MEANS`, with error estimates.
        impact_rate: impacts in unit time.
        balance: E[q] + ln R times the flux of ρ at the impacts, q the growth rate of ln a: 0 but for its error.
        stability_index: δ_p of the linear system.
        unknowns: of the largest system solved.
        interval: of u = ln a − γ(φ), below which the tail of the linear system holds.
        settled: the density's coefficients, and coarser ones.
    """

    problem: Problem
    rtol: float
    means: Mapping[str, Estimate]
    impact_rate: Estimate
    balance: Estimate
    stability_index: float
    unknowns: int
    interval: tuple[float, float]
    settled: Settled = field(repr=False)

    @property
    def solution(self) -> Solution:
        """The density's coefficients."""
        return self.settled.solution

    def moment(self, n: int, m: int) -> Estimate:
        """E xⁿ ẋᵐ, x ≥ 0; its scale is E |xⁿ ẋᵐ|. Raises `ValueError` unless both are whole numbers >= 0."""
        if not (is_whole(n, 0) and is_whole(m, 0)):
            raise ValueError(f"got n = {shown(n)}, m = {shown(m)}; must be whole numbers >= 0")
        scale = abs(_moment(self.solution, n, m, np.abs))
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
        """The density of ½ẋ² + ½ω²x² at e > 0; the shape of `e`."""
        e, omega = np.asarray(e, dtype=float), self.problem.system.omega  # type: ignore[attr-defined]
        a = np.sqrt(2 * e) / omega
        return self.amplitude_density(a) / (omega**2 * a)

    def joint_density(self, x: ArrayLike, v: ArrayLike) -> FloatArray:
        """ρ(x, ẋ), 0 for x < 0, as the mass does not pass its wall; x and v broadcast."""
        omega = self.problem.system.omega  # type: ignore[attr-defined]
        x, v = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(v, dtype=float))
        square = x**2 + (v / omega) ** 2
        phi = np.clip(np.arctan2(-v / omega, np.abs(x)), *HALF_TURN)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = 0.5 * np.log(square) - self.solution.plane.flow.gauge(phi)
            found = self._at(np.maximum(u, -300.0), phi) / (omega * square)
        return np.where(x < 0, 0.0, found)

    def density(self, a: ArrayLike, phi: ArrayLike, xi: ArrayLike) -> FloatArray:
        """ρ(a, φ, ξ) on the grid of three lists, φ from −π/2 to π/2, shape (len(a), len(phi), len(xi)).

        For a noise with one state, a number, and a density.
        """
        a, phi, xi = (np.atleast_1d(np.asarray(each, dtype=float)) for each in (a, phi, xi))
        plane = self.solution.plane
        axis: Any = plane.axis
        samples = axis.at(xi / axis.unit)
        noise = samples.values * (samples.weight / samples.factor)[:, None]
        u = np.log(a)[:, None] - plane.flow.gauge(phi)
        table = self.solution.at(u.ravel()).reshape(*u.shape, *plane.shape)
        return np.asarray(np.einsum("abjk,bj,ck->abc", table, plane.circle.at(phi), noise) / a[:, None, None])

    @cached_property
    def minimum_over_maximum(self) -> float:
        """The least density of (u, φ) over the largest, at the points of a grid; negative where it is not resolved."""
        lines = self.solution.height.lines
        u, phi = np.linspace(lines[0], lines[-1], 400)[:, None], np.linspace(HALF_TURN[0], HALF_TURN[1], 80)
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
        """The densities of (x, ẋ) and of the amplitude on grids of so many points, and the means."""
        omega = self.problem.system.omega  # type: ignore[attr-defined]
        a = (np.arange(points) + 0.5) * self.reach / points
        v = (np.arange(2 * points) + 0.5 - points) * self.reach * omega / points
        numbers: dict[Quantity, Any] = {
            JOINT_DENSITY: self.joint_density(a[:, None], v),
            AMPLITUDE_DENSITY: self.amplitude_density(a),
        }
        for name, found in self.means.items():
            mean = STATIONARY_MEANS[name]
            numbers |= {mean: found.value, mean.error(): found.error_estimate}
        rate = replace(IMPACT_RATE, latex="", equation="")
        numbers |= {rate: self.impact_rate.value, rate.error(): self.impact_rate.error_estimate}
        coordinates = {DISPLACEMENT: a, VELOCITY: v, AMPLITUDE: a}
        return dataset("stationary response", "finite elements", numbers, coordinates, self.problem.values)

    def _table(self) -> xarray.Dataset:
        return self.to_xarray()[["amplitude_density"]]

    def plot_amplitude(self, ax: Axes | None = None, **line_kwargs: Any) -> Axes:
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

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        from matplotlib.colors import LogNorm

        most = float(found.density.max())
        draw_plane(axes, found.density.where(found.density > 0), **{"norm": LogNorm(most * 1e-4, most), **kwargs})

    def _said(self) -> str:
        return f"mean amplitude {self.means['amplitude']}, {self.unknowns} unknowns"


@of_problem
def stationary_response(problem: Problem, *, rtol: float = 1e-6) -> StationaryResponse:
    """Solve the Fokker-Planck equation of the vibro-impact oscillator with c₂ or c₃ > 0 and λ > 0.

    Args:
        oscillator, noise: the oscillator and its noise; or one `Problem` of both, in their place or as `problem`.
        rtol: how large the error estimate of every mean may be, relative to the mean, 1e-10 to 0.1.

    Raises:
        FpsolveError: there is no stationary response, or none that is computed; the message says why.
        NotConverged: the means do not settle within the memory.
        ValueError: rtol is out of its range.
    """
    if not 1e-10 <= rtol <= 0.1:
        raise ValueError(f"got rtol = {rtol!r}; must be from 1e-10 to 0.1")
    rate, index = _linear(problem)
    search = Search(Flow(problem), -index, rate, _numbers, rtol)
    settled, found, errors = search.settled()
    scales = np.append(np.abs(found[:-1]), rate)
    errors[-1] *= AT_ONE_PHASE
    *means, impacts, balance = map(Estimate, found.tolist(), errors.tolist(), scales.tolist())
    lines = settled.solution.height.lines
    return StationaryResponse(
        problem, rtol, dict(zip(MEANS, means, strict=True)), impacts, balance, index, search.unknowns,
        (float(lines[0]), float(lines[-1])), settled,
    )  # fmt: skip


def no_response(problem: Problem) -> Message | None:
    """Why there is no stationary response that is computed here, as far as it is known without solving."""
    if not problem.system.is_nonlinear or not hasattr(problem.system, "motion"):
        return Message(Code.RESPONSE_LINEAR)
    if len(problem.coloured.parts) > 1 or problem.diffusions or problem.impulses or problem.coloured.has_states:
        return Message(Code.RESPONSE_NOISE)
    if problem.coloured.has_algebraic_tails:
        return Message(Code.RESPONSE_TAILS)
    return None


def _linear(problem: Problem) -> tuple[float, float]:
    """λ and δ_p of the linear system. Raises `FpsolveError` where there is no stationary response."""
    if reason := no_response(problem):
        raise FpsolveError(reason)
    rate = lyapunov_exponent(problem)
    if not rate.value > rate.error_estimate:
        raise FpsolveError(Message(Code.RESPONSE_DIES, value=rate.value, error=rate.error_estimate))
    index = stability_index(problem)
    if not index:
        raise FpsolveError(Message(Code.RESPONSE_NO_INDEX, reason=index.reason))
    return rate.value, index.value


def _moment(solution: Solution, n: int, m: int, of: Callable[[FloatArray], FloatArray] = np.asarray) -> float:
    """E xⁿ ẋᵐ, or that of a function of cosⁿφ sinᵐφ in place of it."""
    plane, phi = solution.plane, solution.plane.circle.points
    omega = plane.flow.problem.system.omega  # type: ignore[attr-defined]
    return solution.mean(n + m, _scaled(solution, n + m) * of(np.cos(phi) ** n * (-omega * np.sin(phi)) ** m), one)


def _scaled(solution: Solution, n: int) -> FloatArray:
    """e^{nγ} at the points of φ."""
    return np.exp(n * solution.plane.flow.gauge(solution.plane.circle.points))


def _numbers(solution: Solution) -> FloatArray:
    """The means in the order of `MEANS`, the impacts in unit time, and E q + ln R times the flux of ρ there."""
    plane = solution.plane
    omega = plane.flow.problem.system.omega  # type: ignore[attr-defined]
    amplitudes = [solution.mean(n, _scaled(solution, n), one) for n in (1, 2, 4)]
    squares = [_moment(solution, 2, 0), _moment(solution, 0, 2)]
    energy = 0.5 * (squares[1] + omega**2 * squares[0])
    flow, phi = plane.flow, plane.circle.points
    turns = [solution.mean(0, each.h(phi), each.g) for each in flow.linear]
    impacts = math.fsum([*turns, solution.mean(2, flow.cubic.h(phi), one)]) / math.pi  # each is half a turn
    flux = omega * float(np.kron(plane.circle.seam, plane.xi_mean) @ solution.moments(0))
    return np.array([*amplitudes, *squares, energy, impacts, _growth(solution) + flow.log_factor * flux])


def _growth(solution: Solution) -> float:
    """E q, the mean growth rate of ln a between impacts."""
    flow, phi = solution.plane.flow, solution.plane.circle.points
    linear: Sequence[float] = [solution.mean(0, each.q(phi), each.g) for each in flow.linear]
    return math.fsum([*linear, solution.mean(2, flow.cubic.q(phi), one)])
