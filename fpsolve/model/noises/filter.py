"""White noise filtered by an oscillator: narrow-band noise, sea waves, the ground motion of Kanai and Tajimi."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import TableError, shown, strict_dataclass
from fpsolve.model.noise import Gaussian, NoiseDerivative
from fpsolve.model.noises.steps import FilterStep, transition
from fpsolve.model.parameters import ANY_SIGN, SIZE, Table, parameter, stated_field
from fpsolve.model.plane import rows_of

Output = Annotated[tuple[float, ...], Field(strict=False, min_length=1)]


@strict_dataclass
class Filter(Gaussian):
    """Filtered white noise ξ = c₀y + c₁y′ with y″ + 2ζω y′ + ω²y = s Ẇ, y and y′ stationary.

    c₀ = 1, c₁ = 0 gives narrow-band noise if ζ is small. c₀ = 0, c₁ = 1 gives noise like that of sea waves, with S(0) =
    0. c₀ = ω², c₁ = 2ζω gives the ground motion of Kanai and Tajimi. Var y = s²/(4ζω³), Var y′ = s²/(4ζω), and y and y′
    are uncorrelated. ξ is no Markov process by itself, so that functions of the noise are functions of y and y′.

    >>> Filter(omega=2.0, zeta=0.1, s=0.5).spectral_density(0.0)  # s²c₀²/ω⁴
    0.015625

    Args:
        omega: ω, 1e-15 to 1e15, in rad/time.
        zeta: ζ, 1e-15 to 1e15.
        s: 1e-15 to 1e15, in the unit of ξ times time^(-3/2) where c₀ is a number.
        c0: c₀, −1e15 to 1e15; 1 if omitted.
        c1: c₁, −1e15 to 1e15, in time where c₀ is a number; 0 if omitted.

    Raises:
        ParameterError: a parameter is not a finite number in its range.
        ValueError: c₀ and c₁ are both 0.
    """

    omega: Annotated[float, parameter("frequency of the filter", "omega = 2.0", r"$\omega_f$", "rad/time", **SIZE)]
    zeta: Annotated[float, parameter("damping ratio of the filter", "zeta = 0.1", r"$\zeta$", **SIZE)]
    s: Annotated[float, parameter("intensity of the driving white noise", "s = 0.5", "$s$", "1/time^(5/2)", **SIZE)]
    c0: Annotated[float, parameter("coefficient of y", "c0 = 1.0", "$c_0$", **ANY_SIGN)] = 1.0
    c1: Annotated[float, parameter("coefficient of y′", "c1 = 0.0", "$c_1$", "time", **ANY_SIGN)] = 0.0

    kind: ClassVar[str] = "filter"
    of_xi: ClassVar[Mapping[str, str]] = {"s": "{}time^(-3/2)"}
    may_tilt: ClassVar[bool] = False
    variables: ClassVar[int] = 2
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "output": stated_field(Output, "c0 and c1 in ξ = c0 y + c1 y′", "output = [1.0, 0.0]", None)
    }

    def __post_init__(self) -> None:
        if not (self.c0 or self.c1):
            raise ValueError("got c0 = 0 and c1 = 0; ξ would be 0; let one of them differ from 0")

    @classmethod
    def from_table(cls, table: Table) -> Filter:
        """The noise that a table of a case file states, where `output = [c0, c1]` may replace c0 and c1.

        Raises:
            ValueError: a parameter is out of its range, c0 or c1 is stated alone, or one of them beside `output`.
        """
        known = dict(table)
        if output := known.pop("output", ()):
            if known.keys() & {"c0", "c1"}:
                raise ValueError("got output and c0 or c1, which is the same twice; remove one of them")
            if len(output) != 2:
                why = "y″ contains the driving white noise itself, correlated with y′"
                raise TableError(f"got {shown(output)}; must be c0 and c1 alone, as {why}", "output")
            known["c0"], known["c1"] = output
        return cls(**known)

    @property
    def basis(self) -> Literal["pairs"]:
        return "pairs"

    @property
    def standard_deviation(self) -> float:
        """s √((c₀² + c₁²ω²)/(4ζω³))."""
        return self._unit * math.hypot(*self._mixed)

    @property
    def _mixed(self) -> FloatArray:
        """(c₁ω, c₀): ξ is the sum of w and u with these, over std(y)."""
        return np.array([self.c1 * self.omega, self.c0])

    @property
    def _unit(self) -> float:
        """The standard deviation of y, s/√(4ζω³)."""
        return 0.5 * self.s / math.sqrt(self.zeta * self.omega) / self.omega

    @property
    def correlation_time(self) -> float:
        """The decay time of the envelope, 1/(ζω) for ζ ≤ 1, or of the slower of two exponentials for ζ > 1."""
        return max(self._overdamped, 1 / self.zeta) / self.omega

    relaxation_time = correlation_time

    @property
    def _overdamped(self) -> float:
        """ζ + √(ζ² − 1), the root of how much faster than the other one exponential is; 1 for ζ ≤ 1."""
        return max(self.zeta, 1.0) + math.sqrt(max(self.zeta**2 - 1, 0.0))

    def spectral_density(self, omega: float) -> float:
        """S(ω) = s²(c₀² + c₁²ω²)/((ω_f² − ω²)² + 4ζ²ω_f²ω²), where ω_f is the frequency of the filter."""
        y = 1 / complex((self.omega - omega) * (self.omega + omega), 2 * self.zeta * self.omega * omega)
        return abs(self.s * complex(self.c0, self.c1 * omega) * y) ** 2

    @property
    def drift_matrix(self) -> FloatArray:
        """M in du = −Mu dt + N dW, for u with the stationary covariance 1 and ξ = std(ξ) u₁, shape (2, 2).

        The covariance is 1 because M + Mᵀ = NNᵀ. For u = (y/std(y), y′/std(y′)) the matrix would be
        ω((0, −1), (1, 2ζ)). Rotated so that u₁ ~ ξ it is M = ω(2ζ n nᵀ + ((0, −1), (1, 0))), n = (c₁ω, c₀)/‖(c₁ω, c₀)‖.
        """
        c = self._mixed
        return np.asarray(self.omega * (2 * self.zeta * np.outer(c, c) / (c @ c) + [[0.0, -1.0], [1.0, 0.0]]))

    def derivative(self, name: str) -> NoiseDerivative:
        """The derivative of M and of ln std(ξ) at fixed u; ω, c₀ and c₁ also change n."""
        size, omega, zeta = np.hypot(*self._mixed), self.omega, self.zeta
        by_c = np.array({"omega": (self.c1, 0.0), "c0": (0.0, 1.0), "c1": (omega, 0.0)}.get(name, (0.0, 0.0))) / size
        unit = {"s": 1 / self.s, "zeta": -0.5 / zeta, "omega": -1.5 / omega}.get(name, 0.0)
        n = self._mixed / size
        stretch, normal = n @ by_c, np.outer(n, n)
        turned = np.outer(n, by_c) - stretch * normal
        direct = {"omega": self.drift_matrix / omega, "zeta": 2 * omega * normal}
        drift = 2 * zeta * omega * (turned + turned.T) + direct.get(name, 0.0)
        return NoiseDerivative(log_scale=float(unit + stretch), drift=rows_of(drift))

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """ξ, y/std(y) and y′/std(y′), shape (3, size)."""
        u, w = rng.standard_normal((2, size))
        return np.array([self._unit * (self._mixed @ (w, u)), u, w])

    @property
    def largest_step(self) -> float:
        """Half of the shortest time constant of the filter."""
        return 0.5 / (self.omega * self._overdamped)

    def step(self, h: float, bias: float = 0.0) -> FilterStep:
        """One exact step of length h of u′ = ωw, dw = −ω(u + 2ζw) dt + 2√(ζω) dW, see `Noise.step`, without a bias.

        Here u = y/std(y) and w = y′/std(y′). With τ = ωh, w moves u/τ in a step, and that the mean of u over τ.
        """
        tau, unit = self.omega * h, self._unit
        sizes = np.array([[1.0], [tau], [tau]])
        flow, kicks = transition([[-2 * self.zeta * tau, -(tau**2), 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        kicks = 2 * math.sqrt(self.zeta * tau) * sizes * kicks
        of_w = unit * self.c1
        return FilterStep(sizes * flow[:, :2] / [1.0, tau], kicks, unit * self.c0, of_w * self.omega, of_w / h)
