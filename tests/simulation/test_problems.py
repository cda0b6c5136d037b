"""What can be simulated, and that what is found travels to other processes."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, PlaneSystem, Problem, VibroImpactOscillator, simulate
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.model import CoefficientMatrix, MarkovChain, Noise
from fpsolve.model.systems.vibro_impact import DAMPING
from fpsolve.simulation import simulated_response
from fpsolve.simulation.setup import PROGRESS_STEPS
from tests.conftest import sampled

OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.5, c2=0.3, impact="restitution")
NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9)
PLANE = PlaneSystem([CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0))), CoefficientMatrix(1, DAMPING, identity)])


@dataclass(frozen=True)
class NoPaths(Noise):
    """Something that looks like a noise."""

    level: float = 1.0
    standard_deviation = correlation_time = 1.0

    def spectral_density(self, omega):
        return self.level


def moments(*args, estimator="direct", **kwargs):
    return simulate(*args, estimator=estimator, paths=640, time=60.0, seed=3, **kwargs)


def response(*args, **kwargs):
    return simulated_response(*args, exponent=0.05, variance_rate=0.01, paths=32, time=50.0, step=0.1, seed=1, **kwargs)


@pytest.mark.parametrize("estimator", sampled("direct", "population"))
def test_moments_travel_to_other_processes(estimator):
    orders = [-1.0, 30.0]
    found = moments(Problem(OSCILLATOR, NOISE), orders, estimator=estimator)
    assert found.estimates[-1].value is None
    assert pickle.loads(pickle.dumps(found)) == found


@pytest.mark.slow
def test_responses_travel_to_other_processes():
    found = response(Problem(OSCILLATOR, NOISE))
    np.testing.assert_equal(vars(found), vars(pickle.loads(pickle.dumps(found))))


@pytest.mark.parametrize(
    ("problem", "name"),
    [
        (Problem(OSCILLATOR, NoPaths()), "noise that states a step of its paths, but this is a NoPaths"),
        (
            Problem(PlaneSystem([CoefficientMatrix(0, DAMPING, np.sin)]), NOISE),
            "terms that are a + b*xi under a NonGaussianNoise, but one has g = sin(ξ)",
        ),
    ],
)
def test_other_problems_are_refused(problem, name):
    for call in (lambda: moments(problem, [1.0]), lambda: response(problem)):
        with pytest.raises(FpsolveError) as caught:
            call()
        assert str(caught.value) == f"simulation is for {name}; use the finite elements"


@pytest.mark.parametrize(
    ("system", "noise", "words"),
    [
        (PLANE, NOISE, "nothing limits the amplitude"),
        (OSCILLATOR, MarkovChain.telegraph(0.5, 1.0), "no white noise, impulses or chains"),
    ],
)
def test_what_has_no_nonlinear_response(system, noise, words):
    with pytest.raises(FpsolveError, match=words):
        response(Problem(system, noise))


@pytest.mark.slow
def test_progress_is_reported():
    calls = []
    moments(Problem(OSCILLATOR, NOISE), [1.0], estimator="population", progress=lambda: calls.append(1))
    assert len(calls) == PROGRESS_STEPS
    response(Problem(OSCILLATOR, NOISE), progress=lambda: calls.append(1))
    assert len(calls) == 3 * PROGRESS_STEPS
