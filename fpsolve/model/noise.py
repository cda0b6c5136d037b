"""What solvers ask of a noise ξ(t), with what most of them answer; its kinds are in `noises`.

A diffusion obeys dξ = b(ξ) dt + σ(ξ) dW and has a stationary density P_s with b P_s = ½(σ² P_s)′, so that the noise's
part of the generator is self-adjoint in P_s. Solvers do not tell kinds apart: what they need to know is stated here.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import Coefficient, FloatArray, nothing
from fpsolve.errors import NoSuchExponent
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.exact import ExactLaw
from fpsolve.model.parameters import Parametrised
from fpsolve.model.plane import CoefficientMatrix, Impulse, ImpulseDerivative, System


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


class Noise(Parametrised):
    """A stationary process that drives a system; what follows holds for most kinds.

    Attributes:
        has_states: whether ξ jumps between states; it then has no density, and what is said of that does not apply.
        mixes_slowly: whether ξ may hardly ever leave some states for others, so that these have a positive eigenpair.
        approximates_spectrum: whether `spectral_density` is that of a process which stands for this one.
        tails_beyond: the name of a parameter, the value above which P_s has algebraic tails, and what else to do.
        may_tilt: whether functions of ξ gain by a factor exp(s ξ), as where P_s falls to both sides.
        has_peak: whether its spectral density may be largest, and very large, at a frequency of its own.
        is_white: whether it has no value; it then has one state, ξ = 0, and moves what it drives by diffusion, see
            `motion`, or by impulses.
        of_xi: the names of parameters whose unit is that of ξ, or made of it; it is stated for ξ in 1/time.
    """

    section: ClassVar[str] = "noise"
    has_states: ClassVar[bool] = False
    mixes_slowly: ClassVar[bool] = False
    approximates_spectrum: ClassVar[bool] = False
    tails_beyond: ClassVar[tuple[str, float, str] | None] = None
    may_tilt: ClassVar[bool] = True
    has_peak: bool = False
    is_white: ClassVar[bool] = False
    of_xi: ClassVar[Sequence[str]] = ()

    @property
    def sense(self) -> str:
        """Whose sense the equation is meant in, as "Itô's"; empty where all senses are the same."""
        return ""

    @property
    def parts(self) -> Mapping[str, Noise]:
        """The independent noises that it is made of, by the names that terms have; here only itself."""
        return {"": self}

    @property
    @abstractmethod
    def standard_deviation(self) -> float:
        """Stationary standard deviation of ξ: one noise unit, z = ξ/std."""

    @property
    @abstractmethod
    def correlation_time(self) -> float:
        """About how long ξ remembers its value."""

    @abstractmethod
    def spectral_density(self, omega: float) -> float:
        """S(ω) = ∫ C(t) cos ωt dt over all t, C the autocovariance."""

    @property
    def mean(self) -> float:
        """Stationary mean of ξ."""
        return 0.0

    @property
    def moments(self) -> tuple[float, float]:
        """The p for which Λ(p) of a system linear in ξ is finite, as a closed interval."""
        return -math.inf, math.inf

    @property
    def has_algebraic_tails(self) -> bool:
        """Whether P_s falls like a power of ξ only, so that not all moments are finite."""
        return math.isfinite(self.moments[1])

    @property
    def basis(self) -> Literal["polynomials", "cells", "states", "waves", "pairs"]:
        """What the functions of the noise are made of: orthogonal polynomials of P_s, cells of a line, states, waves.

        The waves are those of an angle, of which ξ is a function; the noise then states `nu`, `sigma` and `of_angle`.
        Pairs are products of Hermite polynomials of u, du = −Mu dt + N dW with the stationary covariance 1 and
        ξ = std u₁; the noise then states M as `drift_matrix`.
        """
        return "states" if self.has_states else "cells" if self.has_algebraic_tails else "polynomials"

    @property
    def is_diffusion(self) -> bool:
        """Whether ξ by itself is a diffusion, so that b, σ and P_s tell all of it."""
        return self.basis in ("polynomials", "cells")

    @property
    def is_drawn(self) -> bool:
        """Whether T makes a picture: a surface over (φ, ξ), or a line for each state."""
        return self.is_diffusion or self.has_states

    @property
    def is_random(self) -> bool:
        """Whether more of it is random than where it starts."""
        return True

    @property
    def period(self) -> float:
        """After which it repeats itself for ever; 0 where it does not."""
        return 0.0

    @property
    def shaped_by(self) -> Sequence[str]:
        """The names of the parameters on which the law of ξ in noise units depends, more than on its words."""
        return tuple(name for name in self.values if name not in self.words)

    @property
    def half_width(self) -> float:
        """The support of ξ is (−half_width, half_width); ∞ where it is the whole line."""
        return math.inf

    @property
    def is_bounded(self) -> bool:
        """Whether ξ stays within an interval."""
        return self.has_states or math.isfinite(self.half_width)

    @property
    def end_exponent(self) -> float:
        """a in P_s ~ (half_width − |ξ|)^a at the ends of a bounded support; 0 on the whole line."""
        return 0.0

    @property
    def reached(self) -> FloatArray:
        """Values of ξ, increasing or its states, that go as far as the noise does where that matters, shape (n,)."""
        return np.asarray(min(self.half_width, 1e6 * self.standard_deviation) * np.linspace(-1, 1, 1001))

    @property
    def largest_jump_rate(self) -> float:
        """The highest rate at which ξ leaves a state; 0 for continuous paths."""
        return 0.0

    @property
    def longest_jump(self) -> int:
        """How many states further ξ jumps at most; 0 for continuous paths."""
        return 0

    @property
    def diffusion(self) -> float:
        """σ, the coefficient of dW, where it is constant; else its value at ξ = 0."""
        raise NotImplementedError

    def squared_diffusion(self, xi: ArrayLike) -> FloatArray:
        """σ²(ξ), of the shape of ξ."""
        return np.full_like(np.asarray(xi, dtype=float), self.diffusion**2)

    @property
    def relaxation_time(self) -> float:
        """2⟨ξ²⟩/σ², the time in which ξ forgets its value: 1/α₀ for the Ornstein-Uhlenbeck process."""
        return 2 * (self.standard_deviation / self.diffusion) ** 2

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """ln P_s(ξ) of the stationary density; −∞ outside the support."""
        raise NotImplementedError

    def density(self, xi: ArrayLike) -> FloatArray:
        """P_s(ξ); 0 outside the support."""
        return np.exp(self.log_density(xi))

    def holding_cost(self, xi: FloatArray) -> FloatArray:
        """At which rate paths that hold ξ at these increasing values get rarer, about ⅛σ²((ln P_s)′)²."""
        return 0.125 * self.squared_diffusion(xi) * np.gradient(self.log_density(xi), xi) ** 2

    def sample(self, size: int, rng: np.random.Generator) -> FloatArray:
        """Independent values of ξ from the stationary law, shape (size,)."""
        raise NotImplementedError

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """What paths of a simulation start from, by the stationary law: ξ, or the numbers of states, shape (size,).

        Of noise that is no Markov process by itself it has more rows, shape (numbers, size): ξ, and what else its
        future depends on.
        """
        return self.sample(size, rng)

    def step(self, h: float, bias: float = 0.0) -> Any:
        """One step of length h of dξ = (f(ξ) + σ² b) dt + σ dW, b the bias, for the simulation.

        It is written from this equation alone, without P_s, so that the simulation is a witness of what is made of P_s.

        Returns:
            A named tuple of numbers whose class has a static method `draw(step, xi, xi_mean, xi_end, push, rng)` that
            numba can compile: it draws the mean and the end of ξ in one step that begins at `xi`, all of shape (n,),
            and adds ∫f(ξ) dt to `push` where there may be a bias. Where `start` has more rows so has `xi`: its step
            moves all of them but the first, ξ, which its caller sets to the end. Kinds without it are not simulated.
        """
        raise NotImplementedError

    @property
    def largest_step(self) -> float:
        """The longest step of which `step` makes an error of some 1e-4."""
        raise NotImplementedError

    @property
    def marks(self) -> Sequence[float]:
        """What numbers in `step` stand for: the values of states, or the sizes of impulses; nothing for others."""
        return ()

    @property
    def is_simulated(self) -> bool:
        """Whether this kind states a `step`."""
        return type(self).step is not Noise.step

    def motion(self, system: System) -> tuple[System, Sequence[CoefficientMatrix]]:
        """A system as this noise moves it: the motion at ξ, and matrices B of Bx ∘ dW, which have no ξ."""
        return system, ()

    def changed_motion(
        self, system: System, terms: Sequence[CoefficientMatrix], name: str = ""
    ) -> tuple[Sequence[CoefficientMatrix], Sequence[CoefficientMatrix]]:
        """∂/∂θ of `motion`, from that of the terms of the system, or by a parameter of the noise with this name."""
        return terms, ()

    def impulses(self, system: System) -> Sequence[Impulse]:
        """Those by which this noise multiplies the state of a system, independent of each other."""
        return ()

    def changed_impulses(
        self, system: System, terms: Sequence[CoefficientMatrix], name: str = ""
    ) -> Sequence[ImpulseDerivative]:
        """∂/∂θ of each of the `impulses`; arguments as in `changed_motion`."""
        return ()

    @property
    def replaces(self) -> Noise | None:
        """The noise that it stands for, as the reduction (12)-(14) does for that of Eq. (7)."""
        return None

    @property
    def one_sided(self) -> Sequence[str]:
        """The names of parameters by which derivatives are taken from below here."""
        return ()

    def derivative(self, name: str) -> NoiseDerivative:
        """∂/∂θ, θ one of the `differentiable` parameters."""
        raise NotImplementedError(f"{type(self).__name__} states no derivative by {name}")

    @classmethod
    def exact_law(cls, decimals: Mapping[str, str]) -> ExactLaw | None:
        """The law in exact numbers, for parameters as decimals by name; None where no proof is known.

        Raises:
            NoSuchExponent: no bound can be proven for these parameters.
        """
        return None

    def check_existence(self, p: float) -> None:
        """Refuse a p for which E‖x‖^p is infinite. Raises `NoSuchExponent` for a p that is not among the `moments`."""
        low, high = self.moments
        if not low <= p <= high:
            raise NoSuchExponent(Message(Code.INFINITE, p=p, low=low, high=high, remedy=Remedy.REDUCTION))


class Memoryless(Noise):
    """Noise that has no value, see `is_white`: to solvers a chain that rests in its only state, ξ = 0."""

    is_white: ClassVar[bool] = True
    mixes_slowly: ClassVar[bool] = True
    has_states: ClassVar[bool] = True
    states: ClassVar[Sequence[float]] = (0.0,)
    rates: ClassVar[Sequence[Sequence[float]]] = ((0.0,),)

    @property
    def standard_deviation(self) -> float:
        return math.inf

    @property
    def correlation_time(self) -> float:
        return 0.0

    relaxation_time = correlation_time

    @property
    def probabilities(self) -> FloatArray:
        """Of the states, shape (1,)."""
        return np.ones(1)

    @property
    def reached(self) -> FloatArray:
        return np.zeros(1)

    def sample(self, size: int, rng: np.random.Generator) -> FloatArray:
        """0: it has no value."""
        return np.zeros(size)

    @property
    def largest_step(self) -> float:
        """∞: it is drawn exactly."""
        return math.inf
