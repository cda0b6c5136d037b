"""Motion in the plane, linear but for cubic terms, driven by noise and stretched at rays, as the paper's oscillator.

    ẋ = Σ_k ε^n_k g_k(ξ) A_k x,      x⁺ = R x⁻ where the phase passes a ray

In polar coordinates x = a e, e = (cos φ, −sin φ), as in Eq. (17), where x = (displacement, velocity/ω), every A gives
dφ = h dt and d ln a = q dt with h = e′ᵀA e, q = eᵀA e, e′ = de/dφ: a mean and a wave in 2φ each, so that everything is
π-periodic in φ.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm, expm_frechet

from fpsolve.arrays import (
    ROUNDED,
    Coefficient,
    Constant,
    FloatArray,
    Linear,
    identity,
    is_whole,
    nothing,
    one,
    real_array,
    real_number,
    shown,
)
from fpsolve.model.parameters import Parametrised
from fpsolve.model.quantity import ResponseQuantities, linear_response, response_quantities

Matrix = Sequence[Sequence[float]] | FloatArray
Xi = ArrayLike | Mapping[str, ArrayLike]
"""ξ, or with several noises that of each by its name."""
MOST_VARIABLES = 200
"""Largest number of variables of a state."""
MOST_MULTIPLE = 12
"""Largest delay, over that of which all are multiples."""
SAME_DELAY = 1e-9
"""Share of a delay by which it may differ from such a multiple."""
OF_ENTRIES = 1e-15
"""Share of the largest speed of a term that is rounding of its entries, as of a matrix that keeps two rays."""
COLLAPSE = math.exp(-math.pi / math.sqrt(3))
"""Restitution below which a mass under white noise comes to rest at a wall (E. Jacob, arXiv:1004.1953)."""
BELOW = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
"""Digits below a line."""


def rows_of(matrix: ArrayLike) -> tuple[tuple[float, ...], ...]:
    """The rows of a matrix, which can be compared and hashed."""
    return tuple(map(tuple, np.asarray(matrix, dtype=float).tolist()))


@dataclass(frozen=True)
class Harmonics:
    """mean + cosine cos 2φ + sine sin 2φ."""

    mean: Any
    cosine: Any
    sine: Any

    def __call__(self, phi: ArrayLike) -> FloatArray:
        twice = 2 * np.asarray(phi, dtype=float)
        return self.mean + self.cosine * np.cos(twice) + self.sine * np.sin(twice)

    def slope(self, phi: ArrayLike) -> FloatArray:
        """Its derivative by φ."""
        return Harmonics(0.0, 2 * self.sine, -2 * self.cosine)(phi)

    @property
    def amplitude(self) -> Any:
        """The amplitude of the wave in 2φ."""
        return np.hypot(self.cosine, self.sine)

    @property
    def vanishes(self) -> bool:
        return not np.any([self.mean, self.cosine, self.sine])

    def __str__(self) -> str:
        """(0.5 − 0.5 cos 2φ), or one number."""
        if np.ndim(self.mean):
            return repr(self)
        text = ""
        for value, name in ((self.mean, ""), (self.cosine, " cos 2φ"), (self.sine, " sin 2φ")):
            if value:
                text += f" {'−' if value < 0 else '+'} {abs(value):g}{name}"
        text = text.removeprefix(" + ").removeprefix(" ")
        return text if self.mean and not self.amplitude else f"({text})"


def stretching(a: FloatArray) -> Harmonics:
    """eᵀA e, d ln a/dt, for matrices of shape (…, 2, 2)."""
    return Harmonics(
        (a[..., 0, 0] + a[..., 1, 1]) / 2, (a[..., 0, 0] - a[..., 1, 1]) / 2, -(a[..., 0, 1] + a[..., 1, 0]) / 2
    )


def turning(a: FloatArray) -> Harmonics:
    """e′ᵀA e, dφ/dt, for matrices of shape (…, 2, 2): eᵀQA e, as e′ = Qᵀe."""
    return stretching(np.array([[0.0, -1.0], [1.0, 0.0]]) @ a)


PROBES = np.concatenate([-(side := np.geomspace(1e-6, 1e6, 97) * (1 + 0.01 * np.sin(np.arange(97)))), [0.0], side])
"""ξ at which a function is compared with a + bξ."""


@dataclass(frozen=True)
class Function:
    """A user's coefficient of ξ, which may return numbers for arrays.

    Attributes:
        f: any callable.
    """

    f: Callable[[Any], Any]

    def __call__(self, x: Any) -> Any:
        x, made = np.asarray(x, dtype=float), self.f(np.asarray(x, dtype=float))
        with suppress(ValueError):  # of lists of unequal lengths, and of shapes that do not fit
            found = np.asarray(made)
            if found.dtype.kind in "biuf":
                return np.broadcast_to(found.astype(float), x.shape)
        raise ValueError(
            f"g returned {shown(made)} for an array of shape {x.shape}; must be real numbers of this shape"
        )

    def __hash__(self) -> int:
        try:
            return hash(self.f)
        except TypeError:  # an object that compares by value and may change
            return id(self.f)

    @cached_property
    def affine(self) -> tuple[float, float] | None:
        """a and b where it is a + bξ at all of the `PROBES`, else None."""
        try:
            with np.errstate(all="ignore"):
                values = self(PROBES)
        except Exception:  # it may be defined near 0 only
            return None
        if not np.isfinite(values).all():
            return None
        offset, slope = float(values[PROBES == 0][0]), float(values[-1] - values[0]) / float(PROBES[-1] - PROBES[0])
        near = np.abs(values - offset - slope * PROBES) <= 1e-14 * (abs(offset) + abs(slope * PROBES))
        return (offset, slope) if np.all(near) else None


Driver = tuple[str, Constant | Linear | Function]
"""The name of a noise, and a function of it."""
STEADY: Driver = "", one
"""What is driven by nothing."""


def coefficient(g: Coefficient) -> Constant | Linear | Function:
    """A coefficient as a value. Raises `TypeError` where it is no function."""
    if isinstance(g, Constant | Linear | Function):
        return g
    if not callable(g):
        raise TypeError(f"got g = {shown(g)}; must be a function of xi")
    return Function(g)


def affine(g: Constant | Linear | Function) -> tuple[float, float] | None:
    """a and b of a coefficient a + bξ; None for others."""
    match g:
        case Constant(value):
            return value, 0.0
        case Linear():
            return 0.0, 1.0
    return g.affine


def written_coefficient(g: Constant | Linear | Function) -> str:
    """How a coefficient is written before what it multiplies: nothing for 1, "ξ ", "sin(ξ) "."""
    match g:
        case Constant(value):
            return "" if value == 1 else f"{value:g} "
        case Linear():
            return "ξ "
    with suppress(AttributeError):
        return f"{g.f.__name__}(ξ) "
    return f"{type(g.f).__name__}(ξ) "


def written_sum(terms: Iterable[tuple[float, str]]) -> str:
    """A sum of multiples of what is named: "−x + 0.001 ẋ − 0.2 x² ẋ + 0.1 ξ ẋ"."""
    text = "".join(
        f" {'−' if size < 0 else '+'} {'' if abs(size) == 1 else f'{abs(size):.10g} '}{name}"
        for size, name in terms
        if size
    )
    return re.sub(r"^ \+ |^ (?=−)", "", text).replace("− ", "−", text.startswith(" −")) or "0"


def is_driven(g: Constant | Linear | Function) -> bool:
    """Whether a coefficient changes with ξ."""
    line = affine(g)
    return line is None or line[1] != 0


@dataclass(frozen=True)
class CoefficientMatrix:
    """One term of the motion, ε^order g(ξ) A x.

    Args:
        order: n ≥ 0, the power of ε.
        matrix: A, n rows of n numbers for a state of n variables.
        g: a coefficient of ξ: any callable from arrays to arrays or numbers; one that pickles, so that results do.
        noise: the name of that noise where there are several.

    Raises:
        ValueError: the matrix is not square and finite, n = 1 to 200, or the order is negative.
    """

    order: int
    matrix: Matrix
    g: Constant | Linear | Function = one
    noise: str = ""

    def __post_init__(self) -> None:
        entries: FloatArray = np.zeros(0)
        with suppress(ValueError):
            entries = real_array(self.matrix, "matrix")
        n = len(entries) if entries.ndim == 2 else 0
        if entries.shape != (n, n) or not 1 <= n <= MOST_VARIABLES or not is_whole(self.order, 0):
            raise ValueError(
                f"got order = {shown(self.order)} and matrix = {shown(self.matrix)}; must be a whole number >= 0 and "
                "two rows of two finite numbers, such as ((0.0, 0.0), (0.0, 1.0)), or n rows of n, n <= "
                f"{MOST_VARIABLES}"
            )
        object.__setattr__(self, "order", int(self.order))
        object.__setattr__(self, "matrix", rows_of(entries))
        object.__setattr__(self, "g", coefficient(self.g))

    @cached_property
    def h(self) -> Harmonics:
        """h(φ) = e′ᵀA e, the phase speed."""
        return turning(np.array(self.matrix))

    @cached_property
    def q(self) -> Harmonics:
        """q(φ) = eᵀA e, the growth rate of ln a."""
        return stretching(np.array(self.matrix))

    @cached_property
    def fastest(self) -> tuple[float, float]:
        """‖A‖, and the largest |eᵀA e| of a unit vector e."""
        a = np.array(self.matrix)
        return float(np.linalg.norm(a, 2)), float(np.linalg.norm(a + a.T, 2) / 2)


@dataclass(frozen=True)
class CubicTerms:
    """What is of degree 3 in the rates: ẋᵢ = … + Σ_k C_ik x₁^(3−k) x₂^k, which no noise drives.

    In polar coordinates dφ = a²h dt and d ln a = a²q dt, of one sign for φ and φ + π.

    Args:
        matrix: C with all powers of ε, two rows of four numbers.

    Raises:
        ValueError: it is not of this shape and finite.
    """

    matrix: Matrix

    def __post_init__(self) -> None:
        entries = real_array(self.matrix, "matrix")
        if entries.shape != (2, 4):
            raise ValueError(f"got matrix = {shown(self.matrix)}; must be two rows of four finite numbers")
        object.__setattr__(self, "matrix", rows_of(entries))

    def h(self, phi: ArrayLike) -> FloatArray:
        """e′ᵀ C m(e), m the products of degree 3."""
        first, second = self._rates(phi)
        return np.asarray(-np.sin(phi) * first - np.cos(phi) * second)

    def q(self, phi: ArrayLike) -> FloatArray:
        """eᵀ C m(e)."""
        first, second = self._rates(phi)
        return np.asarray(np.cos(phi) * first - np.sin(phi) * second)

    def _rates(self, phi: ArrayLike) -> FloatArray:
        """C m(e), shape (2, *φ.shape)."""
        x, u = np.cos(phi), -np.sin(phi)
        return np.tensordot(np.array(self.matrix), np.stack([x**3, x * x * u, x * u * u, u**3]), 1)


@dataclass(frozen=True)
class Impulse:
    """x⁺ = exp(B) x⁻ at the times of a Poisson process.

    Attributes:
        rate: impulses in a unit of time.
        exponent: B, shape (2, 2).
    """

    rate: float
    exponent: Matrix

    def __post_init__(self) -> None:
        object.__setattr__(self, "exponent", rows_of(self.exponent))

    @cached_property
    def matrix(self) -> FloatArray:
        """exp(B)."""
        return np.asarray(expm(np.array(self.exponent)))

    def stretched(self, phi: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """|exp(B)e| of a unit vector e at φ, and the φ that it comes to."""
        x, u = np.tensordot(self.matrix, [np.cos(phi), -np.sin(phi)], 1)
        return np.hypot(x, u), np.arctan2(-u, x)

    @property
    def strength(self) -> float:
        """|ln| of what it multiplies ‖x‖ by, at most."""
        return float(np.max(np.abs(np.log(np.linalg.svd(self.matrix, compute_uv=False)))))


def changed_exponential(exponent: Matrix, change: Matrix) -> FloatArray:
    """∂ exp(B) for ∂B, shape (2, 2)."""
    return np.asarray(expm_frechet(np.array(exponent), np.array(change), compute_expm=False))


@dataclass(frozen=True)
class Jump:
    """x⁺ = R x⁻ where the phase passes φ or φ + π, with a speed v ≠ 0 that no noise changes, else a problem refuses it.

    Args:
        phase: φ of the ray, in radians.
        log_factor: ln R.
        leading: its part of the order ε², by which perturbation theory replaces it; ln R itself if None.

    Raises:
        ValueError: a number is not finite.
    """

    phase: float
    log_factor: float
    leading: float | None = None

    def __post_init__(self) -> None:
        try:
            for value in (self.phase, self.log_factor, 0.0 if self.leading is None else self.leading):
                real_number(value, "")
        except ValueError:
            numbers = f"phase = {shown(self.phase)}, log_factor = {shown(self.log_factor)}"
            more = f"and leading, here {shown(self.leading)}, one too where it is not None"
            raise ValueError(f"got {numbers}; both must be finite numbers, {more}") from None

    @property
    def second_order(self) -> float:
        return self.log_factor if self.leading is None else self.leading

    def refuse(self, system: LinearMotion, noise: Any) -> None:
        """Refuse it where a noise moves the phase across the ray, or nothing does. Raises `ValueError`."""
        ray = f"the ray of a jump, phi = {self.phase:.6g}"
        x, u = (0.0 if abs(each) < 1e-15 else each for each in (math.cos(self.phase), -math.sin(self.phase)))
        shares = np.array([[u * x, u * u], [-x * x, -x * u]])  # h = e′ᵀA e is Σ of these times the entries of A
        sums = system.by_noise()
        total, size = float(np.sum(shares * sums[STEADY])), sum(float(np.sum(abs(shares * a))) for a in sums.values())
        for name in dict.fromkeys(name for name, g in sums if g != one):
            own = {g: a for (each, g), a in sums.items() if each == name and g != one}
            xi = np.array([0.0, 1.0]) if {*own} == {identity} else noise.parts.get(name, noise).reached
            speeds = sum(np.sum(shares * a) * g(xi) for g, a in own.items())
            rounding = {g: ROUNDED * np.sum(abs(shares * a)) + OF_ENTRIES * np.linalg.norm(a) for g, a in own.items()}
            limit = np.max(sum(rounding[g] * np.abs(g(xi)) for g in own))
            if not np.ptp(speeds) <= limit:
                which = f'the noise "{name}"' if len(noise.parts) > 1 else f"{noise.kind} noise"
                raise ValueError(
                    f"{which} moves the phase across {ray}, which it does over no wall: x = 0, phi = pi/2 = "
                    "1.5707963267948966, is passed with the speed v whatever the noise; let it drive terms that do "
                    "not move the phase there, or remove the jump"
                )
            total += float(speeds[0])
        if abs(total) <= ROUNDED * size:
            raise ValueError(
                f"the phase does not pass {ray}: nothing moves it there, so that no path comes to this wall; remove "
                "the jump"
            )

    @property
    def changes_state(self) -> bool:
        """Whether there is more to it than a phase."""
        return self.log_factor != 0

    def told(self, names: Sequence[str]) -> list[str]:
        """The impact as reports have it, for the names of the variables."""
        factor = f"{math.exp(self.log_factor):.10g}"
        if not math.isclose(math.cos(self.phase), 0.0, abs_tol=1e-12):
            return [f"‖x‖⁺ = {factor} ‖x‖⁻ at φ = {self.phase:.6g} and φ + π"]
        return [f"|{names[1]}|⁺ = {factor} |{names[1]}|⁻ at {names[0]} = 0"] if self.log_factor else []


@dataclass(frozen=True)
class Stop:
    """A rigid wall at rest for one coordinate q of three or more variables: q ≥ 0, and q̇⁺ = −R q̇⁻ where q = 0.

    In the coordinates y = Sx, y₁ = q and y₂ = q̇, an impact is J = diag(1, −R, 1, …): the others do not jump. With a
    mass matrix M and q = cᵀr of displacements r they are M-orthogonal to it, as v⁺ = v − (1 + R) M⁻¹c (cᵀv)/(cᵀM⁻¹c).
    While q = q̇ = 0 and q̈ < 0 it rests at the wall, and the others move alone.

    >>> import numpy as np
    >>> Stop(np.eye(3), 0.5).matrix  # of (q, q̇, a voltage)
    array([[ 1. ,  0. ,  0. ],
           [ 0. , -0.5,  0. ],
           [ 0. ,  0. ,  1. ]])

    Args:
        coordinates: S, shape (n, n).
        restitution: R, 0 < R ≤ 1.

    Raises:
        ValueError: S has no inverse, or R is out of its range.
    """

    coordinates: Matrix
    restitution: float
    changes_state: ClassVar[bool] = True

    def __post_init__(self) -> None:
        rows = real_array(self.coordinates, "coordinates")
        if rows.ndim != 2 or len({*rows.shape}) > 1 or not np.linalg.matrix_rank(rows) == len(rows) > 2:
            raise ValueError(f"got coordinates = {shown(self.coordinates)}; must be a matrix of n ≥ 3 with an inverse")
        if not 0 < real_number(self.restitution, "restitution") <= 1:
            raise ValueError(f"got restitution = {self.restitution:g}; must be > 0 and <= 1; a wall gives no energy")
        object.__setattr__(self, "coordinates", rows_of(rows))

    @cached_property
    def _sides(self) -> tuple[FloatArray, FloatArray]:
        rows = np.array(self.coordinates)
        return rows, np.linalg.inv(rows)

    @property
    def matrix(self) -> FloatArray:
        """J in the coordinates of x, x⁺ = J x⁻."""
        rows, back = self._sides
        return np.eye(len(rows)) - (1 + self.restitution) * np.outer(back[:, 1], rows[1])

    def names(self, states: Sequence[str]) -> list[str]:
        """What its coordinates are called: as the variables that they are, others y₁, y₂, …"""
        alone = [np.flatnonzero(row) for row in self._sides[0]]
        return [f"y{str(k + 1).translate(BELOW)}" if at.size > 1 else states[at[0]] for k, at in enumerate(alone)]

    def inside(self, matrix: ArrayLike) -> FloatArray:
        """S A S⁻¹, without what is rounding."""
        rows, back = self._sides
        whole = np.asarray(matrix, dtype=float)
        found = rows @ whole @ back
        return np.where(np.abs(found) > ROUNDED * (np.abs(rows) @ np.abs(whole) @ np.abs(back)), found, 0.0)

    def told(self, names: Sequence[str]) -> list[str]:
        """The impact as reports have it, for the names of the variables."""

        def written(row: FloatArray) -> str:
            return written_sum(zip(np.round(row, 12).tolist(), names, strict=True))

        moved, at = self.matrix, written(self._sides[0][0])
        rows = [k for k, row in enumerate(moved - np.eye(len(moved))) if row.any()]
        return [f"{names[k]}⁺ = {written(moved[k])} at {at} = 0" for k in rows]

    def refuse(self, system: LinearMotion, noise: Any) -> None:
        """Refuse coordinates that are none of a wall, and one that no law says how to leave. Raises `ValueError`."""
        n, total, size = system.dimension, 0.0, 0.0
        if len(self.coordinates) != n:
            raise ValueError(f"got a wall with {len(self.coordinates)} coordinates of {n} variables; must be of all")
        for term in system.terms:
            row = system.epsilon**term.order * self.inside(term.matrix)[0]
            if is_driven(term.g) and row.any():
                raise ValueError(
                    "a noise moves the coordinate of the wall; let it drive velocities alone, or remove the wall"
                )
            total, size = total + float(term.g(0.0)) * row, size + float(np.max(np.abs(row)))
        if not np.all(np.abs(total - np.eye(n)[1]) <= n * ROUNDED * size):
            told = f"the rate of the coordinate of the wall is {np.round(total, 6).tolist()} in its coordinates"
            raise ValueError(f"{told}; must be the second one alone, its velocity; choose other coordinates")
        rows = [self.inside(each.matrix)[1, 2:] for each in noise.motion(system).diffusions]
        if self.restitution < COLLAPSE and np.any(rows):
            raise ValueError(
                f"got restitution = {self.restitution:g} where white noise drives the coordinate of the wall while "
                f"it rests there; must be >= exp(-pi/sqrt(3)) = {COLLAPSE:.6g}, as below that infinitely many impacts "
                "bring it to rest, and how the noise frees it again is not computed (J. Bertoin, Ann. Probab. 35, "
                "2007, for 0; E. Jacob, arXiv:1004.1953 and arXiv:1103.2845); increase it, or take noise with a memory"
            )


@dataclass(frozen=True)
class NoiseDerivative:
    """∂/∂θ of a diffusion, or of a chain.

    Attributes:
        log_diffusion: ∂ ln σ/∂θ, the same for all ξ/c.
        log_density: ∂ ln P_s(ξ)/∂θ at fixed ξ/c, but for a constant.
        end_exponent: ∂a/∂θ of P_s ~ (1 − ξ²/ξ_s²)^a at the ends of a bounded support.
        log_scale: ∂ ln c/∂θ of the length c that ξ is measured by; 0 where ξ itself is held.
        states: ∂ξ_i/∂θ of a chain; empty where none moves.
        rates: ∂Q/∂θ of a chain; empty where none changes.
        turning: ∂ν/∂θ of a noise that is a function of an angle, with the speed ν.
        drift: ∂M/∂θ of a noise that is a function of two linear ones; empty where it does not change.
    """

    log_diffusion: float = 0.0
    log_density: Coefficient = nothing
    end_exponent: float = 0.0
    log_scale: float = 0.0
    states: tuple[float, ...] = ()
    rates: tuple[tuple[float, ...], ...] = ()
    turning: float = 0.0
    drift: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class ParameterDerivative:
    """∂/∂θ of a problem, all at fixed x and ξ; of a system alone its terms, its jumps, and its clock as the noise.

    Attributes:
        theta: the value of θ.
        terms: Σ ε^n g(ξ) A x of these is ∂/∂θ of the motion.
        diffusions: that of each of its diffusions; empty where none changes.
        impulses: that of each of its impulses, of its rate and of its exponent; empty where none changes.
        jumps: ∂ ln R/∂θ of each of the jumps of the motion; empty where none changes.
        noise: that of the noise; None where it does not change.
        part: which of the `valued` noises changes.
    """

    theta: float = 0.0
    terms: tuple[CoefficientMatrix, ...] = ()
    diffusions: tuple[CoefficientMatrix, ...] = ()
    impulses: tuple[Impulse, ...] = ()
    jumps: tuple[float, ...] = ()
    noise: NoiseDerivative | None = None
    part: int = 0


class System(Parametrised):
    """A linear system by its parameters: a kind of a case file, or one's own.

    Attributes:
        noise_unit: the unit of ξ.
        noise_sections: the sections of a case file that state the noises, with which the keys of their parameters
            begin: "noise", or, for one that terms call axial, "noise.axial".
    """

    section: ClassVar[str] = "system"
    noise_unit: ClassVar[str] = "unknown"

    def linear(self) -> LinearMotion:
        """The linear system that it is for these parameters."""
        raise NotImplementedError(
            f"{type(self).__name__} states no linear(), which gives for example PlaneSystem(terms, jumps)"
        )

    @cached_property
    def terms(self) -> Sequence[CoefficientMatrix]:
        """The terms of the motion."""
        return self.linear().terms

    @cached_property
    def jumps(self) -> Sequence[Jump]:
        """The rays at which the state is stretched."""
        return self.linear().jumps

    def derivative(self, name: str) -> ParameterDerivative:
        """∂/∂θ of the sum of the terms, of ln R of every jump, and of ν of the clock."""
        raise NotImplementedError(f"{type(self).__name__} states no derivative by {name}")

    def by_epsilon(self) -> tuple[CoefficientMatrix, ...]:
        """∂/∂ε of Σ ε^n g(ξ) A x, as terms."""
        return tuple(
            CoefficientMatrix(term.order - 1, term.order * np.array(term.matrix), term.g, term.noise)
            for term in self.terms
            if term.order
        )

    @property
    def noise_sections(self) -> Sequence[str]:
        return ("noise",)

    def restitution_at(self, log_factor: float) -> tuple[str, float, float]:
        """The symbol of the coefficient of restitution, its value at a wall with a given ln R, and ∂/∂ ln R of it.

        The value is by the law of the wall, and may be out of range. Here it is R.
        """
        with np.errstate(over="ignore"):
            return "R", (factor := float(np.exp(log_factor))), factor


@dataclass(frozen=True)
class LinearMotion(System):
    """Matrices, walls and delays: what solvers ask of a system, of it beside white noise or in other coordinates.

    Attributes:
        terms: the terms of the motion.
        jumps: the rays at which the state is stretched.
        epsilon: ε.
        stop: the wall of one coordinate of more than two variables; None without one.
        diffusions: ε^order B of every Bx ∘ dW by which white noise moves the state, see `Noise.motion`.
        impulses: what multiplies the state at random times.
        pasts: which variable each of the last columns of the terms stands for, and how long ago; none without a delay.
        clock: what its periodic coefficients are functions of; terms name this noise t.
        cubic: what is of degree 3 in its rates, on which the stationary response depends alone; None for nothing.
        forced: it with its terms of degree 0, which multiply a last variable, 1; None without such terms.
        names: of its variables; x₁, x₂, … without.
        columns: what the columns of terms multiply: variables, 1 with no name where it is forced, what is past.
        second_unit: its second variable over the second coordinate of the terms.
        quantities: those of its stationary response, where they have names of their own.
    """

    terms: Sequence[CoefficientMatrix] = field()
    jumps: Sequence[Jump] = ()
    epsilon: float = 1.0
    stop: Stop | None = None
    _: KW_ONLY
    diffusions: Sequence[CoefficientMatrix] = ()
    impulses: Sequence[Impulse] = ()
    pasts: Sequence[tuple[int, float]] = ()
    clock: Any = None
    cubic: CubicTerms | None = None
    forced: LinearMotion | None = None
    names: Sequence[str] = ()
    columns: Sequence[str] = ()
    second_unit: float = 1.0
    quantities: ResponseQuantities | None = None

    def linear(self) -> LinearMotion:
        return self

    @property
    def barriers(self) -> Sequence[Jump | Stop]:
        """Its jumps, or its stop."""
        return self.jumps if self.stop is None else (self.stop,)

    @cached_property
    def dimension(self) -> int:
        """n, that of the state with its `pasts`."""
        every: Sequence[CoefficientMatrix | Impulse] = (*self.terms, *self.diffusions, *self.impulses)
        return max((len(each.matrix) for each in every), default=2)

    @property
    def states(self) -> Sequence[str]:
        """The names of its variables."""
        return self.names or tuple(f"x{str(k + 1).translate(BELOW)}" for k in range(self.dimension))

    def by_noise(self, terms: Sequence[CoefficientMatrix] | None = None) -> dict[Driver, FloatArray]:
        """Sums, with the powers of ε, of what is steady, and of what each noise drives by each function; of its terms,
        or of others.
        """
        found: dict[Driver, FloatArray] = {STEADY: np.zeros((self.dimension, self.dimension))}
        for term in self.terms if terms is None else terms:
            (offset, slope), g = (line, identity) if (line := affine(term.g)) else ((0.0, 1.0), term.g)
            for driver, c in ((STEADY, offset), ((term.noise, g), slope)):
                if c:
                    found[driver] = found.get(driver, 0.0) + c * self.epsilon**term.order * np.array(term.matrix)
        return found

    def split_by_noise(
        self, terms: Sequence[CoefficientMatrix], name: str | None
    ) -> tuple[list[CoefficientMatrix], FloatArray]:
        """Terms without what a noise that has no value multiplies, and the sum of that, with the powers of ε.

        Args:
            terms: its own, or derivatives of these.
            name: what they call the noise; None for any.

        Raises:
            ValueError: a coefficient is no a + bξ.
        """
        steady, driven = [], np.zeros((self.dimension, self.dimension))
        for term in terms:
            if is_driven(term.g) and name not in (None, term.noise):
                steady.append(term)
                continue
            line = affine(term.g)
            if line is None:
                raise ValueError(
                    f"white noise has no value, so that g = {written_coefficient(term.g).strip()} of it has no "
                    "meaning; g must be a + b*xi"
                )
            offset, slope = line
            if offset:
                steady.append(CoefficientMatrix(term.order, offset * np.array(term.matrix)))
            driven += slope * self.epsilon**term.order * np.array(term.matrix)
        return steady, driven

    def matrix_at(self, xi: Xi, orders: slice = slice(None)) -> FloatArray:
        """A(ξ) = Σ ε^k g(ξ) A over the terms of some orders, shape (*ξ.shape, n, n).

        With several noises ξ is a mapping from their names to arrays, and its shape that of these broadcast together.
        """
        named, others = (xi, 0.0) if isinstance(xi, Mapping) else ({}, xi)
        shape = np.broadcast_shapes(np.shape(others), *map(np.shape, named.values()))
        total = np.zeros((*shape, self.dimension, self.dimension))
        wanted = range(1 + max((term.order for term in self.terms), default=0))[orders]
        for term in self.terms:
            if term.order in wanted:
                values = np.asarray(term.g(np.asarray(named.get(term.noise, others), dtype=float)))
                total += self.epsilon**term.order * values[..., None, None] * np.array(term.matrix)
        return total

    def phase_speed(self, xi: Xi) -> Harmonics:
        """dφ/dt at ξ as a function of φ: in Eq. (17) ω + ε h₁ξ + ε² h₂."""
        return turning(self.matrix_at(xi))

    def growth_rate(self, xi: Xi) -> Harmonics:
        """d ln a/dt at ξ as a function of φ: in Eq. (17) ε q₁ξ + ε² q₂ between the impacts."""
        return stretching(self.matrix_at(xi))

    def angular_frequency(self) -> float:
        """The system's own unit of rates: ω where its order 0 rotates, else the norm of the order 0.

        ω is the largest imaginary part of the eigenvalues of the matrix of order 0.
        """
        a = self.matrix_at(0.0, slice(0, 1))
        return float(np.max(np.linalg.eigvals(a).imag) or np.linalg.norm(a))

    @property
    def driven_by(self) -> Sequence[str]:
        """The names that its terms give the noises that drive it, in their order."""
        return tuple(dict.fromkeys(term.noise for term in (self.forced or self).terms if is_driven(term.g)))

    @property
    def responds(self) -> bool:
        """Whether there is more to it than its terms, so that it may have a stationary response."""
        return self.cubic is not None or self.forced is not None

    @property
    def response(self) -> ResponseQuantities:
        """The quantities of its stationary response."""
        given = linear_response(self.forced.names) if self.forced else self.quantities
        return given or response_quantities(self.states, has_wall=bool(self.jumps))

    @property
    def overshoot(self) -> float:
        """The largest factor by which ‖x‖ jumps upwards, 1 where it does not."""
        struck = [float(np.linalg.norm(each.matrix, 2)) for each in self.impulses]
        return max([1.0, *(math.exp(jump.log_factor) for jump in self.jumps), *struck])

    @property
    def rises_smoothly(self) -> bool:
        """Whether ‖x‖ is differentiable but where a wall makes it smaller."""
        return self.overshoot == 1.0 and not self.impulses and all(each.q.vanishes for each in self.diffusions)

    @property
    def aspect(self) -> float:
        """s in the amplitude a = √(x₁² + x₂²/s²) of its response: x₁ = a cos φ and x₂ = −s a sin φ.

        Where the matrix A of its terms at ξ = 0 has A₁₂A₂₁ < 0, s² = −A₂₁/A₁₂, ω² for ẋ = v, v̇ = −ω²x + …, and else 1.
        """
        (_, b), (c, _) = self.matrix_at(0.0).tolist()
        return self.second_unit * (math.sqrt(-c / b) if b * c < 0 else 1.0)


def kept_phases(matrices: Sequence[FloatArray]) -> tuple[float, ...]:
    """φ of the rays of a plane that all matrices keep, none or two, or one; 0 where they keep all rays."""
    if len(matrices[0]) > 2:
        return ()
    pairs = [(turning(each), ROUNDED * float(np.linalg.norm(each))) for each in matrices]
    turns = [(speed, limit) for speed, limit in pairs if abs(speed.mean) + speed.amplitude > limit]
    if not turns:
        return (0.0,)
    first, _ = turns[0]
    if abs(first.mean) > first.amplitude * (1 + 1e-12):
        return ()
    middle = math.atan2(first.sine, first.cosine)
    away = math.acos(min(max(-first.mean / first.amplitude, -1.0), 1.0))
    found = {0.5 * (middle + away) % math.pi, 0.5 * (middle - away) % math.pi}
    return tuple(phi for phi in sorted(found) if all(abs(float(speed(phi))) <= limit for speed, limit in turns))


def as_plane(terms: Sequence[CoefficientMatrix], *, has_turn: bool = True) -> tuple[CoefficientMatrix, ...]:
    """Terms ax of one variable as (a + J)x of two, J a uniform rotation: others as they are.

    ‖x‖ grows by a alone, whatever the phase is, so that T and P are functions of the noise alone, and Λ(p) is the same.

    Args:
        terms: of one variable, or of more.
        has_turn: whether J is added, whose speed is a power of four below the largest a; False for derivatives.
    """
    if any(len(term.matrix) > 1 for term in terms):
        return tuple(terms)
    size = max((abs(term.matrix[0][0]) for term in terms), default=0.0) or 1.0
    speed = 4.0 ** math.floor(math.log(size, 4))
    turn = CoefficientMatrix(0, ((0.0, speed), (-speed, 0.0)))
    return *[turn] * has_turn, *(replace(term, matrix=term.matrix[0][0] * np.eye(2)) for term in terms)


def common_unit(values: Sequence[float], name: str) -> tuple[float, int]:
    """What positive numbers are multiples of, and the largest multiple. Raises `ValueError` where there is nothing."""
    numbers = np.unique(values)
    multiples = numbers / numbers[-1] * np.arange(1, MOST_MULTIPLE + 1)[:, None]
    fits = np.all(np.abs(multiples - np.round(multiples)) <= SAME_DELAY * multiples, axis=1)
    if not fits.any():
        told = f"got the {name} {', '.join(f'{each:.10g}' for each in numbers)}"
        raise ValueError(f"{told}; must be multiples of one number, the largest at most {MOST_MULTIPLE} times it")
    count = int(np.argmax(fits)) + 1
    return float(numbers[-1]) / count, count


def squared_frequency(a: FloatArray) -> FloatArray:
    """det A − (tr A/2)² for matrices of shape (…, 2, 2): ω² where the eigenvalues are complex, negative where real."""
    half = 0.5 * (a[..., 0, 0] + a[..., 1, 1])
    return a[..., 0, 0] * a[..., 1, 1] - a[..., 0, 1] * a[..., 1, 0] - half**2


def rotating_coordinates(a: FloatArray) -> FloatArray | None:
    """P for which P⁻¹AP is growth and a rotation: 1 where A is that already, None where it does not rotate."""
    half, square = 0.5 * (a[0, 0] + a[1, 1]), float(squared_frequency(a))
    if not square > 0:
        return None
    if a[0, 1] == -a[1, 0] and a[0, 0] == a[1, 1]:
        return np.eye(2)
    return np.array([[a[0, 1], 0.0], [half - a[0, 0], math.sqrt(square)]])
