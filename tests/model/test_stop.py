"""A wall of one coordinate of several variables: what an impact is, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fpsolve.errors import NoSuchExponent
from fpsolve.exponent import ExponentSolver
from fpsolve.model import LinearSystem, ModalSystem, PlaneSystem, Problem, Telegraph, White, equations_of
from fpsolve.model.plane import Stop

RATES = "v", "-q - 0.1*v - xi*q - 0.3*y", "w", "-2*y - 0.2*w - 0.3*q"
TELEGRAPH = Telegraph(a=0.5, k=0.7)


def modes(at="q1 - c*q2 = 0", restitution="R", noise=((1, 0.2), (0.2, 0)), **named):
    return ModalSystem.of(
        [[1, "m"], ["m", 2]],
        [[2, 0], [0, 3]],
        stiffness_noise=noise,
        parameters={"m": 0.3, "c": 0.5, "R": 0.6, **named},
        walls=[{"at": at, "restitution": restitution}],
    )


def equations(at="q = 0", restitution=0.6):
    wall = {"at": at, "restitution": restitution}
    return PlaneSystem.of_equations(("q", "v", "y", "w"), RATES, walls=[wall])


def test_masses_share_an_impact_by_the_law_of_impulses():
    mass, c = np.array([[1, 0.3], [0.3, 2]]), np.array([1, -0.5])
    push = np.linalg.solve(mass, c)
    jump = np.eye(2) - 1.6 * np.outer(push, c) / (c @ push)
    stop = modes().stop
    assert_allclose(stop.matrix[1::2, 1::2], jump, atol=1e-14)
    assert_allclose(stop.matrix[::2], np.eye(4)[::2])
    assert_allclose(np.array(stop.coordinates)[2:] @ stop.matrix, np.array(stop.coordinates)[2:], atol=1e-14)
    assert_allclose(stop.inside(stop.matrix), np.diag([1, -0.6, 1, 1]), atol=1e-12)
    elastic = modes(R=1.0).stop.matrix[1::2, 1::2]
    assert_allclose(elastic.T @ mass @ elastic, mass, atol=1e-14)  # of the same energy


def test_a_parameter_that_moves_the_coordinates_has_no_derivative():
    assert modes(m=0.7).at({"m": 0.3}).stop == modes().stop
    assert modes().differentiable == ("R",)
    assert equations(restitution="0.6").stop.restitution == pytest.approx(0.6, rel=1e-15)


def test_equations_print_the_impact():
    assert equations_of(equations())[-1] == "v⁺ = −0.6 v at q = 0"
    assert equations_of(modes())[-1].endswith("at q1 − 0.5 q2 = 0")


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda: equations("v = 0"), "there v's rate must be c\\*v"),
        (lambda: equations("q + y = 0"), 'is for kind = "modes"'),
        (lambda: equations(restitution=1.01), "must be <= 1"),
        (lambda: equations(restitution=-0.5), "must be > 0"),
        (lambda: modes("q1 = 1"), "the modes are q1, q2"),
        (lambda: modes("q1_dot = 0"), "unknown name q1_dot"),
        (lambda: modes(m=1.5, c=1.0), "> 0, as of a positive definite matrix"),
        (lambda: Stop(np.eye(2), 0.5), "n ≥ 3 with an inverse"),
        (lambda: Stop(np.eye(3), 0.0), "must be > 0 and <= 1"),
        (lambda: Problem(LinearSystem(equations().terms, stop=Stop(np.eye(3), 0.5)), TELEGRAPH), "3 coordinates of 4"),
        (
            lambda: Problem(LinearSystem(equations().terms, stop=Stop(np.eye(4)[[2, 1, 0, 3]], 0.5)), TELEGRAPH),
            "second",
        ),
        (
            lambda: Problem(LinearSystem(equations().terms, stop=Stop(np.eye(4)[[1, 0, 2, 3]], 0.5)), TELEGRAPH),
            "a noise",
        ),
    ],
)
def test_what_is_no_wall_is_refused(made, told):
    with pytest.raises(ValueError, match=told):
        made()


def test_a_mass_that_white_noise_brings_to_rest_is_refused():
    """Below exp(−π/√3) infinitely many impacts bring an integral of white noise to rest (E. Jacob, arXiv:1004.1953)."""
    with pytest.raises(ValueError, match=r"0\.163034.*Bertoin"):
        Problem(modes(restitution=0.163), White(s=0.1))
    Problem(modes(restitution=0.1631), White(s=0.1))
    Problem(modes(restitution=0.1), TELEGRAPH)
    Problem(modes("q1 = 0", 0.1, noise=((1, 0), (0, 0)), m=0.0), White(s=0.1))  # which is 0 there


def test_what_is_not_computed_is_refused_by_name():
    wall = {"at": "q = 0", "restitution": 0.6}
    rates = "v", "-q - 0.1*v - xi*q - 0.3*y", "-y - 0.3*q"
    three = PlaneSystem.of_equations(("q", "v", "y"), rates, walls=[wall])
    solver = ExponentSolver(Problem(three, TELEGRAPH))
    for ask in (solver.lyapunov_exponent, lambda: solver.pair(2.0), lambda: solver.pair(1.0)):
        with pytest.raises(NoSuchExponent, match="at a wall of more than two variables"):
            ask()
