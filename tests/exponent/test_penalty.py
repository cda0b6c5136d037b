"""The penalty on jumps is no matter of tuning: nothing lies right of Λ in coarse spaces, with half and twice of it."""

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator
from fpsolve.exponent import principal_pair, spectrum
from fpsolve.fem import Generator
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.fem.terms import Terms
from fpsolve.theory import frozen_noise
from tests.conftest import FIG1, FIG1_NOISE

STRONG = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
REGIMES = {
    "weak": Problem(FIG1, FIG1_NOISE.ou_reduction()),
    "strong": Problem(STRONG, FIG1_NOISE.ou_reduction()),
    "slow": Problem(FIG1, NonGaussianNoise(D0=1.0, tau0=20.0, r0=1.0).ou_reduction()),
    "exact": Problem(STRONG, FIG1_NOISE),
}
SPACES, MOMENTS = 4, 3
"""Of each kind; 20 and 10 take five minutes."""


def random_space(rng, noise, slope):
    """Two to four cells of degrees 4 to 7, six to ten polynomials, a tilt that may be wrong by half."""
    steps = rng.uniform(0.6, 1.4, rng.integers(2, 5))
    lines = np.pi / 2 + np.pi * np.append(0.0, np.cumsum(steps)) / np.sum(steps)
    degrees, slope = rng.integers(4, 8, lines.size - 1), slope * rng.uniform(0.5, 1.5)
    return Space((PhaseAxis(lines, degrees), PolynomialAxis(noise, int(rng.integers(6, 11)), slope)))


@pytest.mark.parametrize("regime", REGIMES)
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_nothing_lies_right_of_the_principal_eigenvalue(monkeypatch, rng, regime, factor):
    problem, typical = REGIMES[regime], Terms.typical_speed
    monkeypatch.setattr(Terms, "typical_speed", lambda terms: factor * typical(terms))
    frozen = frozen_noise(problem)
    slope = frozen.tilt(frozen.center(1.0))
    for _ in range(SPACES):
        generator = Generator(problem, random_space(rng, problem.coloured, slope))
        for p in rng.uniform(-2, 4 if regime in ("weak", "slow") else 2, MOMENTS):
            rightmost, pair = spectrum(generator, p, 1)[0], principal_pair(generator, p)
            assert rightmost.real <= pair.value + 1e-8 * max(1.0, abs(pair.value))
