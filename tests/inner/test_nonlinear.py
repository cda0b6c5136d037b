"""Internals of the stationary response: its tail, its balances, and where its interval of ln a goes."""

from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import stability_index
from fpsolve.arrays import identity
from fpsolve.fem.factors import one_thread
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.nonlinear.adapt import Settled
from fpsolve.nonlinear.elimination import Tail, solved
from fpsolve.nonlinear.operator import Elements, Flow, Plane
from tests.kit import rates
from tests.numbers.rows.response import NOISE, oscillator
from tests.numbers.rows.response import solved as response


def test_interval_of_ln_a_follows_what_all_discretisations_have():
    """Not waves of a van der Pol oscillator on coarse ones, but a second hump."""

    height = SimpleNamespace(lines=0.5 * np.arange(6))

    def fall(*shares):
        first, *others = (SimpleNamespace(height=height, shares=lambda n, own=own: np.array(own)) for own in shares)
        return Settled(first, tuple(others)).fall(4)

    first = 0.12, 0.65, 0.22
    waves = fall((*first, 5.6e-4, 6.2e-3), (*first, 2.7e-4, 4.1e-3), (*first, 4.4e-3, 7e-4))
    assert (waves.end, waves.ratio, waves.top(1e-4)) == (2.0, pytest.approx(5.6e-4 / 0.22), 2.0)
    hump = fall((*first, 0.01, 0.03), (*first, 0.011, 0.027))
    assert hump.end == 2.5 < hump.top(1e-4)


@pytest.mark.slow
def test_density_without_an_imposed_tail_falls_as_that_of_the_linear_system():
    """On a deep interval, with any inflow from below, ln ρ = −δ_p u + b e^{2u} + … far from its lower end."""
    own = {"omega": 1.0, "epsilon": 0.5, "restitution": 0.97, "c1": 0.1, "c2": 0.5, "c3": 0.2}
    problem = oscillator(0.3, 0.5, **own)
    circle = Elements(Flow(problem).phases(3), 12, is_closed=True)
    plane = Plane(Flow(problem), circle, PolynomialAxis(problem.valued, 12))
    with one_thread():
        found = solved(plane, Elements(np.linspace(-10, 1.8, 40), 7), Tail(1.0, plane.constant[None]))
    u = np.linspace(-5.5, -3, 101)
    shapes = np.stack([np.ones_like(u), u, np.exp(2 * u), np.exp(4 * u)], axis=1)
    fit = np.linalg.lstsq(shapes, np.log(found.at(u) @ plane.unit @ plane.constant), rcond=None)[0]
    assert fit[1] == pytest.approx(-stability_index(problem).value, abs=1e-6)


@pytest.mark.slow
def test_moments_with_the_noise_do_not_change():
    """E xv and E H, H the energy with k x⁴/4, which the discrete equations do not imply."""
    omega, zeta, k, c, d = 1.4, 0.02, 0.3, 0.2, 0.1
    force = f"-{omega}**2*x + 2*{zeta}*{omega}*v - {k}*x**3 - {c}*x**2*v - {d}*v**3 - xi*x"
    found = response(rates(f"x' = v; v' = {force}", NOISE), rtol=0.1)
    phi = found.solution.plane.circle.points
    cos, sin = np.cos(phi), -found.problem.linear.aspect * np.sin(phi)
    square = np.exp(2 * found.flow.gauge(phi))  # a² over e^{2u}
    terms = (
        (cos, (1, 0, 2), (-(omega**2), 2, 0), (2 * zeta * omega, 1, 1), (-k, 4, 0), (-c, 3, 1), (-d, 1, 3)),
        (sin, (2 * zeta * omega, 0, 2), (-c, 2, 2), (-d, 0, 4)),
    )
    for side, *each in terms:
        of_noise = found.solution.mean(2, square * cos * side, identity)  # E ξx² or E ξxv
        sizes = [(size, found.moment(n, m)) for size, n, m in each]
        total = sum(size * mean.value for size, mean in sizes) - of_noise
        errors = sum(abs(size) * mean.error_estimate for size, mean in sizes)
        assert abs(total) <= errors + 1e-3 * abs(of_noise)
        assert abs(total) < 1e-3 * sum(abs(size) * mean.scale for size, mean in sizes)
