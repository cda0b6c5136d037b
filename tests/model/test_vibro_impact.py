"""Eqs. (3)-(6), (17)-(18): the oscillator and its impact laws."""

import math
import re

import numpy as np
import pytest
from pydantic import ValidationError

from fpsolve import VibroImpactOscillator
from fpsolve.model import ImpactLaw
from tests.conftest import FIG1

h1, q1 = FIG1.terms[1].h, FIG1.terms[1].q


def test_polar_coefficients_come_from_the_cartesian_system(rng):
    """y₁ = e^ρ cos φ, y₂ = −e^ρ sin φ; with dy₂ = … + (ε²c₁ + εξ) y₂ dt, ρ̇ and φ̇ follow by the chain rule."""
    oscillator = VibroImpactOscillator(omega=1.3, restitution=1.0, c1=-0.4, epsilon=0.7)
    phi, xi = rng.uniform(0, 2 * np.pi, 20), rng.normal(size=20)
    y1, y2 = np.cos(phi), -np.sin(phi)
    rate = 0.7**2 * -0.4 + 0.7 * xi
    dy1, dy2 = 1.3 * y2, -1.3 * y1 + rate * y2
    eps = oscillator.epsilon
    np.testing.assert_allclose(eps**2 * oscillator.q2(phi) + eps * q1(phi) * xi, y1 * dy1 + y2 * dy2, atol=1e-14)
    speed = oscillator.omega + eps**2 * oscillator.h2(phi) + eps * h1(phi) * xi
    np.testing.assert_allclose(speed, -(y1 * dy2 - y2 * dy1), atol=1e-14)


def test_impacts_are_where_the_displacement_vanishes_and_the_noise_does_not_turn_the_phase():
    [jump] = FIG1.jumps
    np.testing.assert_allclose([math.cos(jump.phase), h1(jump.phase)], 0, atol=1e-15)
    np.testing.assert_allclose(q1(jump.phase), 1)


def test_impact_laws_by_their_formulas():
    for epsilon, r in ((0.1, 0.8), (1.0, 0.6), (1.2, 0.9)):
        arguments = {"omega": 1.0, "restitution": r, "c1": 0.0, "epsilon": epsilon}
        delta = VibroImpactOscillator(**arguments, impact="delta")
        bounce = VibroImpactOscillator(**arguments, impact="restitution")
        assert delta.impact_factor(3.0) == pytest.approx(math.exp(-3 * epsilon**2 * (1 - r)), rel=1e-14)
        assert bounce.impact_factor(3.0) == pytest.approx((1 - epsilon**2 * (1 - r)) ** 3, rel=1e-14)


def test_impact_laws_differ_by_epsilon_to_the_fourth():
    ratios = []
    for epsilon in (0.1, 0.05, 0.025):
        delta, bounce = (
            VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.0, epsilon=epsilon, impact=law) for law in ImpactLaw
        )
        ratios.append((delta.log_impact_factor - bounce.log_impact_factor) / epsilon**4)
    assert ratios[-1] == pytest.approx((1 - 0.8) ** 2 / 2, rel=1e-3)
    assert abs(ratios[2] - 0.02) < abs(ratios[1] - 0.02) < abs(ratios[0] - 0.02)


def test_no_loss_is_a_factor_of_exactly_one():
    for law in ImpactLaw:
        assert VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=1.0, impact=law).impact_factor(7) == 1


def test_restitution_law_must_not_reverse_the_velocity():
    with pytest.raises(ValidationError, match=r"1 - epsilon\^2 \(1 - restitution\) > 0, but it is -0\.125"):
        VibroImpactOscillator(omega=1.0, restitution=0.5, c1=0.0, epsilon=1.5, impact="restitution")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("omega", 0.0),
        ("epsilon", -0.1),
        ("restitution", 0.0),
        ("restitution", 1.1),
        ("c1", math.nan),
        ("c2", -1.0),
        ("c3", -1.0),
        ("impact", "elastic"),
        ("omega", True),
    ],
)
def test_bad_parameters_are_refused_by_name(name, value):
    good = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1}
    with pytest.raises(ValidationError) as refused:
        VibroImpactOscillator(**(good | {name: value}))
    said = rf"VibroImpactOscillator: {name}: got {re.escape(repr(value))}; must be (a finite number|one of) .*\(.+\)"
    assert re.fullmatch(said, str(refused.value))
