"""Identities of Λ(p) without walls: a mirror at p = −1, and Λ(−2) as the growth of E 1/det of the flow."""

from functools import partial

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, moment_lyapunov
from fpsolve.model import MarkovChain, SineWiener, Telegraph, White
from tests.kit import matrices
from tests.numbers.by_problem import by_moments
from tests.numbers.values import Quantity, Row, moment

CHAINS = {
    "telegraph": Telegraph(a=0.5, k=1.0),
    "cycle": MarkovChain((-0.6, 0.1, 0.7), ((0.0, 1.0, 0.2), (0.5, 0.0, 1.5), (0.1, 1.5, 0.0))),
}
"""The cycle is out of detailed balance: to go round one way is likelier."""
GAUSS = {"OU": OrnsteinUhlenbeck(alpha=1.0, sigma=0.8), "white": White(0.7)}
BOUNDED = {"Eq. (7)": NonGaussianNoise(D0=0.3, tau0=0.8, r0=0.7), "sine-Wiener": SineWiener(0.7, 1.0)}
FREE, DRIVEN = np.random.default_rng([1, 3]).standard_normal((2, 2, 2))
FREE = [[0.0, 1.0], [-1.0, 0.0]] + 0.3 * FREE
TRACE, LOAD = float(np.trace(FREE)), 0.4


def turning(noise, trace: float):
    return matrices(FREE, DRIVEN + 0.5 * (trace - np.trace(DRIVEN)) * np.eye(2), noise)


def across(p: float) -> Quantity:
    """Λ(p) − Λ(−2 − p), which is (p + 1) tr A where that is constant, whether paths have the same law backwards or not.

    For a flow M of det M = 1 ∫|Me|^(−2−p) dφ = ∫|M⁻¹e|^p dφ over all directions, and ‖M⁻¹‖ = ‖M‖.
    """

    def solved(problem: Problem) -> tuple[float, float]:
        right, left = (moment_lyapunov(problem, each, rtol=1e-7) for each in (p, -2 - p))
        return float(right.value[0] - left.value[0]), float(right.error_estimate[0] + left.error_estimate[0])

    return Quantity(f"Λ({p:g}) − Λ({-2 - p:g})", solved)


def inverse(noise: str) -> float:
    """The growth of E exp(−∫tr A dt): ½tr₁²S(0) − tr₀ of Gaussian noise, an eigenvalue of a chain, or Λ of a scalar."""
    if noise in GAUSS:
        return 0.5 * LOAD**2 * GAUSS[noise].spectral_density(0.0) - TRACE
    if noise in CHAINS:
        chain = CHAINS[noise]
        killed = np.array(chain.rates) - np.diag(TRACE + LOAD * np.array(chain.states))
        return float(np.max(np.linalg.eigvals(killed).real))
    scalar = matrices([[0.0]], [[-LOAD / 2]], BOUNDED[noise])
    return float(moment_lyapunov(scalar, 2.0).value[0]) - TRACE


ROWS = [
    row
    for name, noise in (GAUSS | CHAINS | BOUNDED).items()
    for row in (
        *(
            Row(
                turning(noise, 0.0),
                across(p),
                (p + 1) * TRACE,
                1e-13,
                1e-6,
                f"mirror, {name}",
                slow=name == "sine-Wiener" and p < 2,
            )
            for p in (0.5, 1.0, 2.5)
        ),
        Row(turning(noise, LOAD), moment(-2.0, rtol=1e-7), partial(inverse, name), 1e-9, 1e-6, f"determinant, {name}"),
    )
] + [
    Row(
        turning(noise, LOAD),
        moment(2.0),
        partial(by_moments, turning(noise, LOAD), 2),
        1e-12,
        1e-8,
        f"moment equations, {name}",
    )
    for name, noise in CHAINS.items()
]
