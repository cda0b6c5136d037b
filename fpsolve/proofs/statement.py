"""What a proof is about: a system and its noise in floats that are taken as exact, and L(p) in balls.

The motion ẋ = (A₀ + ξ A₁) x has in x = ‖x‖ (cos φ, −sin φ) the phase speed h₀ + ξ h₁, h = e′ᵀA e, and the growth rate
q₀ + ξ q₁, q = eᵀA e, of ln ‖x‖. At a ray the speed has one sign σ for all ξ, and x⁺ = R x⁻. The phase is gauged:
T = e^{p s(φ)} u, where the sawtooth s falls by σ ln R at each ray and rises by κ = Σ σ ln R/π per radian between them,
makes u continuous. With z the noise in a unit of its own, e^{-ps} L(p) e^{ps} is

    L = ν (½ ∂zz − b(z) ∂z) + F₀ + z F₁,      F = h(φ) (∂φ + pκ) + p q(φ),

h₁ and q₁ times that unit. For Eq. (18), h₀ = ω + ε² c₁ ½ sin 2φ, q₀ = ε² c₁ ½ (1 − cos 2φ), and h₁, q₁ are the same
functions times ε, without ω.
For the Ornstein-Uhlenbeck process, Eqs. (13)-(15), the unit is its standard deviation, ν = 2α₀ and b = z/2. For Eq. (7)
with r₀ < 1 it is the end of the support, ν = (1 − r₀)/τ₀ and b = a z/(1 − z²) with a = 1/(1 − r₀). For the sine-Wiener
process it is the amplitude, z = cos θ and the noise has ½ σ² ∂θθ; for a chain it is 1 and the noise has the matrix of
its rates, u a component for each state. White noise has L = F₀ + ½ F₁² in the sense of Stratonovich, its unit is s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from fpsolve.arrays import FloatArray, identity, one
from fpsolve.errors import NoSuchExponent
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.noise import Noise
from fpsolve.model.noises.bounded import SineWiener
from fpsolve.model.noises.markov_chain import Chain
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.noises.ornstein_uhlenbeck import GaussianNoise
from fpsolve.model.noises.several import noises_of
from fpsolve.model.noises.white import Interpretation, White
from fpsolve.model.plane import (
    STEADY,
    CoefficientMatrix,
    LinearMotion,
    rotating_coordinates,
    written_coefficient,
)
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.model.systems.plane_system import LinearSystem
from fpsolve.proofs.balls import Balls, ball, balls, complex_ball

if TYPE_CHECKING:
    from flint import arb

MOST_STATES = 400
KNOWN = "OrnsteinUhlenbeck, NonGaussianNoise, SineWiener, Telegraph, MarkovChain and White"
"""Noises for which a proof is known."""
NEAR = 1e-12
"""How near a multiple of π/4 a phase is taken as that."""
Row = Annotated[list[float], Field(min_length=2, max_length=2)]
Matrix = Annotated[list[Row], Field(min_length=2, max_length=2)]
SquareMatrix = Annotated[list[list[float]], Field(min_length=1)]
OctantRays = ((1, 0), (1, -1), (0, -1), (-1, -1))
"""Along (cos φ, −sin φ) for φ = 0, π/4, π/2 and 3π/4."""
BasisKind = Literal["core", "whole", "circle", "states"]
"""Kinds of functions that a function of the noise in a proof may be made of, see `fpsolve.proofs.basis`."""
BASES: Mapping[str, tuple[BasisKind, ...]] = {
    "gaussian": ("core",),
    "bounded": ("core", "whole"),
    "circle": ("circle",),
    "chain": ("states",),
    "white": ("states",),
}
"""Those that functions of each kind of noise may be made of."""


class Record(BaseModel):
    """A part of a proof; numbers are floats that are taken as exact."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class JumpRecord(Record):
    """x⁺ = e^{log_factor} x⁻ where x passes the line through the ray."""

    ray: Row
    log_factor: float


class NoiseRecord(Record):
    """The law of z = ξ/unit.

    Attributes:
        kind: "gaussian" and "bounded" of dz = −ν b(z) dt + √ν dW, where b = slope z, and b = slope z/(1 − z²) with
            |z| < 1; "circle" of z = cos θ with dθ = √ν dW; "chain"; "white" of z dt = dW in Stratonovich's sense, which
            is a chain that rests in one state.
        states, rates: of a chain, from each state to each; what stands on the diagonal does not count.
    """

    kind: Literal["gaussian", "bounded", "circle", "chain", "white"]
    unit: Annotated[float, Field(gt=0)] = 1.0
    nu: Annotated[float, Field(ge=0)] = 0.0
    slope: Annotated[float, Field(ge=0)] = 0.0
    states: list[float] = []
    rates: list[list[float]] = []

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        size = len(self.states)
        if [*map(len, self.rates)] != size * [size]:
            raise ValueError("rates must be from each state to each")
        if any(rate < 0 for i, row in enumerate(self.rates) for j, rate in enumerate(row) if i != j):
            raise ValueError("rates from one state to another must be >= 0")
        if bool(size) != (self.kind in ("chain", "white")):
            raise ValueError("a chain has states; nothing else has")
        if self.kind in ("gaussian", "bounded") and not min(self.nu, self.slope) > 0:
            raise ValueError("nu and slope must be positive")
        return self

    @classmethod
    def of(cls, noise: Noise) -> NoiseRecord:
        """The law of a noise.

        Raises:
            NoSuchExponent: no bound can be proven for these parameters.
            TypeError: no proof is known for such a noise, or a chain has too many states.
        """
        if type(noise) is NonGaussianNoise:
            if noise.r0 > 1:
                raise NoSuchExponent(
                    Message(Code.NO_BOUND, key=f"{noise.section}.r0", value=noise.r0, remedy=Remedy.REDUCTION)
                )
            if noise.r0 < 1:
                return cls(
                    kind="bounded", unit=noise.half_width, nu=(1 - noise.r0) / noise.tau0, slope=noise.end_exponent
                )
            noise = noise.ou_reduction()
        if isinstance(noise, GaussianNoise):
            return cls(kind="gaussian", unit=noise.standard_deviation, nu=2 * noise.alpha, slope=0.5)
        if type(noise) is SineWiener:
            return cls(kind="circle", unit=noise.amplitude, nu=noise.sigma**2)
        if type(noise) is White:
            return cls(kind="white", unit=noise.s, states=[0.0], rates=[[0.0]])
        if noise.is_white or not isinstance(noise, Chain):
            raise TypeError(f"got {type(noise).__name__}; proofs are for {KNOWN}")
        if len(noise.states) > MOST_STATES:
            raise TypeError(f"got a chain of {len(noise.states)} states; proofs are for {MOST_STATES} at most")
        return cls(kind="chain", states=[*noise.states], rates=[*map(list, noise.rates)])

    @property
    def bases(self) -> tuple[BasisKind, ...]:
        """What functions of the noise may be made of."""
        return BASES[self.kind]

    def passing(self, still: Fraction, driven: Fraction) -> int:
        """The sign of still + ξ driven for all ξ of the noise; 0 where it has none."""
        driven *= Fraction(self.unit)
        if self.kind == "chain":
            signs = {_sign(still + driven * Fraction(state)) for state in self.states}
            return signs.pop() if len(signs) == 1 else 0
        is_one = abs(driven) < abs(still) if self.kind in ("bounded", "circle") else not driven
        return _sign(still) if is_one else 0


class Statement(Record):
    """ẋ = (A₀ + ξ A₁) x in the sense of Stratonovich, with jumps, and its noise.

    Attributes:
        still, driven: A₀ and A₁.
        coordinates: P of x = P y; the phase and the size of which a proof speaks are those of y. Λ is the same.
    """

    still: Matrix
    driven: Matrix
    jumps: list[JumpRecord]
    coordinates: Matrix
    noise: NoiseRecord

    @classmethod
    def of(cls, problem: Problem) -> Statement:
        """Those of a problem.

        Raises:
            NoSuchExponent: no bound can be proven for these parameters.
            TypeError: a coefficient is not a + bξ, or no proof is known for such a noise.
            ValueError: the speed of the phase at the ray of a jump has no one sign.
        """
        system, noise = problem.linear, problem.noise
        sums = system.by_noise()
        still = sums.pop(STEADY)
        for _, g in sums:
            if g != identity:
                told = written_coefficient(g).strip()
                raise TypeError(f"got the coefficient {told}; proofs are for coefficients a + b ξ")
        driven = sum(sums.values(), np.zeros((2, 2)))
        if type(noise) is White and noise.interpretation == Interpretation.ITO:
            still = still - noise.s**2 / 2 * driven @ driven
        found = cls(
            still=still.tolist(),
            driven=driven.tolist(),
            jumps=[JumpRecord(ray=ray_of(jump.phase), log_factor=float(jump.log_factor)) for jump in system.jumps],
            coordinates=_rotating(system),
            noise=NoiseRecord.of(noise),
        )
        _ = found.directions
        return found

    @property
    def directions(self) -> list[int]:
        """σ of each jump. Raises `ValueError` where the speed of the phase at a ray has no one sign."""
        change, still, driven = map(_fractions, (self.coordinates, self.still, self.driven))
        turn = _sign(change[0, 0] * change[1, 1] - change[0, 1] * change[1, 0])
        found = []
        for jump in self.jumps:
            x, y = _fractions(jump.ray)
            speeds = (y * first - x * second for first, second in (still @ (x, y), driven @ (x, y)))
            found.append(turn * self.noise.passing(*speeds))
            if not found[-1]:
                ray = ", ".join(f"{each:g}" for each in jump.ray)
                raise ValueError(
                    f"got a jump at the ray of ({ray}), where the speed of the phase has no one sign; proofs are for "
                    "jumps at rays over which no noise moves the phase"
                )
        return found


class LinearRecord(Record):
    """A motion of more than two variables under white noise.

    Attributes:
        drift, diffusions: A, and all B_k, in Stratonovich's sense.
    """

    drift: SquareMatrix
    diffusions: list[SquareMatrix]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if any(np.shape(each) != 2 * (len(self.drift),) for each in (self.drift, *self.diffusions)):
            raise ValueError("matrices must be square and of one size")
        return self

    @classmethod
    def of(cls, problem: Problem) -> LinearRecord:
        """The matrices of a problem. Raises `TypeError` where its noise is not white."""
        if problem.linear.barriers:
            raise TypeError("got a wall of more than two variables, where moments obey no closed equations; remove it")
        moved = problem.noise.motion(problem.linear)
        whole = moved.terms, moved.diffusions
        parts, noisy = ([moved.epsilon**each.order * np.array(each.matrix) for each in terms] for terms in whole)
        steady = sum(parts, np.zeros(2 * (problem.dimension,)))
        is_moved = np.any([steady, *noisy], axis=(0, 2))
        if not is_moved.all() or {*map(type, problem.noise.parts.values())} != {White}:
            told = f"got a system of {problem.dimension} variables under other noise than white, or with a delay"
            raise TypeError(f"{told}; proofs are for two variables under {KNOWN}, and for more under White")
        return cls(drift=steady.tolist(), diffusions=[each.tolist() for each in noisy])

    def problem(self, factor: FloatArray) -> Problem:
        """That of y = G x."""
        turned = [(factor @ np.array(a) @ np.linalg.inv(factor)).tolist() for a in (self.drift, *self.diffusions)]
        terms = [CoefficientMatrix(int(k > 0), a, identity if k else one, str(k or "")) for k, a in enumerate(turned)]
        return Problem(LinearSystem(terms), noises_of({str(k): White(s=1.0) for k in range(1, len(turned))}))


def statement_of(problem: Problem) -> Statement | LinearRecord:
    """A problem by its matrices and rates, as floats.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
        TypeError: no proof is known for such a system with such a noise.
        ValueError: the speed of the phase at the ray of a jump has no one sign.
    """
    checked_problem(problem)
    if problem.dimension > 2:
        return LinearRecord.of(problem)
    if len(problem.noise.parts) > 1:
        raise TypeError(f"got the noises {' and '.join(problem.noise.parts)} at once; proofs are for one noise")
    return Statement.of(problem)


def ray_of(phase: float) -> list[float]:
    """A direction with a phase: whole numbers near a multiple of π/4, else cos φ and −sin φ as floats."""
    octants = phase / (math.pi / 4)
    if abs(octants - round(octants)) <= NEAR:
        return [float(each) for each in OctantRays[round(octants) % 4]]
    return [math.cos(phase), -math.sin(phase)]


def _rotating(system: LinearMotion) -> list[list[float]]:
    """P for which P⁻¹A₀P is growth and a rotation, or the identity where the order 0 does not rotate."""
    found = rotating_coordinates(system.matrix_at(0.0, slice(0, 1)))
    return (np.eye(2) if found is None else found).tolist()


def _fractions(numbers: list[float] | list[list[float]]) -> Balls:
    """The exact values of floats."""
    found: Balls = np.vectorize(Fraction, otypes=[object])(numbers)
    return found


def _sign(number: Fraction) -> int:
    return (number > 0) - (number < 0)


@dataclass(frozen=True)
class Cylinder:
    """L(p) between jumps, gauged, in balls.

    Attributes:
        law: of the noise.
        h, q: phase speed and growth rate, h₀ and h₁, q₀ and q₁, each by its coefficients of e^{2idφ}, d = −1, 0, 1.
        kappa: κ.
        nu, slope: ν and b′(0).
        states, rates: of a chain, shapes (n,) and (n, n); None of other noise.
    """

    law: NoiseRecord
    h: tuple[Balls, Balls]
    q: tuple[Balls, Balls]
    kappa: arb
    nu: arb
    slope: arb
    states: Balls | None
    rates: Balls | None

    @property
    def is_bounded(self) -> bool:
        """Whether b = b′(0) z/(1 − z²), |z| < 1."""
        return self.law.kind == "bounded"

    @property
    def is_white(self) -> bool:
        """Whether L = F₀ + ½ F₁²."""
        return self.law.kind == "white"

    def drift(self, z: Balls) -> Balls:
        """b(z)."""
        return self.slope * z / (1 - z * z) if self.is_bounded else self.slope * z

    def drift_slope(self, z: Balls) -> Balls:
        """b′(z)."""
        return self.slope * (1 + z * z) / (1 - z * z) ** 2 if self.is_bounded else self.slope + 0 * z

    def bands(self, i: int, p: arb, waves: int) -> Balls:
        """F_i from mode k to mode k + d, shape (3, 2 waves + 1), d = −1, 0, 1 and k = −waves … waves."""
        turns = np.array([complex_ball(0, 2 * k) + p * self.kappa for k in range(-waves, waves + 1)], dtype=object)
        return np.outer(self.h[i], turns) + p * self.q[i][:, None]

    def growth(self, i: int) -> Balls:
        """q_i + κ h_i, the derivative of F_i 1 by p, at the modes −1, 0, 1."""
        return self.q[i] + self.kappa * self.h[i]


def cylinder(stated: Statement) -> Cylinder:
    """L(p) for a statement."""
    noise, kappa = stated.noise, ball(0)
    for jump, direction in zip(stated.jumps, stated.directions, strict=True):
        kappa += direction * ball(jump.log_factor) / kappa.pi()
    change = balls(stated.coordinates)
    (a, b), (c, d) = change
    back = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    still, driven = (_polar(back @ balls(matrix) @ change) for matrix in (stated.still, stated.driven))
    states, rates = balls(noise.states), balls(noise.rates)
    if noise.states:
        rates = rates - np.diag(np.diagonal(rates))
        rates = rates - np.diag(rates.sum(axis=1))
    return Cylinder(
        law=noise,
        h=(still[0], driven[0] * ball(noise.unit)),
        q=(still[1], driven[1] * ball(noise.unit)),
        kappa=kappa,
        nu=ball(noise.nu),
        slope=ball(noise.slope),
        states=states if noise.states else None,
        rates=rates if noise.states else None,
    )


def _polar(a: Balls) -> tuple[Balls, Balls]:
    """h and q of a matrix of real balls."""
    (first, second), (third, fourth) = a / 2
    turning = _wave(second - third, -second - third, fourth - first)
    return turning, _wave(first + fourth, first - fourth, -second - third)


def _wave(mean: arb, cosine: arb, sine: arb) -> Balls:
    """Coefficients of mean + cosine cos 2φ + sine sin 2φ."""
    return np.array(
        [complex_ball(cosine / 2, sine / 2), complex_ball(mean), complex_ball(cosine / 2, -sine / 2)], dtype=object
    )
