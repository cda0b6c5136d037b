"""Modes by their matrices, against the same systems by equations, by matrices inverted with NumPy, and in the plane."""

import pickle

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem, moment_lyapunov, sensitivities
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, LinearSystem, ModalSystem, ParametricOscillator, White
from fpsolve.model.faults import TableError
from tests.conftest import sampled

MASS, DAMPING = [[1.3, 0.2], [0.1, "m2"]], [[0.1, 0.02], ["c", 0.16]]
STIFFNESS = [["1 + 0.3*U**2", "U"], [0.4, "omega**2"]]
GYROSCOPIC, CIRCULATORY = [[0, "-g"], ["g", 0]], [[0.0, 0.3], [-0.3, 0.0]]
NOISY = [[0.5, "0.3*U"], [0.3, 0.5]]
VALUES = {"m2": 0.8, "c": 0.05, "U": 1.2, "omega": 1.6, "g": 0.25}


def modes(**values):
    return ModalSystem.of(
        MASS,
        STIFFNESS,
        DAMPING,
        gyroscopic=GYROSCOPIC,
        circulatory=CIRCULATORY,
        stiffness_noise={"wind": NOISY},
        damping_noise={"wave": [[0.1, 0.0], [0.0, 0.2]], "wind": [[0.0, 0.1], [0.0, 0.0]]},
        parameters={**VALUES, **values},
        noises={"wind": "noise.wind", "wave": "noise.wave"},
    )


def expected(m2, c, U, omega, g):
    """The matrices of (q1, q1_dot, q2, q2_dot): without noise, of wind and of wave."""
    inverse = np.linalg.inv([[1.3, 0.2], [0.1, m2]])

    def state(of_q, of_speed, identity=0.0):
        total = np.zeros((4, 4))
        total[0, 1] = total[2, 3] = identity
        total[1::2, 0::2], total[1::2, 1::2] = -inverse @ of_q, -inverse @ of_speed
        return total

    stiffness = np.array([[1 + 0.3 * U**2, U + 0.3], [0.4 - 0.3, omega**2]])
    return {
        "": state(stiffness, np.array([[0.1, 0.02 - g], [c + g, 0.16]]), 1.0),
        "wind": state(np.array([[0.5, 0.3 * U], [0.3, 0.5]]), np.array([[0, 0.1], [0, 0]])),
        "wave": state(np.zeros((2, 2)), np.diag([0.1, 0.2])),
    }


def test_matrices_of_two_modes():
    found = {term.noise: np.array(term.matrix) for term in modes().terms}
    for noise, matrix in expected(**VALUES).items():
        np.testing.assert_allclose(found[noise], matrix, atol=1e-14)
    assert modes().variables == ("q1", "q1_dot", "q2", "q2_dot")
    assert pickle.loads(pickle.dumps(modes())) == modes()


@pytest.mark.parametrize("name", VALUES)
def test_derivatives_by_parameters(name):
    """Also by a mass, against differences."""
    step = 1e-5
    terms, _ = modes().derivative(name)
    beside = [expected(**{**VALUES, name: VALUES[name] + side * step}) for side in (-1, 1)]
    for noise in ("", "wind", "wave"):
        slope = (beside[1][noise] - beside[0][noise]) / (2 * step)
        found = sum((np.array(term.matrix) for term in terms if term.noise == noise), np.zeros((4, 4)))
        np.testing.assert_allclose(found, slope, atol=1e-9)
    np.testing.assert_allclose(
        modes().at({name: 1.1}).terms[0].matrix, expected(**{**VALUES, name: 1.1})[""], atol=1e-14
    )


def test_one_mode_is_an_oscillator():
    noise = OrnsteinUhlenbeck(alpha=1.0, sigma=0.7)
    ours = Problem(
        ModalSystem.of([["m"]], [["2*m"]], [["0.2*m"]], stiffness_noise=[["m"]], parameters={"m": 3.0}), noise
    )
    plain = moment_lyapunov(Problem(ParametricOscillator(stiffness=2.0, damping=0.1), noise), 2.0)
    assert moment_lyapunov(ours, 2.0).value[0] == pytest.approx(plain.value[0], rel=1e-12)
    assert abs(sensitivities(ours, 2.0).moments[0]["system.m"].value) < 1e-10


@pytest.mark.parametrize("seed", sampled(*range(4), keep=2))
def test_one_mode_and_its_matrices_are_one_system_of_the_plane(seed):
    """By mass, damping and stiffness, by matrices of any dimension, and by equations, to 1e-10."""
    rng = np.random.default_rng([30, seed])
    m, (k, k_noise), (c, c_noise) = rng.uniform(0.5, 2.0), rng.uniform(0.5, 3.0, 2), rng.uniform(0.0, 0.4, 2)
    noise = White(s=0.5) if seed % 2 else OrnsteinUhlenbeck(alpha=1.0, sigma=0.6)
    mode = ModalSystem.of([[m]], [[k]], [[c]], stiffness_noise=[[k_noise]], damping_noise=[[c_noise]])
    matrices = (
        CoefficientMatrix(0, ((0.0, 1.0), (-k / m, -c / m))),
        CoefficientMatrix(1, ((0.0, 0.0), (-k_noise / m, -c_noise / m)), identity),
    )
    values = {"m": m, "k": k, "K": k_noise, "c": c, "C": c_noise}
    written = PlaneSystem.of_equations(("q", "v"), ("v", "-((k + K*xi)*q + (c + C*xi)*v)/m"), values)
    systems = mode, LinearSystem(matrices), PlaneSystem(matrices), written
    found = [moment_lyapunov(Problem(each, noise), [-0.5, 1.0, 3.0], rtol=1e-11).value for each in systems]
    for each in found[1:]:
        np.testing.assert_allclose(each, found[0], rtol=1e-10, atol=1e-11)


FAULTS = {
    "mass: got [[1.0, 1.0], [1.0, 1.0]]; must have an inverse": {"mass": [[1.0, 1.0], [1.0, 1.0]]},
    "mass: got []; must be a matrix of 1 to 100 rows": {"mass": []},
    "stiffness: got ((1.0,),); must be 2 rows of 2": {"stiffness": ((1.0,),)},
    "stiffness[0][1]: the entry has the unknown name k": {"stiffness": [[1.0, "k"], [0.0, 1.0]]},
    "stiffness[1][0]: got None; must be a number": {"stiffness": [[1.0, 0.0], [None, 1.0]]},
    "gyroscopic: got [[0.0, 1.0], [1.0, 0.0]]; must be skew-symmetric": {"gyroscopic": [[0, 1], [1, 0]]},
    "noises.xi: xi is in no matrix": {"stiffness_noise": [[0.0, 0.0], [0.0, 0.0]]},
    "stiffness_noise.wind: is none of the noises": {"stiffness_noise": {"wind": NOISY}},
    "modes: got 1 names of 2 modes": {"modes": ["heave"]},
    "modes: got the name 'q and more'": {"modes": ["q and more", "r"]},
}


@pytest.mark.parametrize(("said", "changed"), FAULTS.items())
def test_what_is_refused(said, changed):
    good = {"mass": [[1.0, 0.0], [0.0, 1.0]], "stiffness": [[1.0, 0.0], [0.0, 2.0]]}
    with pytest.raises(TableError) as caught:
        ModalSystem.of(**{**good, "stiffness_noise": [[1.0, 0.0], [0.0, 1.0]], **changed})
    assert str(caught.value).startswith(said)


def test_names_in_the_masses_of_three_modes():
    """Against differences of inverse matrices."""

    def mobility(m):
        return np.linalg.inv([[1.0, m, 0.0], [m, 2.0, 0.1], [0.0, 0.1, 1.5]])

    mass, stiffness = [[1.0, "m", 0.0], ["m", 2.0, 0.1], [0.0, 0.1, 1.5]], np.diag([1.0, 2.0, 3.0])
    system = ModalSystem.of(mass, stiffness, stiffness_noise=np.eye(3), parameters={"m": 0.2})
    still, driven = (np.array(term.matrix) for term in system.terms)
    np.testing.assert_allclose(still[1::2, ::2], -mobility(0.2) @ stiffness, atol=1e-14)
    np.testing.assert_allclose(driven[1::2, ::2], -mobility(0.2), atol=1e-14)
    slope, _ = (np.array(term.matrix) for term in system.derivative("m")[0])
    by_difference = (mobility(0.2 + 1e-5) - mobility(0.2 - 1e-5)) / 2e-5
    np.testing.assert_allclose(slope[1::2, ::2], -by_difference @ stiffness, atol=1e-9)
