"""What the simulation takes from a system and a noise: matrices, in coordinates in which the motion is even.

What moves paths is imported where they are moved: case files are checked with these numbers, without numba.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.linalg import expm

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.model.noise import Noise
from fpsolve.model.plane import (
    System,
    affine,
    common_delay,
    is_driven,
    matrix_at,
    squared_frequency,
    written_coefficient,
)
from fpsolve.model.quantity import OF_STOPS
from fpsolve.simulation.rays import Rays

if TYPE_CHECKING:
    from fpsolve.simulation.delays import DelayedSpace
    from fpsolve.simulation.motions import DrivenMotion, SwitchedMotion
    from fpsolve.simulation.several import SplitMotion
    from fpsolve.simulation.spaces import DrivenSpace, SplitSpace, SwitchedSpace
    from fpsolve.simulation.stops import DrivenStop, SwitchedStop

FAST = 1e-3
"""Speed from which on impacts at a wall of several variables count, over the sum of all other variables."""
_FAR = 5.0
"""Standard deviations at which noise held to one side is compared with noise held to the other."""
_UNRESOLVED = 1 / 30
"""Of the coefficient of [A₁, [A₁, A₀]] under white noise, its mean for given ∫dW and ∫W dt, as a share of s²h²."""
ROUGHER = 3
"""How many steps are one of some batches, which tells the bias of a step, where that is of the order h²."""
_DELAYS = 8.0
"""Delays after which the start is forgotten, about."""
_PARALLEL = 100.0
"""The condition of the modes from which on they are no coordinates."""
_ONE_WAY = 1e-12
"""The ratio of two entries below which one of them is none but for rounding."""
_FORGOTTEN, _LONGEST = 6.0, 1000
"""Of a rate, the times that it needs; half-turns in which that of modes which hardly mix is taken to be over."""
_PARTS = 64
"""Of a period, in each of which coefficients are held."""


@dataclass(frozen=True)
class Coefficients:
    """A system as a noise moves it.

    The coordinates are those in which the order 0, where it turns, is a rotation times a growth, and else has two
    entries of one size beside its diagonal; of more than two variables it has such blocks, see `_modal_coordinates`. A
    linear map of the state leaves Λ(p) alone.

    Attributes:
        noise: which it is.
        steady: A₀, shape (n, n); under a chain A of each state, shape (states, n, n).
        driven: A₁, shape (n, n); under white noise that of dW, under a chain 0.
        strength: d ln‖x‖/dt for ξ = 1 at most; negative where it is ξ < 0 that makes more of it.
        fluctuation: the standard deviation of what the noise adds to d ln‖x‖/dt; of white noise to ln‖x‖ in a unit of
            time.
        half_turn: π/ω, ω the largest; without rotation π times the time in which the direction of x is forgotten.
        settling: the time in which it is forgotten how modes shared the motion; 0 where all turn alike.
        rays: the lines of the jumps.
        arrivals: what multiplies the state where a state of a chain is reached, or where an impulse comes, shape
            (states, n, n); None under other noise.
        of_wall: the names of what is noted at a wall of several variables.
    """

    noise: Noise
    steady: FloatArray
    driven: FloatArray
    strength: float
    fluctuation: float
    half_turn: float
    rays: Rays
    settling: float = 0.0
    arrivals: FloatArray | None = None
    of_wall: ClassVar[Sequence[str]] = ()

    @property
    def is_exact(self) -> bool:
        """Whether steps of any length leave nothing out."""
        return self.arrivals is not None

    @property
    def dimension(self) -> int:
        """n."""
        return self.steady.shape[-1]

    @property
    def together(self) -> int:
        """How many steps are a rough one; 1 where the bias of a step is of a higher order, or none."""
        return ROUGHER if self.noise.is_white and not self.is_exact else 1

    @property
    def order(self) -> int:
        """The power of h that the bias of a step falls as, where it does not fall faster."""
        return 2

    def size(self, h: float) -> int:
        """The number of variables of a path that is moved in steps of length h."""
        return self.dimension

    def motion(self, h: float) -> DrivenMotion | SwitchedMotion | DrivenSpace | SwitchedSpace:
        """The numbers that move paths by a step of length h."""
        from fpsolve.simulation.motions import DrivenMotion, SwitchedMotion
        from fpsolve.simulation.spaces import DrivenSpace, SwitchedSpace

        steady, driven, arrivals = self.steady, self.driven, self.arrivals
        if arrivals is not None:
            steady = np.broadcast_to(steady, arrivals.shape).copy()
            if self.dimension == 2:
                return SwitchedMotion(_rows(steady), arrivals, self.rays)
            return SwitchedSpace(steady, expm(h * steady), arrivals, np.linalg.norm(steady, 2, axis=(1, 2)))
        double = _commutator(driven, _commutator(driven, steady))
        if self.noise.is_white:
            steady = steady + _UNRESOLVED * h * double
        matrices = np.array([steady, driven, _commutator(steady, driven), double])
        return DrivenSpace(matrices) if self.dimension > 2 else DrivenMotion(_rows(matrices), self.rays)

    def noise_step(self, h: float, bias: float = 0.0) -> Any:
        """The step of the noise, see `Noise.step`."""
        return self.noise.step(h, bias)

    def spread(self, h: float) -> float:
        """The standard deviation of what the noise adds to ln‖x‖ in a time h that it takes no note of."""
        return self.fluctuation * (math.sqrt(h) if self.noise.is_white else h)


@dataclass(frozen=True)
class StoppedCoefficients(Coefficients):
    """A system with a `Stop`, whose coordinates these are, but for their units: q is the first, q̇ the second.

    Under white noise a path in a step comes to the wall at another time than the smooth one that is taken: `order` 1.

    Attributes:
        restitution: R.
        fast: how fast an impact must be over each of the |variables| to count, shape (n,).
    """

    restitution: float = 1.0
    fast: FloatArray = field(default_factory=lambda: np.zeros(0))

    order = 1
    of_wall = tuple(OF_STOPS)

    def motion(self, h: float) -> DrivenStop | SwitchedStop:  # type: ignore[override]
        from fpsolve.simulation.stops import DrivenStop, SwitchedStop

        if self.steady.ndim == 2:
            matrices = np.array([self.steady, self.driven])
            return DrivenStop(matrices, self.restitution, self.fast, float(self.noise.is_white))
        return SwitchedStop(self.steady, np.linalg.norm(self.steady, 2, axis=(1, 2)), self.restitution, self.fast)


@dataclass(frozen=True)
class SplitCoefficients(Coefficients):
    """A system as several noises move it; `driven` has a matrix for each, shape (noises, n, n), s with those of white.

    Attributes:
        sizes: the standard deviation of ‖A_k‖ξ_k of each; of white noise in a unit of time.
    """

    sizes: Sequence[tuple[float, bool]] = ()

    is_exact, together = False, ROUGHER

    def motion(self, h: float) -> SplitMotion | SplitSpace:  # type: ignore[override]
        from fpsolve.simulation.several import SplitMotion
        from fpsolve.simulation.spaces import SplitSpace

        if self.dimension > 2:
            return SplitSpace(self.driven, np.linalg.norm(self.driven, 2, axis=(1, 2)), expm(0.5 * h * self.steady))
        return SplitMotion(_rows(np.concatenate([self.steady[None], self.driven])), self.rays)

    def noise_step(self, h: float, bias: float = 0.0) -> Any:
        from fpsolve.simulation.several import drivers

        return drivers(self.noise.parts, h)

    def spread(self, h: float) -> float:
        return math.sqrt(sum(size**2 * (h if is_white else h**2) for size, is_white in self.sizes))


@dataclass(frozen=True)
class DelayedCoefficients(SplitCoefficients):
    """A system with delays, which has a column for each of the `pasts` of its state."""

    pasts: Sequence[tuple[int, float]] = ()

    def size(self, h: float) -> int:
        return (self.dimension - len(self.pasts)) * (1 + round(max(delay for _, delay in self.pasts) / h))

    def motion(self, h: float) -> DelayedSpace:  # type: ignore[override]
        from fpsolve.simulation.delays import DelayedSpace

        n = self.dimension - len(self.pasts)
        rows = np.array([variable + n * round(delay / h) for variable, delay in self.pasts])
        return DelayedSpace(self.steady[:n].copy(), self.driven[:, :n].copy(), rows)


def refuse(system: System, noise: Noise) -> None:
    """Refuse what no scheme moves. Raises `FpsolveError`."""
    if noise.motion(system).impulses and (system.pasts or system.stop):
        told = "simulation under impulses is for systems without a delay and a wall of more than two variables"
        raise FpsolveError(f"{told}; take an even p, which needs none")
    if system.stop and (len(noise.parts) > 1 or system.clock):
        raise FpsolveError("simulation of a wall of more than two variables is for one noise, without periodic terms")
    bent = [term.g for term in system.terms if affine(term.g) is None]
    if bent and (not noise.has_states or len(noise.parts) > 1):
        found = f"but one has g = {written_coefficient(bent[0]).strip()}"
        need = f"terms that are a + b*xi under a {type(noise).__name__}, {found}"
        raise FpsolveError(f"simulation is for {need}; use the finite elements")


def starting_state(
    noise: Noise, paths: int, rng: np.random.Generator, amplitude: float = 1.0, dimension: int = 2
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, u and the state of the noise, of paths of one amplitude, with uniform directions and stationary noise.

    The phases are in front of the wall, where they stand for all. Beyond the plane u has a row for each variable but x.
    """
    if dimension > 2:
        state = rng.standard_normal((dimension, paths))
        state *= amplitude / np.linalg.norm(state, axis=0)
        return state[0].copy(), state[1:].copy(), noise.start(paths, rng)
    phase = rng.uniform(0, math.pi, paths)
    return amplitude * np.sin(phase), amplitude * np.cos(phase), noise.start(paths, rng)


def repeated_delay(system: System) -> float:
    """The time of which all delays of a system are multiples, ∞ without any. Raises `ValueError`: there is none."""
    return common_delay(system.pasts)[0] if system.pasts else math.inf


def split_coefficients(system: System, noise: Noise) -> SplitCoefficients:
    """The matrices of a system under several noises."""
    moved = noise.motion(system).drift
    zero = np.zeros((system.dimension, system.dimension))
    steady, driven, sizes = zero.copy(), list[FloatArray](), list[tuple[float, bool]]()
    for term in moved.terms:
        if line := affine(term.g):
            steady += line[0] * system.epsilon**term.order * np.array(term.matrix)
    every = sum((np.abs(system.epsilon**term.order * np.array(term.matrix)) for term in system.terms), zero)
    if system.pasts:
        variables = [*range(len(zero) - len(system.pasts)), *(variable for variable, _ in system.pasts)]
        folded = np.eye(len(zero))[variables]
        even = np.diag(1 / _balance(folded.T @ every @ folded, 0.0)[variables])
    else:
        even = _even_coordinates(matrix_at(moved, 0.0, slice(0, 1)), every)
    back, intensity, intensities, loads = np.linalg.inv(even), 0.0, list[float](), list[tuple[FloatArray, Any]]()
    free = even @ matrix_at(moved, 0.0, slice(0, 1)) @ back
    for name, part in noise.parts.items():
        own = [term for term in system.terms if is_driven(term.g) and term.noise == name]
        total = sum(
            (line[1] * system.epsilon**term.order * np.array(term.matrix) for term in own if (line := affine(term.g))),
            zero,
        )
        size = float(np.linalg.norm(even @ total @ back, 2))
        if part.is_white:
            sizes.append((size * math.sqrt(part.spectral_density(0.0)), True))
            driven.append(total * math.sqrt(part.spectral_density(0.0)))
            intensity += sizes[-1][0] ** 2
            intensities.append(1.0)
        else:
            sizes.append((size * part.standard_deviation, False))
            driven.append(total)
            time = min(part.correlation_time, part.period or math.inf)
            intensity += 2 * sizes[-1][0] ** 2 * time
            exchanged = 0.0 if part.period else _exchanged(free, part)
            intensities.append(2 * part.standard_deviation**2 * time * exchanged)
            loads += [(even @ total @ back, part)] if part.period else []
    half_turn = math.pi / _rate(free, intensity)
    if system.pasts:
        kind: Any = partial(DelayedCoefficients, pasts=system.pasts)
        settling = _DELAYS * max(delay for _, delay in system.pasts)
    else:
        kind = SplitCoefficients
        moves = zip(intensities, even @ np.array(driven) @ back, strict=True)
        settling = _settling(free, list(moves), half_turn, loads)
    return kind(
        noise,
        even @ steady @ back,
        even @ np.array(driven) @ back,
        0.0,
        math.sqrt(intensity),
        half_turn,
        _rays(system, even, even @ steady @ back),
        settling,
        sizes=sizes,
    )


def coefficients(system: System, noise: Any) -> Coefficients:
    """The matrices of a system under a noise that can be simulated."""
    if len(noise.parts) > 1 or system.pasts:
        return split_coefficients(system, noise)
    moved, diffusions, struck = noise.motion(system)
    is_switched = noise.has_states and not noise.is_white
    driven = zero = np.zeros((system.dimension, system.dimension))
    if is_switched:
        steady = matrix_at(moved, noise.reached)
    else:
        lines = [(system.epsilon**term.order * np.array(term.matrix), affine(term.g)) for term in moved.terms]
        steady = sum((line[0] * matrix for matrix, line in lines if line), zero)
        driven = sum((line[1] * matrix for matrix, line in lines if line), zero)
        driven = sum((system.epsilon**each.order * np.array(each.matrix) for each in diffusions), driven)
    free = np.tensordot(noise.probabilities, steady, 1) if is_switched else matrix_at(moved, 0.0, slice(0, 1))
    if not free.any():
        free = steady.mean(axis=0) if is_switched else steady
    every = np.abs(steady).max(axis=0) if is_switched else np.abs(steady) + np.abs(driven)
    kind: Any = Coefficients
    if (stop := system.stop) is not None:
        rows = np.array(stop.coordinates)
        scales = _balance(np.abs(rows) @ every @ np.abs(np.linalg.inv(rows)))
        even = rows / scales[:, None]
        kind = partial(StoppedCoefficients, restitution=stop.restitution, fast=FAST * scales / scales[1])
    else:
        even = _even_coordinates(free, every)
    back = np.linalg.inv(even)
    free, steady, driven = even @ free @ back, even @ steady @ back, even @ driven @ back
    around = steady - np.tensordot(noise.probabilities, steady, 1) if is_switched else steady
    arrivals = np.broadcast_to(np.eye(len(free)), steady.shape).copy() if is_switched else None
    if struck:
        arrivals = even @ np.array([each.matrix for each in struck]) @ back
        strength = fluctuation = math.sqrt(sum(each.rate * each.strength**2 for each in struck))
    elif is_switched:
        strength = fluctuation = math.sqrt(noise.probabilities @ np.sum(around**2, axis=(1, 2)) / 2)
    else:
        deviation = 1.0 if noise.is_white else noise.standard_deviation
        strength = float(np.max(np.abs(np.linalg.eigvalsh(driven + driven.T) / 2)))
        fluctuation = strength * deviation
        up, down = (np.linalg.eigvals(steady + side * _FAR * deviation * driven).real.max() for side in (1, -1))
        strength *= -1.0 if down > up else 1.0
    time = 1.0 if noise.is_white else 2 * noise.correlation_time
    half_turn = math.pi / _rate(free, fluctuation**2 * time)
    if stop is not None and (square := -free[0, 1] * free[1, 0]) > 0:  # an impact in each half-turn is like damping
        half_turn = math.pi / math.sqrt(square)
        free[1, 1] += 2 * math.log(stop.restitution) / half_turn
    time *= _exchanged(free, noise)
    if is_switched:
        moves = [(time * share, each) for share, each in zip(noise.probabilities, around, strict=True)]
    elif struck:
        moves = [(each.rate, even @ np.array(each.exponent) @ back) for each in struck]
    else:
        moves = [(time if noise.is_white else time * noise.standard_deviation**2, driven)]
    found: Coefficients = kind(
        noise,
        steady,
        driven,
        strength,
        fluctuation,
        half_turn,
        _rays(system, even, steady),
        _settling(free, moves, half_turn),
        arrivals,
    )
    return found


def _rate(free: FloatArray, intensity: float) -> float:
    """ω where a motion turns, else the rate at which two directions come together."""
    n = len(free)
    square = float(squared_frequency(free)) if n == 2 else _fastest(free)
    if square > 0:
        return math.sqrt(square)
    shear = float(np.linalg.norm(free - np.trace(free) / n * np.eye(n), 2))
    return max(math.sqrt(-square), (shear**2 * intensity) ** (1 / 3)) or intensity or 1.0


def _fastest(free: FloatArray) -> float:
    """The largest ω², or without rotation minus the square of half the difference of the eigenvalues."""
    values = np.linalg.eigvals(free)
    omega, spread = float(np.max(values.imag)), float(np.ptp(values.real)) / 2
    return omega**2 if omega > 0 else -(spread**2)


def _exchanged(free: FloatArray, noise: Noise) -> float:
    """A share of the intensity S(0) of a noise that moves energy from mode to mode: 1 in the plane, or of white noise.

    Beyond it is the mean of S at the sums and the differences of their frequencies, over S(0), and 1 at most.
    """
    if noise.is_white or len(free) == 2:
        return 1.0
    values = np.linalg.eigvals(free)
    pairs = [(a, b) for i, a in enumerate(values) for b in values[:i] if not (a.imag and np.isclose(a, np.conj(b)))]
    densities = [noise.spectral_density(abs(a.imag - b.imag)) for a, b in pairs]
    return min(float(np.mean(densities)) / max(noise.spectral_density(0.0), 1e-300), 1.0)


def _settling(
    free: FloatArray,
    driven: Sequence[tuple[float, FloatArray]],
    half_turn: float,
    loads: Sequence[tuple[FloatArray, Any]] = (),
) -> float:
    """Six times that in which E‖x‖² forgets how the modes shared it; 0 in the plane without harmonic loads.

    It is that under white noises, Σ ½ I (B ⊗ 1 + 1 ⊗ B)² for pairs (I, B), on symmetric matrices: where the noise has a
    memory, about, see `_exchanged`. What turns meanwhile is forgotten sooner, as it averages out. With harmonic loads
    it is that from period to period.
    """
    n = len(free)
    if n == 2 and not loads:
        return 0.0
    pairs = [(i, j) for i in range(n) for j in range(i + 1)]
    even = np.zeros((n * n, len(pairs)))
    for k, (i, j) in enumerate(pairs):
        even[i * n + j, k] = even[j * n + i, k] = 1.0
    even /= np.linalg.norm(even, axis=0)
    one = np.eye(n)
    rates = np.kron(free, one) + np.kron(one, free)
    for intensity, matrix in driven:
        both = np.kron(matrix, one) + np.kron(one, matrix)
        rates = rates + 0.5 * intensity * both @ both
    rates = even.T @ rates @ even
    if loads:
        waves = [(even.T @ (np.kron(a, one) + np.kron(one, a)) @ even, load) for a, load in loads]
        starts = [load.start(1, np.random.default_rng(0))[1] for _, load in waves]
        turn, h = np.eye(len(rates)), max(load.period for _, load in waves) / _PARTS
        for t in h * (0.5 + np.arange(_PARTS)):
            now = [
                load.amplitude * np.cos(start + load.nu * t) * a for (a, load), start in zip(waves, starts, strict=True)
            ]
            turn = expm(h * sum(now, rates)) @ turn
        values = np.log(np.linalg.eigvals(turn).astype(complex)) / (h * _PARTS)
    else:
        values = np.linalg.eigvals(rates)
    rate = float(np.sort(abs(values - values.real.max()))[1])  # the nearest is real; others may be as far to the right
    return min(_FORGOTTEN / rate if rate else math.inf, _LONGEST * half_turn)


def _even_coordinates(free: FloatArray, every: FloatArray) -> FloatArray:
    """S for which S A S⁻¹ = α + ω((0, 1), (−1, 0)), or without rotation has entries of one size off its diagonal.

    Beyond the plane the modes of A have such blocks; `every` is how large entries of all matrices are.
    """
    if len(free) > 2:
        return _modal_coordinates(free, every)
    (p, q), (r, _) = free - 0.5 * np.trace(free) * np.eye(2)
    square = -(p * p + q * r)
    if square > 0:
        omega = math.copysign(math.sqrt(square), q)
        return np.array([[1.0, 0.0], [p / omega, q / omega]])
    return np.diag([1.0, math.sqrt(abs(q / r)) if q * r else 1.0])


def _modal_coordinates(free: FloatArray, every: FloatArray) -> FloatArray:
    """S for which S A S⁻¹ has a block for each mode, scaled so that modes drive each other alike.

    Where modes are nearly parallel the given coordinates are kept, but for their scales.
    """
    scales = _balance(every, 0.0)
    values, vectors = np.linalg.eig(free * scales / scales[:, None])
    columns, sizes = list[FloatArray](), list[int]()
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag >= 0:
            parts = [vector.real, vector.imag] if value.imag else [vector.real]
            columns += [part / np.linalg.norm(vector) for part in parts]
            sizes.append(len(parts))
    modes = np.array(columns).T
    if not np.linalg.cond(modes) < _PARALLEL:
        return np.diag(1 / scales)
    back = np.linalg.inv(modes) / scales
    of_mode = np.repeat(np.eye(len(sizes)), sizes, axis=1)
    shares = of_mode @ np.abs(back) @ every @ np.abs(scales[:, None] * modes) @ of_mode.T
    return back / (_balance(shares) @ of_mode)[:, None]


def _balance(matrix: FloatArray, least: float = _ONE_WAY) -> FloatArray:
    """The scales d for which entries a_ij d_j/d_i and a_ji d_i/d_j are alike, where their ratio is above the least."""
    size = np.abs(matrix)
    small, large = np.minimum(size, size.T), np.maximum(size, size.T)
    pairs = [(i, j) for i, j in zip(*np.nonzero(small > least * large), strict=True) if i < j]
    sides, gaps = np.zeros((len(pairs), len(size))), np.zeros(len(pairs))
    for k, (i, j) in enumerate(pairs):
        sides[k, i], sides[k, j], gaps[k] = 1.0, -1.0, 0.5 * math.log(size[i, j] / size[j, i])
    return np.exp(np.linalg.lstsq(sides, gaps, rcond=None)[0])


def _rays(system: System, even: FloatArray, steady: FloatArray) -> Rays:
    """The lines of the jumps in even coordinates."""
    if not system.jumps:
        return Rays(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    phases = np.array([jump.phase for jump in system.jumps])
    along = np.stack([np.cos(phases), -np.sin(phases)], axis=1) @ even.T
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = along[:, ::-1] * np.array([1.0, -1.0])
    ways = np.copysign(1.0, np.sum(across * (along @ steady.reshape(-1, 2, 2)[0].T), axis=1))
    return Rays(along, across, np.array([jump.log_factor for jump in system.jumps]), ways)


def _commutator(a: FloatArray, b: FloatArray) -> FloatArray:
    return a @ b - b @ a


def _rows(matrices: FloatArray) -> FloatArray:
    """(t, p, q, r) of each matrix: half its trace, and the rest ((p, q), (r, −p))."""
    half = 0.5 * (matrices[:, 0, 0] + matrices[:, 1, 1])
    return np.stack([half, 0.5 * (matrices[:, 0, 0] - matrices[:, 1, 1]), matrices[:, 0, 1], matrices[:, 1, 0]], axis=1)
