"""White noise filtered by an oscillator: narrow-band noise, sea waves, the ground motion of Kanai and Tajimi."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.model.parameters import ANY_SIGN, SIZE, parameter, stated_field

Pair = Annotated[tuple[float, float], Field(strict=False)]


class FilterStep(NamedTuple):
    """The exact transition of the filter, u = y and w = y′ over their standard deviations, with the mean of ξ.

    With three normal numbers ζ for each path

        (w₁, u₁, ū) = flow (w₀, u₀) + kicks (ζ₁, ζ₂, ζ₃),   ξ̄ = of_u ū + rise (u₁ − u₀),   ξ = of_u u + of_w w,

    with flow of the shape (3, 2) and kicks a triangle.
    """

    flow: FloatArray
    kicks: FloatArray
    of_u: float
    of_w: float
    rise: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
        """One step, see `Noise.step`; the rows of `xi` are ξ, u and w."""
        flow, kicks = step.flow, step.kicks
        for i in range(xi_end.size):
            u, w = xi[1, i], xi[2, i]
            first, second, third = rng.standard_normal(), rng.standard_normal(), rng.standard_normal()
            w_end = flow[0, 0] * w + flow[0, 1] * u + kicks[0, 0] * first
            u_end = flow[1, 0] * w + flow[1, 1] * u + kicks[1, 0] * first + kicks[1, 1] * second
            mean = flow[2, 0] * w + flow[2, 1] * u + kicks[2, 0] * first + kicks[2, 1] * second + kicks[2, 2] * third
            xi[1, i], xi[2, i] = u_end, w_end
            xi_mean[i] = step.of_u * mean + step.rise * (u_end - u)
            xi_end[i] = step.of_u * u_end + step.of_w * w_end


@strict_dataclass
class Filter(Noise):
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
    of_xi: ClassVar[Sequence[str]] = ("s",)
    may_tilt: ClassVar[bool] = False
    variables: ClassVar[int] = 2
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "output": stated_field(Pair, "c0 and c1 in ξ = c0 y + c1 y′", "output = [1.0, 0.0]", None)
    }

    def __post_init__(self) -> None:
        if not (self.c0 or self.c1):
            raise ValueError("got c0 = 0 and c1 = 0; ξ would be 0; let one of them differ from 0")

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Filter:
        """The noise that a table of a case file states, where `output = [c0, c1]` may replace c0 and c1.

        Raises:
            ValueError: a parameter is out of its range, c0 or c1 is stated alone, or one of them beside `output`.
        """
        known = dict(table)
        stated = [name for name in ("c0", "c1") if name in known]
        if "output" in known:
            if stated:
                raise ValueError(f"got output and {' and '.join(stated)}, which is the same twice; remove one of them")
            known["c0"], known["c1"] = known.pop("output")
        elif len(stated) == 1:
            raise ValueError(f"got {stated[0]} alone; state c0 and c1, or output = [c0, c1]")
        return cls(**known)

    @property
    def basis(self) -> Literal["pairs"]:
        return "pairs"

    @property
    def standard_deviation(self) -> float:
        """s √((c₀² + c₁²ω²)/(4ζω³))."""
        return self._unit * math.hypot(self.c0, self.c1 * self.omega)

    @property
    def _unit(self) -> float:
        """The standard deviation of y, s/√(4ζω³)."""
        return 0.5 * self.s / math.sqrt(self.zeta * self.omega) / self.omega

    @property
    def direction(self) -> tuple[float, float]:
        """(cos α, sin α) in ξ/std(ξ) = u cos α + w sin α, where u = y/std(y) and w = y′/std(y′)."""
        size = math.hypot(self.c0, self.c1 * self.omega)
        return self.c0 / size, self.c1 * self.omega / size

    @property
    def correlation_time(self) -> float:
        """The decay time of the envelope, 1/(ζω) for ζ ≤ 1, or of the slower of two exponentials for ζ > 1."""
        return (self._overdamped if self.zeta > 1 else 1 / self.zeta) / self.omega

    relaxation_time = correlation_time

    @property
    def _overdamped(self) -> float:
        """ζ + √(ζ² − 1), the root of how much faster than the other one exponential is; 1 for ζ ≤ 1."""
        return max(self.zeta, 1.0) + math.sqrt(max(self.zeta**2 - 1, 0.0))

    def spectral_density(self, omega: float) -> float:
        """S(ω) = s²(c₀² + c₁²ω²)/((ω_f² − ω²)² + 4ζ²ω_f²ω²), where ω_f is the frequency of the filter."""
        of_output = self.s * math.hypot(self.c0, self.c1 * omega)
        own, other = (self.omega - omega) * (self.omega + omega), 2 * self.zeta * self.omega * omega
        return (of_output / math.hypot(own, other)) ** 2

    @property
    def drift_matrix(self) -> FloatArray:
        """M in du = −Mu dt + N dW, for u with the stationary covariance 1 and ξ = std(ξ) u₁, shape (2, 2).

        The covariance is 1 because M + Mᵀ = NNᵀ. For u = (y/std(y), y′/std(y′)) the matrix would be
        ω((0, −1), (1, 2ζ)). Rotated by the angle α of `direction` it is M = ω(2ζ n nᵀ + ((0, −1), (1, 0))) with
        n = (sin α, cos α).
        """
        return self.omega * (2 * self.zeta * np.outer(*2 * (self._normal,)) + _TURN)

    @property
    def _normal(self) -> FloatArray:
        cosine, sine = self.direction
        return np.array([sine, cosine])

    def derivative(self, name: str) -> NoiseDerivative:
        """The derivative of M and of ln std(ξ) at fixed u; ω, c₀ and c₁ also change the angle of `direction`."""
        c, damping = np.array([self.c0, self.c1 * self.omega]), np.outer(self._normal, self._normal)
        square = float(c @ c)

        def turned(by_c: FloatArray) -> FloatArray:
            """∂M/∂θ by the angle, whose ∂/∂θ is (c × ∂c)/c²; ∂n = (cos, −sin) of it."""
            cosine, sine = self.direction
            normal = np.outer(self._normal, [cosine, -sine]) * (c[0] * by_c[1] - c[1] * by_c[0]) / square
            return np.asarray(2 * self.zeta * self.omega * (normal + normal.T))

        match name:
            case "s":
                return NoiseDerivative(log_scale=1 / self.s)
            case "zeta":
                return NoiseDerivative(log_scale=-0.5 / self.zeta, drift=_rows(2 * self.omega * damping))
            case "omega":
                by_c = np.array([0.0, self.c1])
                drift = self.drift_matrix / self.omega + turned(by_c)
                return NoiseDerivative(log_scale=-1.5 / self.omega + float(c @ by_c) / square, drift=_rows(drift))
        by_c = np.array([1.0, 0.0]) if name == "c0" else np.array([0.0, self.omega])
        return NoiseDerivative(log_scale=float(c @ by_c) / square, drift=_rows(turned(by_c)))

    @property
    def diffusion(self) -> float:
        """c₁s, the coefficient of dW in dξ."""
        return self.c1 * self.s

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """The logarithm of the Gaussian density of ξ, in the shape of ξ."""
        z = np.asarray(xi, dtype=float) / self.standard_deviation
        return -0.5 * z**2 - math.log(math.sqrt(2 * math.pi) * self.standard_deviation)

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """ξ, y/std(y) and y′/std(y′), shape (3, size)."""
        u, w = rng.standard_normal((2, size))
        return np.array([self._unit * (self.c0 * u + self.c1 * self.omega * w), u, w])

    @property
    def largest_step(self) -> float:
        """Half of the shortest time constant of the filter."""
        return 0.5 / (self.omega * self._overdamped)

    def step(self, h: float, bias: float = 0.0) -> FilterStep:
        """One exact step of length h of u′ = ωw, dw = −ω(u + 2ζw) dt + 2√(ζω) dW, see `Noise.step`, without a bias.

        Here u = y/std(y) and w = y′/std(y′). The random part has the covariance of w, u and the mean of u over the
        step, which are integrals of the responses to dW.
        """
        t, unit = h * _NODES, self._unit
        sums = np.array([at * _WEIGHTS @ self._flow(at * _NODES)[:, 1] for at in t])  # ∫u dt
        flow, kick = self._flow(t), 2 * math.sqrt(self.zeta * self.omega)
        responses = kick * np.stack([flow[:, 0, 0], flow[:, 1, 0], sums[:, 0] / h])
        kicks = _root((responses * h * _WEIGHTS) @ responses.T)
        whole = np.vstack([self._flow(np.array([h]))[0], _WEIGHTS @ flow[:, 1]])
        return FilterStep(whole, kicks, unit * self.c0, unit * self.c1 * self.omega, unit * self.c1 / h)

    def _flow(self, t: FloatArray) -> FloatArray:
        """The matrices that take (w, u) to what it is after times t, shape (n, 2, 2)."""
        square = (1 - self.zeta**2) * self.omega**2
        rate = math.sqrt(abs(square))
        fall = np.exp(-self.zeta * self.omega * t)
        if square > 0:
            even, odd = np.cos(rate * t), t * np.sinc(rate * t / np.pi)
        elif rate:
            even, odd = np.cosh(rate * t), np.sinh(rate * t) / rate
        else:
            even, odd = np.ones_like(t), t
        damped, turned = self.zeta * self.omega * odd, self.omega * odd
        return np.moveaxis(fall * np.array([[even - damped, -turned], [turned, even + damped]]), 2, 0)


_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
_NODES, _WEIGHTS = 0.5 * (np.polynomial.legendre.leggauss(32) + np.array([[1.0], [0.0]]))


def _rows(matrix: FloatArray) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, matrix.tolist()))


def _root(covariance: FloatArray) -> FloatArray:
    """Cholesky's factor of a covariance, each of its numbers in units of its own deviation."""
    sizes = np.sqrt(np.diagonal(covariance))
    return np.asarray(sizes[:, None] * np.linalg.cholesky(covariance / np.outer(sizes, sizes)))
