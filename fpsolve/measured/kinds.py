"""What is fitted: the spectral density and the autocovariance of each kind by the logarithms of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model import Bounded, Filter, Noise, OrnsteinUhlenbeck

Shape = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Kind:
    """A family of noises whose parameters are all positive.

    Attributes:
        names: of the parameters, as the noise has them.
        make: the noise of some values.
        density: S(ω) by ω, shape (n,), and the values.
        covariance: C(t) by t ≥ 0, shape (n,), and the values.
        amplitude: which of the parameters multiplies ξ.
        start: values from a place ω₀ and a relative width w of a peak, before the amplitude is known.
        is_gaussian: whether ξ is.
    """

    names: tuple[str, ...]
    make: Callable[..., Noise]
    density: Shape
    covariance: Shape
    amplitude: int
    start: Callable[[float, float], Sequence[float]]
    is_gaussian: bool = True


def _ou_density(omega: FloatArray, theta: FloatArray) -> FloatArray:
    alpha, sigma = theta
    return sigma**2 / (alpha**2 + omega**2)


def _ou_covariance(t: FloatArray, theta: FloatArray) -> FloatArray:
    alpha, sigma = theta
    return sigma**2 / (2 * alpha) * np.exp(-alpha * t)


def _bounded_density(omega: FloatArray, theta: FloatArray) -> FloatArray:
    mu, nu, sigma = theta
    half = 0.5 * sigma**2
    return 0.5 * mu**2 * half * (1 / (half**2 + (omega - nu) ** 2) + 1 / (half**2 + (omega + nu) ** 2))


def _bounded_covariance(t: FloatArray, theta: FloatArray) -> FloatArray:
    mu, nu, sigma = theta
    return 0.5 * mu**2 * np.exp(-0.5 * sigma**2 * t) * np.cos(nu * t)


def _filter(has_value: bool, has_slope: bool) -> Kind:
    """That of ξ = y, of ξ = y′, or of ξ = y + c₁y′."""

    def output(theta: FloatArray) -> tuple[float, float]:
        return float(has_value), (float(theta[3]) if has_value else 1.0) if has_slope else 0.0

    def density(omega: FloatArray, theta: FloatArray) -> FloatArray:
        own, zeta, s = theta[:3]
        c0, c1 = output(theta)
        square = (own**2 - omega**2) ** 2 + (2 * zeta * own * omega) ** 2
        return np.asarray(s**2 * (c0**2 + (c1 * omega) ** 2) / square)

    def covariance(t: FloatArray, theta: FloatArray) -> FloatArray:
        own, zeta, s = theta[:3]
        c0, c1 = output(theta)
        turn = own * np.sqrt(complex(1 - zeta**2 + 1e-12))  # a double root would be 0/0
        # (exp((−ζω + iω_d)t) ± exp((−ζω − iω_d)t))/2 decay each by itself, so that nothing overflows for ζ > 1
        first, second = (np.exp((-zeta * own + side * 1j * turn) * t) for side in (1, -1))
        even, odd = 0.5 * (first + second), zeta * own / turn * (first - second) / 2j
        unit = s**2 / (4 * zeta * own**3)
        return np.asarray((unit * (c0**2 * (even + odd) + (c1 * own) ** 2 * (even - odd))).real)

    def make(*theta: float) -> Noise:
        c0, c1 = output(np.array(theta))
        return Filter(theta[0], theta[1], theta[2], c0, c1)

    both = has_value and has_slope
    return Kind(
        ("omega", "zeta", "s", "c1")[: 4 if both else 3],
        make,
        density,
        covariance,
        2,
        lambda omega, width: (omega, width, 1.0, 0.3 / omega)[: 4 if both else 3],
    )


OU = Kind(
    ("alpha", "sigma"),
    OrnsteinUhlenbeck,
    _ou_density,
    _ou_covariance,
    1,
    lambda omega, width: (omega, 1.0),
)
BOUNDED = Kind(
    ("mu", "nu", "sigma"),
    Bounded,
    _bounded_density,
    _bounded_covariance,
    0,
    lambda omega, width: (1.0, omega, (2 * width * omega) ** 0.5),
    is_gaussian=False,
)
KINDS = {
    "ornstein-uhlenbeck": (OU,),
    "filter": (_filter(True, False), _filter(False, True), _filter(True, True)),
    "bounded": (BOUNDED,),
}
"""By the word of a case file the families among which a fit chooses, those with fewer parameters first."""
