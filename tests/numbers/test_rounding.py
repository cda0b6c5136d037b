"""Rounding is within the stated error, where nothing else is."""

import numpy as np
import pytest
from scipy.stats import ortho_group

from fpsolve.exponent import even_moment
from fpsolve.model import OrnsteinUhlenbeck, Poisson, SineWiener, Telegraph, White
from tests.kit import matrices

NOISES = (
    (White(s=0.4), 1.0),
    (OrnsteinUhlenbeck(alpha=1.0, sigma=0.5), 0.3),
    (SineWiener(amplitude=1.0, sigma=1.0), 0.3),
    (Telegraph(a=0.7, k=0.8), 1.0),
    (Poisson(rate=1.0, sizes=(0.5, -0.5)), 1.0),
)


@pytest.mark.parametrize(("noise", "strength"), NOISES, ids=lambda each: getattr(each, "kind", ""))
def test_second_moments_in_orthogonal_coordinates_agree_within_their_errors(noise, strength):
    for n, seed in ((2, 0), (3, 1), (4, 2), (4, 3)):
        random = np.random.default_rng(100 * n + seed)
        drift, load = random.normal(size=(n, n)) - 2 * np.eye(n), strength * random.normal(size=(n, n))
        turn = ortho_group.rvs(n, random_state=random)
        one = even_moment(matrices(drift, load, noise), 2)
        other = even_moment(matrices(turn @ drift @ turn.T, turn @ load @ turn.T, noise), 2)
        assert abs(one.value - other.value) <= one.error + other.error, (n, seed)
        assert one.error <= 1e-11 * (1 + abs(one.value)), (n, seed)
