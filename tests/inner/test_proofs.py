"""Searches for proofs end in time, and floats beside balls are rounded outward."""

import math
from fractions import Fraction

import numpy as np

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, lyapunov_exponent
from fpsolve.model import Telegraph
from fpsolve.proofs import prove_lyapunov_exponent, search
from fpsolve.proofs.balls import above, ball, below, precision, rounded
from fpsolve.proofs.bounds import Bounder, Trial
from fpsolve.proofs.certificate import BasisRecord
from fpsolve.proofs.statement import cylinder, statement_of
from tests.kit import matrices

OSCILLATOR = VibroImpactOscillator(1.0, 0.8, 0.1, 0.1)
NOISE = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.7)


def test_trials_stay_below_a_size(monkeypatch):
    """The phase stands still in either state: functions of it are not smooth, and no number of waves suffices."""
    monkeypatch.setattr(search, "MOST", 39)
    problem = matrices(((1.0, 0.0), (0.0, -1.0)), ((0.0, -1.0), (1.0, 0.0)), Telegraph(0.5, 2.0))
    found = prove_lyapunov_exponent(problem)
    assert len(found.certificate.cosine) <= 40
    assert not found.is_met
    assert found.lower < lyapunov_exponent(problem).value < found.upper


def test_floats_beside_balls_are_rounded_outward():
    with precision():
        third = ball(1) / 3
        low, high = below(third), above(third)
        assert Fraction(low) < Fraction(1, 3) < Fraction(high)
        assert high - low <= 2 * math.ulp(low)
        near, off = rounded(np.array([third, ball(2.0), third.sqrt()], dtype=object))
        assert abs(Fraction(near[0]) - Fraction(1, 3)) <= Fraction(off[0])
        assert np.all(off < 1e-15)
        assert below(ball(0.25)) == above(ball(0.25)) == 0.25


def test_where_a_trial_function_is_not_positive_nothing_is_bounded():
    cosine, sine = np.array([[0.05, 0.0], [0.4, 0.1]]), np.zeros((2, 2))
    with precision():
        noise = cylinder(statement_of(Problem(OSCILLATOR, NOISE)))
        trial = Trial(noise, ball(1.7), 0.2, BasisRecord(kind="whole").basis, cosine, sine)
        found = Bounder(trial, 64).bounds(np.array([-0.5, 0.2]), np.array([-0.4, 0.3]))
    assert not np.any(found.is_positive)
