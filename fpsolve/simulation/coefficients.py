"""What the simulation takes from a system and a noise: matrices, in coordinates in which the motion is even.

What moves paths is imported where they are moved: case files are checked with these numbers, without numba.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import expm

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.model.noise import Noise
from fpsolve.model.noises.steps import ChainStep
from fpsolve.model.plane import (
    SAME_DELAY,
    CoefficientMatrix,
    LinearMotion,
    affine,
    common_unit,
    is_driven,
    written_coefficient,
)
from fpsolve.simulation.walls import Floor, Rays

if TYPE_CHECKING:
    from fpsolve.simulation.motions import Driven, InTurn, Switched

FAST = 1e-3
"""Speed from which on impacts at a wall of several variables count, over the sum of all other variables."""
_FAR = 5.0
"""Standard deviations at which noise held to one side is compared with noise held to the other."""
_UNRESOLVED = 1 / 30
"""Of the coefficient of [A₁, [A₁, A₀]] under white noise, its mean for given ∫dW and ∫W dt, as a share of s²h²."""
ROUGHER = 3
"""How many steps are one of some batches, which tells the bias of a step, where that is of the order h²."""
TURN, GROWTH, SPLIT = 0.5, 0.125, 0.06
"""The turn, and the growth or kick, in one step at most; either where several noises move the state in turn."""
_DELAYS = 8.0
"""Delays after which the start is forgotten, about."""
_PARALLEL = 100.0
"""The condition of the modes from which on they are no coordinates."""
_ONE_WAY = 1e-12
"""Share of the largest product a_ij a_ji below which one of the two is none but for rounding."""
_FORGOTTEN, _LONGEST = 6.0, 1000
"""Of a rate, the times that it needs; half-turns in which that of modes which hardly mix is taken to be over."""
_PARTS = 64
"""Of a period, in each of which coefficients are held."""


@dataclass(frozen=True)
class Load:
    """How one noise moves a system.

    Attributes:
        noise: it.
        rows: those of its state among those of all noises, a number where it is one.
        driven: A₁, shape (n, n), under white noise that of dW; under a chain what each state adds to A₀, shape (states,
            n, n).
        mean: the mean of what it adds to A₀.
        moves: matrices M and weights w for which Σ w M ⊗ M is the variance of what it adds to A₀, of white noise and
            impulses in a unit of time.
        arrivals: what multiplies the state where a state of a chain is reached, or where an impulse comes, shape
            (states, n, n); None under other noise.
    """

    noise: Noise
    rows: int | slice
    driven: FloatArray
    mean: FloatArray
    moves: Sequence[tuple[float, FloatArray]]
    arrivals: FloatArray | None = None

    def turned(self, even: FloatArray, back: FloatArray) -> Load:
        """The same in other coordinates."""
        moves = [(weight, even @ each @ back) for weight, each in self.moves]
        arrivals = None if self.arrivals is None else even @ self.arrivals @ back
        return Load(self.noise, self.rows, even @ self.driven @ back, even @ self.mean @ back, moves, arrivals)

    @property
    def size(self) -> float:
        """The standard deviation of ‖A₁‖ξ, of white noise in a unit of time."""
        return math.sqrt(sum(weight * float(np.linalg.norm(each, 2)) ** 2 for weight, each in self.moves))

    @property
    def fluctuation(self) -> float:
        """That of what the noise adds to d ln‖x‖/dt, of white noise to ln‖x‖ in a unit of time."""
        return math.sqrt(sum(weight * _growth(each) ** 2 for weight, each in self.moves))

    @property
    def time(self) -> float:
        """What a variance is multiplied by to be an intensity."""
        return 1.0 if self.noise.is_white else 2 * min(self.noise.correlation_time, self.noise.period or math.inf)

    def motion(self, steady: FloatArray, wall: Rays | Floor, h: float, bias: float) -> Driven | Switched:
        """What moves paths by a step of length h, beside A₀."""
        from fpsolve.simulation.motions import Driven, Switched

        step = self.noise.step(h, bias)
        if self.arrivals is not None:
            matrices = steady + self.driven
            sizes = np.linalg.norm(matrices, 2, axis=(1, 2))
            return Switched(matrices, expm(h * matrices), self.arrivals, sizes, wall, step, self.rows)
        double = _commutator(self.driven, _commutator(self.driven, steady))
        if self.noise.is_white and isinstance(wall, Rays):
            steady = steady + _UNRESOLVED * h * double
        matrices = np.array([steady, self.driven, _commutator(steady, self.driven), double])
        return Driven(matrices, wall, step, self.rows)


@dataclass(frozen=True)
class Coefficients:
    """A system as noises move it.

    The coordinates are those in which the order 0, where it turns, is a rotation times a growth, and else has two
    entries of one size beside its diagonal; of more than two variables it has such blocks, see `_modal_coordinates`. A
    linear map of the state leaves Λ(p) alone. With a `Stop` they are its own but for their units.

    Attributes:
        noise: all noises.
        loads: each.
        steady: A₀, shape (n, n), with a column for each past value.
        wall: the lines of the jumps, or the wall of one of several variables.
        half_turn: π/ω, ω the largest; without rotation π times the time in which the direction of x is forgotten.
        mixing_time: the time in which it is forgotten how modes shared the motion; 0 where all turn alike.
        pasts: which variable is the one of each past value, and how long ago.
    """

    noise: Noise
    loads: Sequence[Load]
    steady: FloatArray
    wall: Rays | Floor
    half_turn: float
    mixing_time: float
    pasts: Sequence[tuple[int, float]]

    @property
    def is_split(self) -> bool:
        """Whether a step is of the order 2 whatever the noise is."""
        return len(self.loads) > 1 or bool(self.pasts)

    @property
    def is_exact(self) -> bool:
        """Whether steps of any length leave nothing out."""
        return not self.is_split and self.loads[0].arrivals is not None

    @property
    def together(self) -> int:
        """How many steps are a rough one; 1 where the bias of a step is of a higher order, or none."""
        return ROUGHER if self.is_split or (self.noise.is_white and not self.is_exact) else 1

    @property
    def strength(self) -> float:
        """Of one diffusion d ln‖x‖/dt for ξ = 1 at most; negative where it is ξ < 0 that makes more of it."""
        driven = self.loads[0].driven
        far = _FAR * self.noise.standard_deviation * driven
        up, down = (np.linalg.eigvals(self.steady + side * far).real.max() for side in (1, -1))
        return -_growth(driven) if down > up else _growth(driven)

    def size(self, h: float) -> int:
        """The number of variables of a path that is moved in steps of length h, with those of the past."""
        past = max((round(delay / h) for _, delay in self.pasts), default=0)
        return (len(self.steady) - len(self.pasts)) * (1 + past)

    def motion(self, h: float, bias: float = 0.0) -> InTurn:
        """What moves paths by a step of length h."""
        from fpsolve.simulation.motions import InTurn

        share = self.steady / len(self.loads)
        motions = tuple(load.motion(share, self.wall, h, bias) for load in self.loads)
        n = len(self.steady) - len(self.pasts)
        rows = np.array([variable + n * round(delay / h) for variable, delay in self.pasts], dtype=int)
        return InTurn(motions, n, rows)

    def spread(self, h: float) -> float:
        """The standard deviation of what the noises add to ln‖x‖ in a time h that they take no note of."""
        return math.sqrt(sum(each.fluctuation**2 * (h if each.noise.is_white else h**2) for each in self.loads))

    @property
    def repeated(self) -> float:
        """The delay, or the period of a harmonic load, without one a half-turn."""
        if self.pasts:
            return repeated_delay(self.pasts)
        return max(each.noise.period for each in self.loads) or self.half_turn

    def divides(self, step: float) -> bool:
        """Whether some steps, three at a time, are the delay, if there is one."""
        count = self.repeated / ROUGHER / step
        return not self.pasts or abs(count - round(count)) <= SAME_DELAY * count

    @property
    def largest_step(self) -> tuple[float, str]:
        """The largest step that is good to about 1e-4 of the strength of the noise, and what limits it.

        For A₀ = Ω + D with Ωᵀ = −Ω and ‖Ω‖ = ω, and for A₁ these are ω h ≤ `TURN`, ‖D‖ h ≤ `GROWTH`, ‖A₁‖ std(ξ) h ≤
        `GROWTH`, or under white noise ‖A₁‖² h ≤ `GROWTH`, and the `largest_step` of the noise. Under a chain or
        impulses, where a step is exact, it is 1/(2π) half-turns.
        """
        if self.is_exact:
            return TURN * self.half_turn / math.pi, "the frequency"
        turning = 0.5 * (self.steady - self.steady.T)
        turn = float(np.linalg.norm(turning, 2))
        rest = float(np.linalg.norm(self.steady - turning, 2))  # may underflow
        most_turn, most = (2 * SPLIT, SPLIT) if self.is_split else (TURN, GROWTH)
        kicks = [each.size**2 if each.noise.is_white else each.size for each in self.loads]
        limits = {
            "the frequency": most_turn / turn if turn else math.inf,
            "the damping": most / rest if rest else math.inf,
            "the strength of the noise": min((most / kick for kick in kicks if kick), default=math.inf),
            "the correlation time of the noise": self.noise.largest_step,
            "the delay": repeated_delay(self.pasts) / 4,
        }
        reason = min(limits, key=lambda name: limits[name])
        return limits[reason], reason

    @property
    def default_step(self) -> float:
        """Half the largest step, or less, so that a half-turn or a period is a whole number of steps, rough or not."""
        unit = self.repeated / self.together
        return unit / math.ceil(unit / (0.5 * self.largest_step[0]))

    def transient(self, *, is_mixed: bool = True) -> float:
        """The time after which ln E‖x‖^p grows like Λ(p) t: at least two half-turns π/ω and eight relaxation times.

        Of impulses that is eight times the mean time between two of them.

        It is a whole number of half-turns, in which the oscillation cancels that the start from the stationary law
        leaves in weak noise; beside a harmonic load, with which the growth goes up and down for ever, a whole number of
        periods. Beyond the plane it is, if `is_mixed`, at least as long as the modes remember how they shared the
        motion.
        """
        relaxation = max((each.noise.relaxation_time for each in self.loads if not each.noise.period), default=0.0)
        needed = max(2 * self.half_turn, 8 * relaxation, is_mixed * self.mixing_time)
        return self.repeated * math.ceil(needed / self.repeated)


def refuse(system: LinearMotion, noise: Noise) -> None:
    """Refuse what no scheme moves. Raises `FpsolveError`."""
    try:
        repeated_delay(system.pasts)
    except ValueError as failure:
        raise FpsolveError(f"simulation is in steps that divide each delay, but {failure}") from failure
    if system.stop and (len(noise.parts) > 1 or system.clock):
        raise FpsolveError("simulation of a wall of more than two variables is for one noise, without periodic terms")
    for term in system.terms:
        if affine(term.g) is None and not noise.parts.get(term.noise, noise).has_states:
            found = f"but one has g = {written_coefficient(term.g).strip()}"
            need = f"terms that are a + b*xi under a {type(noise).__name__}, {found}"
            raise FpsolveError(f"simulation is for {need}; use the finite elements")


def starting_state(
    noise: Noise, paths: int, rng: np.random.Generator, size: int, amplitude: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """The states of paths of one amplitude and those of their noises, with uniform directions and stationary noise."""
    state = rng.standard_normal((size, paths))
    return state * (amplitude / np.linalg.norm(state, axis=0)), np.atleast_2d(noise.start(paths, rng))


def repeated_delay(pasts: Sequence[tuple[int, float]]) -> float:
    """The time of which all delays are multiples, ∞ without any. Raises `ValueError`: there is none."""
    return common_unit([delay for _, delay in pasts], "delays")[0] if pasts else math.inf


def coefficients(system: LinearMotion, noise: Noise) -> Coefficients:
    """The matrices of a system under noises that can be simulated."""
    terms, loads = noise.motion(system).terms, _loads(system, noise)
    steady = _without_noise(system, terms)
    mean = sum((each.mean for each in loads), np.zeros_like(steady))
    free = _without_noise(system, [term for term in terms if term.order == 0]) + mean
    free = free if free.any() else steady + mean
    every = sum((np.max([np.abs(m) for _, m in each.moves], axis=0) for each in loads), np.abs(steady + mean))
    if (stop := system.stop) is not None:
        rows = np.array(stop.coordinates)
        scales = _balance(np.abs(rows) @ every @ np.abs(np.linalg.inv(rows)))
        even: FloatArray = rows / scales[:, None]
    elif system.pasts:
        variables = [*range(len(free) - len(system.pasts)), *(variable for variable, _ in system.pasts)]
        folded = np.eye(len(free))[variables]
        even = np.diag(1 / _balance(folded.T @ every @ folded, 0.0)[variables])
    else:
        even = _even_coordinates(free, every)
    back = np.asarray(np.linalg.inv(even), dtype=float)
    free, steady, loads = even @ free @ back, even @ steady @ back, [each.turned(even, back) for each in loads]
    half_turn = math.pi / _rate(free, sum(each.fluctuation**2 * each.time for each in loads))
    wall: Rays | Floor = _rays(system, even, steady + sum(each.mean for each in loads))
    if stop is not None:
        wall = Floor(stop.restitution, FAST * scales / scales[1], float(noise.is_white))
        if (square := -free[0, 1] * free[1, 0]) > 0:  # an impact in each half-turn is like damping
            half_turn = math.pi / math.sqrt(square)
            free[1, 1] += 2 * math.log(stop.restitution) / half_turn
    mixing = _DELAYS * max((delay for _, delay in system.pasts), default=0.0) or _mixing_time(free, loads, half_turn)
    return Coefficients(noise, loads, steady, wall, half_turn, mixing, system.pasts)


def _without_noise(system: LinearMotion, terms: Sequence[CoefficientMatrix]) -> FloatArray:
    """The sum of terms without what noises multiply."""
    zero = np.zeros((system.dimension, system.dimension))
    return sum((line[0] * _matrix(system, term) for term in terms if (line := affine(term.g))), zero)


def _matrix(system: LinearMotion, term: CoefficientMatrix) -> FloatArray:
    """ε^order A."""
    return system.epsilon**term.order * np.array(term.matrix)


def _loads(system: LinearMotion, noise: Noise) -> list[Load]:
    """How each noise moves a system, in its own coordinates."""
    found, row, rng, zero = list[Load](), 0, np.random.default_rng(0), np.zeros((system.dimension, system.dimension))
    parts: Mapping[str, Any] = noise.parts
    for name, part in parts.items():
        own = [term for term in system.terms if is_driven(term.g) and (len(noise.parts) == 1 or term.noise == name)]
        lines, shapes = [affine(term.g) or (0.0, 0.0) for term in own], [_matrix(system, term) for term in own]
        moved = part.motion(LinearMotion(own, epsilon=system.epsilon))
        count = len(np.atleast_2d(part.start(1, rng)))
        rows = row if count == 1 else slice(row, row + count)
        row += count
        if isinstance(step := part.step(min(1.0, part.largest_step)), ChainStep):
            driven: FloatArray = np.zeros((step.values.size, *zero.shape))
            for term, (offset, _), shape in zip(own, lines, shapes, strict=True):
                driven += (term.g(step.values) - offset)[:, None, None] * shape
            arrivals = np.array([each.matrix for each in moved.impulses] or [np.eye(len(zero))] * step.values.size)
            mean = np.tensordot(part.probabilities, driven[: part.probabilities.size], 1)
            moves = [(each.rate, np.array(each.exponent)) for each in moved.impulses]
            moves = moves or [*zip(part.probabilities, driven - mean, strict=False)]
            found.append(Load(part, rows, driven, mean, moves, arrivals))
        elif part.is_white:
            driven = sum((_matrix(system, each) for each in moved.diffusions), zero)
            found.append(Load(part, rows, driven, zero, [(1.0, driven)]))
        else:
            driven = sum((slope * shape for (_, slope), shape in zip(lines, shapes, strict=True)), zero)
            found.append(Load(part, rows, driven, zero, [(part.standard_deviation**2, driven)]))
    return found


def _growth(matrix: FloatArray) -> float:
    """d ln‖x‖/dt at most, or at least, the larger of both sizes."""
    return float(np.max(np.abs(np.linalg.eigvalsh(matrix + matrix.T) / 2)))


def _rate(free: FloatArray, intensity: float) -> float:
    """The largest ω where a motion turns, else the rate at which two directions come together."""
    values = np.linalg.eigvals(free)
    if (omega := float(np.max(values.imag))) > 0:
        return omega
    shear = float(np.linalg.norm(free - np.trace(free) / len(free) * np.eye(len(free)), 2))
    spread = float(np.ptp(values.real)) / 2
    return max(spread, (shear**2 * intensity) ** (1 / 3)) or intensity or 1.0


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


def _mixing_time(free: FloatArray, loads: Sequence[Load], half_turn: float) -> float:
    """Six times that in which E‖x‖² forgets how the modes shared it; 0 in the plane without harmonic loads.

    It is that under white noises, Σ ½ I (B ⊗ 1 + 1 ⊗ B)² for pairs (I, B), on symmetric matrices: where the noise has a
    memory, about, see `_exchanged`. What turns meanwhile is forgotten sooner, as it averages out. With harmonic loads
    it is that from period to period.
    """
    n = len(free)
    waves: list[tuple[FloatArray, Any]] = [(load.driven, load.noise) for load in loads if load.noise.period]
    if n <= 2 and not waves:
        return 0.0
    pairs = [(i, j) for i in range(n) for j in range(i + 1)]
    even = np.zeros((n * n, len(pairs)))
    for k, (i, j) in enumerate(pairs):
        even[i * n + j, k] = even[j * n + i, k] = 1.0
    even /= np.linalg.norm(even, axis=0)

    def both(matrix: FloatArray) -> FloatArray:
        return np.kron(matrix, np.eye(n)) + np.kron(np.eye(n), matrix)

    rates = both(free)
    for load in loads:
        intensity = 0.0 if load.noise.period else 0.5 * load.time * _exchanged(free, load.noise)
        rates = rates + sum(intensity * weight * both(each) @ both(each) for weight, each in load.moves)
    rates = even.T @ rates @ even
    if waves:
        rng = np.random.default_rng(0)
        held = [(even.T @ both(matrix) @ even, wave.start(1, rng)[1], wave) for matrix, wave in waves]
        turn, h = np.eye(len(rates)), max(wave.period for _, wave in waves) / _PARTS
        for t in h * (0.5 + np.arange(_PARTS)):
            now = [wave.amplitude * np.cos(start + wave.nu * t) * matrix for matrix, start, wave in held]
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
    """The scales d for which entries a_ij d_j/d_i and a_ji d_i/d_j are alike.

    Pairs count whose product, which is a rate squared whatever the units, is above a least share of the largest one.
    """
    size = np.abs(matrix)
    products = size * size.T
    pairs = [*zip(*np.nonzero(np.triu(products > least * products.max(), 1)), strict=True)]
    sides, gaps = np.zeros((len(pairs), len(size))), np.zeros(len(pairs))
    for k, (i, j) in enumerate(pairs):
        sides[k, i], sides[k, j], gaps[k] = 1.0, -1.0, 0.5 * math.log(size[i, j] / size[j, i])
    return np.exp(np.linalg.lstsq(sides, gaps, rcond=None)[0])


def _rays(system: LinearMotion, even: FloatArray, mean: FloatArray) -> Rays:
    """The lines of the jumps, of the plane alone, in even coordinates, in which this is the mean of A(ξ)."""
    phases = np.array([jump.phase for jump in system.jumps])
    along = np.stack([np.cos(phases), -np.sin(phases)], axis=1) @ even.T[:2, :2]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = along[:, ::-1] * np.array([1.0, -1.0])
    ways = np.copysign(1.0, np.sum(across * (along @ mean.T[:2, :2]), axis=1))
    return Rays(along, across, np.array([jump.log_factor for jump in system.jumps]), ways)


def _commutator(a: FloatArray, b: FloatArray) -> FloatArray:
    return a @ b - b @ a
