"""What solvers ask of a noise ξ(t), with what most of them answer; its kinds are in `noises`.

A diffusion obeys dξ = b(ξ) dt + σ(ξ) dW and has a stationary density P_s with b P_s = ½(σ² P_s)′, so that the noise's
part of the generator is self-adjoint in P_s. Solvers do not tell kinds apart: what they need to know is stated here.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import Coefficient, FloatArray
from fpsolve.model.parameters import Parametrised, Words
from fpsolve.model.plane import LinearMotion, ParameterDerivative, System, Xi
from fpsolve.model.plane import NoiseDerivative as NoiseDerivative

STAY = 'write xi = "stationary"'
"""What to do where a value of ξ is no start."""


class Noise(Parametrised):
    """A stationary process ξ(t) that drives a system. Most kinds are diffusions dξ = b(ξ) dt + σ(ξ) dW.

    P_s is the stationary density of ξ, and z = ξ/std is ξ in noise units. The defaults below hold for most kinds; a
    kind overrides those that do not hold for it.

    Attributes:
        left_in_phase: share of the effect of two modes of φ that is left at least where T is not analytic, as where the
            phase rests in a state, or at φ that white noise does not move: there it falls unevenly, and ever more
            slowly.
    """

    section: ClassVar[str] = "noise"
    left_in_phase: ClassVar[float] = 0.0
    naming = Words.model_fields

    @property
    def of_xi(self) -> Mapping[str, str]:
        """By the names of the parameters whose unit contains that of ξ their units, {} in place of that of ξ and "*".

        Their declared unit is that for ξ in 1/time.
        """
        return {}

    @property
    def has_states(self) -> bool:
        """Whether ξ jumps between states.

        Such noise has no density, so that `log_density`, `diffusion` and what follows from them do not apply.
        """
        return False

    @property
    def is_white(self) -> bool:
        """Whether ξ has no value, as for white noise and impulses.

        Solvers see such noise as a chain with the only state ξ = 0; it moves the system by diffusion or by impulses,
        see `motion`.
        """
        return False

    @property
    def variables(self) -> int:
        """How many numbers, without the white noises, tell how it goes on."""
        return 1

    @property
    def may_tilt(self) -> bool:
        """Whether a factor exp(s ξ) makes functions of ξ easier to resolve, as where P_s has a single peak."""
        return True

    @property
    def has_peak(self) -> bool:
        """Whether the spectral density may have a high peak at a frequency of the noise itself."""
        return False

    @property
    def approximates_spectrum(self) -> bool:
        """Whether `spectral_density` is that of a simpler process which replaces this one."""
        return False

    @property
    def sense(self) -> str:
        """Whose definition of the stochastic integral holds, such as "Itô's"; empty where all of them agree."""
        return ""

    @property
    def parts(self) -> Mapping[str, Noise]:
        """The independent noises that this one consists of, by their names in the terms; by default itself alone."""
        return {"": self}

    @property
    def valued(self) -> Noise:
        """Of several noises those that have values; where all are white, the first of them."""
        return self

    @property
    @abstractmethod
    def standard_deviation(self) -> float:
        """Stationary standard deviation of ξ: one noise unit, z = ξ/std."""

    @property
    @abstractmethod
    def correlation_time(self) -> float:
        """The time over which ξ is correlated; it need only be right up to a factor."""

    @abstractmethod
    def spectral_density(self, omega: float) -> float:
        """S(ω) = ∫ C(t) cos ωt dt over −∞ < t < ∞, where C is the autocovariance of ξ."""

    @property
    def mean(self) -> float:
        """Stationary mean of ξ."""
        return 0.0

    def mean_of(self, g: Coefficient) -> float:
        """A coefficient of ξ about its middle."""
        return float(g(self.mean))

    @property
    def has_algebraic_tails(self) -> bool:
        """Whether P_s falls off like a power of ξ: moments far out are infinite, and no Λ(p), p ≠ 0, is computed."""
        return False

    @property
    def basis(self) -> Literal["polynomials", "cells", "states", "waves", "pairs"]:
        """The basis in which functions of the noise are expanded.

        "polynomials" are orthogonal with the weight P_s. "cells" are finite elements on the line of ξ. "states" are the
        values at the states of a chain. "waves" are Fourier modes of an angle, of which ξ is a function; the noise then
        states `nu`, `sigma` and `of_angle`. "pairs" are products of Hermite polynomials of two variables u that obey
        du = −Mu dt + N dW with the stationary covariance 1, and ξ = std u₁; the noise then states M as `drift_matrix`.
        """
        return "states" if self.has_states else "cells" if self.has_algebraic_tails else "polynomials"

    @property
    def is_diffusion(self) -> bool:
        """Whether ξ is a diffusion by itself, so that b, σ and P_s define it."""
        return self.basis in ("polynomials", "cells")

    @property
    def is_markov(self) -> bool:
        """Whether ξ is a Markov process by itself, so that T is a function of φ and ξ."""
        return self.is_diffusion or self.has_states

    @property
    def is_random(self) -> bool:
        """Whether ξ is random after its start; False for a harmonic load with a random phase."""
        return not self.period

    @property
    def period(self) -> float:
        """The period of a periodic noise; 0 for others."""
        return 0.0

    @property
    def half_width(self) -> float:
        """Half the width of the support of ξ, which is (−half_width, half_width); ∞ for the whole line."""
        return math.inf

    @property
    def is_bounded(self) -> bool:
        """Whether ξ stays within a finite interval."""
        return self.has_states or math.isfinite(self.half_width)

    @property
    def end_exponent(self) -> float:
        """The exponent a of P_s ~ (half_width − |ξ|)^a at the ends of a bounded support; 0 on the whole line."""
        return 0.0

    @property
    def reached(self) -> FloatArray:
        """Values of ξ that sample its whole range, at most 12 std wide to each side; shape (n,).

        They increase; those of a chain are its states, in their order.
        """
        return np.asarray(min(self.half_width, 12 * self.standard_deviation) * np.linspace(-1, 1, 1001))

    def combined(self, values: Sequence[ArrayLike]) -> Xi:
        """ξ of all combinations of some values of each of its `parts`, as `matrix_at` takes it."""
        return values[0]

    @property
    def extremes(self) -> Xi:
        """The ends of the range where ξ is mostly; of a chain all states; of several noises all combinations."""
        return min(2 * self.standard_deviation, self.half_width) * np.array([-1.0, 1.0])

    def misfit(self, xi: float) -> str:
        """Why no path that is told by ξ alone starts there, after a sentence "got xi = 1"; empty where one does."""
        if not self.is_markov:
            return f", but its value alone does not tell how it goes on; {STAY}"
        return "" if abs(xi) < self.half_width else f"; must be between -{self.half_width:g} and {self.half_width:g}"

    @property
    def diffusion(self) -> float:
        """σ, the coefficient of dW; where it is not constant, its value at ξ = 0."""
        raise NotImplementedError

    def squared_diffusion(self, xi: ArrayLike) -> FloatArray:
        """σ²(ξ), in the shape of ξ; by default the square of the constant `diffusion`."""
        return np.full_like(np.asarray(xi, dtype=float), self.diffusion**2)

    @property
    def relaxation_time(self) -> float:
        """The relaxation time 2⟨ξ²⟩/σ², which is 1/α₀ for the Ornstein-Uhlenbeck process."""
        return 2 * (self.standard_deviation / self.diffusion) ** 2

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """ln P_s(ξ), in the shape of ξ; −∞ outside the support."""
        raise NotImplementedError

    def density(self, xi: ArrayLike) -> FloatArray:
        """The stationary density P_s(ξ), in the shape of ξ; 0 outside the support."""
        return np.exp(self.log_density(xi))

    def holding_cost(self, xi: FloatArray) -> FloatArray:
        """The rate at which the probability falls that ξ stays near a value, about ⅛σ²((ln P_s)′)².

        Args:
            xi: values of ξ, increasing, shape (n,).
        """
        return 0.125 * self.squared_diffusion(xi) * np.gradient(self.log_density(xi), xi, edge_order=2) ** 2

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """Stationary initial values of the paths of a simulation: ξ, or the numbers of states, shape (size,).

        Noise that is no Markov process by itself returns an array of the shape (rows, size). The first row is ξ, and
        the others are the variables on which its future depends.
        """
        raise NotImplementedError

    def step(self, h: float, bias: float = 0.0) -> tuple[object, ...]:
        """One step of length h of dξ = (f(ξ) + σ²·bias) dt + σ dW, for the simulation; see `noises.steps`.

        It follows from this equation alone, without P_s, so that the simulation is independent of what follows from
        P_s. A kind without `step` is not simulated.
        """
        raise NotImplementedError

    @property
    def largest_step(self) -> float:
        """The longest time step with which `step` has an error of about 1e-4."""
        raise NotImplementedError

    @property
    def is_simulated(self) -> bool:
        """Whether this kind states a `step`."""
        return type(self).step is not Noise.step

    @property
    def takes_bias(self) -> bool:
        """Whether a simulation may add σ²b to the drift and weigh paths: σ is constant, and exp(b ξ) has a mean."""
        return self.may_tilt and type(self).squared_diffusion is Noise.squared_diffusion

    def motion(self, system: LinearMotion, name: str | None = None) -> LinearMotion:
        """How this noise moves a system whose terms call it so, with None whatever; by default along a path of ξ.

        Raises:
            ValueError: it has algebraic tails, and there are more than two variables.
        """
        if self.has_algebraic_tails and system.dimension > 2:
            raise ValueError(
                f"got {self.kind} noise for {system.dimension} variables; noise with algebraic tails is for two "
                "variables only: take another kind, or r0 <= 1"
            )
        return system

    def driving(self, system: System) -> Noise:
        """The noises of these that drive a part of the system; the first one where none does."""
        return self

    def changed_motion(
        self, system: LinearMotion, changed: ParameterDerivative, by: str = "", name: str | None = None
    ) -> ParameterDerivative:
        """The derivative ∂/∂θ of the `motion`.

        Args:
            system: the system.
            changed: that of its terms and jumps; nothing if θ is a parameter of the noise.
            by: the name of θ if it is a parameter of the noise, else empty.
            name: what the terms call the noise.
        """
        return changed

    @property
    def one_sided(self) -> Sequence[str]:
        """The names of the parameters by which only the derivative from below exists, at their present values."""
        return ()

    def derivative(self, name: str) -> NoiseDerivative:
        """The derivative of the noise by one of its `differentiable` parameters."""
        raise NotImplementedError(f"{type(self).__name__} states no derivative by {name}")


class Gaussian(Noise):
    """Noise whose law is Gaussian."""

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """The logarithm of the Gaussian density with the standard deviation of ξ."""
        z = np.asarray(xi, dtype=float) / self.standard_deviation
        return -0.5 * z**2 - math.log(math.sqrt(2 * math.pi) * self.standard_deviation)
