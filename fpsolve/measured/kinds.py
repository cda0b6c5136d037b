"""What is fitted: the spectral density and the autocovariance of each kind by its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model import Bounded, Filter, Noise, OrnsteinUhlenbeck

Values = Mapping[str, float | str]
"""Those of all parameters of a noise by their names."""
LARGEST_DAMPING = 10.0
"""Of a filter: its spectrum is that of noise of first order, up to 400 times its corner, and tells no larger one."""


class Kind(NamedTuple):
    """A family of noises whose parameters are all positive, and fitted by their logarithms.

    Attributes:
        noise: one of them, which has the parameters that are not fitted.
        names: of those that are fitted.
        density: S(ω) by ω, shape (n,), and all parameters by their names.
        covariance: C(t) by t ≥ 0, shape (n,), and the same.
        start: values from a place ω₀ and a relative width w of a peak, before the amplitude is known.
        path: of a noise that is not Gaussian, ξ at n equal steps by n, the step, random numbers and the parameters.
    """

    noise: Noise
    names: tuple[str, ...]
    density: Callable[..., FloatArray]
    covariance: Callable[..., FloatArray]
    start: Callable[[float, float], tuple[float, ...]]
    path: Callable[..., FloatArray] | None = None

    def values(self, fitted: FloatArray) -> list[Values]:
        """All parameters of each noise of a sum by those of all that are fitted, one noise after the other."""
        rows = fitted.reshape(-1, len(self.names)).tolist()
        return [{**self.noise.values, **dict(zip(self.names, row, strict=True))} for row in rows]

    @property
    def multiplies(self) -> FloatArray:
        """1 for the parameter that multiplies ξ, 0 for the others, shape (k,)."""
        return np.array([float(name in self.noise.of_xi) for name in self.names])

    @property
    def highest(self) -> FloatArray:
        """The logarithms of the largest values, shape (k,)."""
        return np.log([LARGEST_DAMPING if name == "zeta" else math.inf for name in self.names])


def _filter_covariance(t: FloatArray, omega: float, zeta: float, s: float, c0: float, c1: float) -> FloatArray:
    """Of the poles −b₁, −b₂ of the filter: s² Σ (c₀² − c₁²bᵢ²)/(2bᵢ(bⱼ² − bᵢ²)) exp(−bᵢt)."""
    root = np.sqrt(complex(zeta**2 - 1 - 1e-12))  # a double pole would be 0/0
    first, second = omega * (zeta + root), omega * (zeta - root)
    found = np.zeros(t.shape, dtype=complex)
    for b, other in ((first, second), (second, first)):
        found += (c0**2 - (c1 * b) ** 2) / (2 * b * (other**2 - b**2)) * np.exp(-b * t)
    return s**2 * found.real


def _filter(c0: float, c1: float, *more: str) -> Kind:
    """That of ξ = c₀y + c₁y′, of which more than its strength may be fitted."""
    return Kind(
        Filter(1.0, 1.0, 1.0, c0, c1),
        ("omega", "zeta", "s", *more),
        lambda w, omega, zeta, s, c0, c1: (
            s**2 * (c0**2 + (c1 * w) ** 2) / ((omega**2 - w**2) ** 2 + (2 * zeta * omega * w) ** 2)
        ),
        _filter_covariance,
        lambda place, width: (place, width, 1.0, *[0.3 / place for _ in more]),
    )


KINDS = {
    "ornstein-uhlenbeck": (
        Kind(
            OrnsteinUhlenbeck(1.0, 1.0),
            ("alpha", "sigma"),
            lambda w, alpha, sigma: sigma**2 / (alpha**2 + w**2),
            lambda t, alpha, sigma: sigma**2 / (2 * alpha) * np.exp(-alpha * t),
            lambda place, width: (place, 1.0),
        ),
    ),
    "filter": (_filter(1.0, 0.0), _filter(0.0, 1.0), _filter(1.0, 1.0, "c1")),
    "bounded": (
        Kind(
            Bounded(1.0, 1.0, 1.0),
            ("mu", "nu", "sigma"),
            lambda w, mu, nu, sigma: (
                (mu * sigma / 2) ** 2 * (1 / (sigma**4 / 4 + (w - nu) ** 2) + 1 / (sigma**4 / 4 + (w + nu) ** 2))
            ),
            lambda t, mu, nu, sigma: 0.5 * mu**2 * np.exp(-0.5 * sigma**2 * t) * np.cos(nu * t),
            lambda place, width: (1.0, place, math.sqrt(2 * width * place)),
            lambda n, step, rng, mu, nu, sigma: (
                mu
                * np.cos(
                    np.cumsum(nu * step + sigma * math.sqrt(step) * rng.standard_normal(n))
                    + rng.uniform(0, 2 * math.pi)
                )
            ),
        ),
    ),
}
"""By the word of a case file the families among which a fit chooses, those with fewer parameters first."""
