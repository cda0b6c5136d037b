"""Blocks of variables of systems of three and four variables: found from all matrices, and systems by themselves."""

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, LinearSystem, ModalSystem, White
from fpsolve.model.plane import matrix_at

OU = OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)
CASCADE = "v", "-x - 0.2*v + kappa*z - load*x", "x - 2*z + sway*z"
"""Of x and v, which drive z, and are driven back where kappa is not 0."""
TWO = {"axial": OU, "lateral": White(s=0.3)}


def cascade(kappa=0.0, order=("x", "v", "z")):
    rates = dict(zip(("x", "v", "z"), CASCADE, strict=True))
    noises = {"load": "noise.axial", "sway": "noise.lateral"}
    return PlaneSystem.of_equations(order, [rates[name] for name in order], {"kappa": kappa}, noises=noises)


def named(problem):
    return [block.names for block in problem.blocks]


@pytest.mark.parametrize("order", [("x", "v", "z"), ("z", "x", "v"), ("v", "z", "x")])
def test_drivers_come_first_in_any_order_of_the_variables(order):
    problem = Problem(cascade(order=order), TWO)
    first, second = named(problem)
    assert (set(first), second) == ({"x", "v"}, ("z",))
    assert problem.is_driven_by.tolist() == [[True, False], [True, True]]


def test_each_has_the_matrices_and_the_noises_that_are_its_own():
    pair, alone = Problem(cascade(), TWO).classes
    np.testing.assert_array_equal(matrix_at(pair.system, 2.0), [[0, 1], [-3, -0.2]])
    np.testing.assert_array_equal(matrix_at(alone.system, 2.0), [[0, 1], [-1, 0]])  # ż = −2z + 2z, and a rotation
    assert pair.noise is TWO["axial"]
    assert alone.noise is TWO["lateral"]
    assert {"noise.axial.sigma", "system.kappa"} <= set(pair.differentiable)
    assert "noise.lateral.s" in alone.differentiable


def test_one_coupling_more_leaves_none():
    problem = Problem(cascade(1e-9), TWO)
    assert problem.blocks == problem.classes == ()
    assert not problem.couples_blocks("system.kappa")
    assert Problem(cascade(), TWO).couples_blocks("system.kappa")


@pytest.mark.parametrize(
    ("entries", "sizes"),
    [([], [1, 1, 1]), ([(0, 1)], [1, 1, 1]), ([(0, 1), (1, 0)], [2, 1]), ([(0, 1), (1, 2), (2, 0)], [])],
)
@pytest.mark.parametrize("noise", [OU, White(s=1.0), White(s=1.0, interpretation="ito")])
def test_noise_couples_too(entries, sizes, noise):
    driven = np.zeros((3, 3))
    for at in entries:
        driven[at] = 0.3
    free = CoefficientMatrix(0, np.diag([-1.0, -2.0, -3.0]).tolist())
    system = LinearSystem([free, CoefficientMatrix(1, driven.tolist(), identity)])
    assert [len(names) for names in named(Problem(system, noise))] == sizes


def modes(k, noise):
    unit, stiffness = [[1.0, 0.0], [0.0, 1.0]], [[1.0, "k"], ["k", 2.0]]
    return Problem(ModalSystem.of(unit, stiffness, unit, stiffness_noise=noise, parameters={"k": k}), OU)


def test_modes_without_a_coupling():
    """Noise that is like the damping and the mass leaves the modes of the stiffness apart."""
    unlike, alike = [[1.0, 0.0], [0.0, 0.5]], [[1.0, 0.0], [0.0, 1.0]]
    names = [("q1", "q1_dot"), ("q2", "q2_dot")]
    assert named(modes(0.0, unlike)) == names
    assert not modes(0.0, unlike).couples_blocks("system.k")  # Λ is even in what couples blocks that nothing couples
    assert named(modes(0.1, unlike)) == []
    assert named(modes(0.1, alike)) == [("y₁", "y₂"), ("y₃", "y₄")]


def test_a_block_has_the_derivatives_of_the_whole():
    system = PlaneSystem.of_equations(
        ("y", "x", "v"), ("-a*y", "v", "-b**2*x - 2*a*b*v + c*y - b*xi*x"), {"a": 0.3, "b": 2.0, "c": 1.0}
    )
    slow, fast = Problem(system, OU).classes
    assert [block.system.derivative("c") for block in (slow, fast)] == [((), ())] * 2
    [by_a], _ = slow.system.derivative("a")
    assert by_a.matrix == ((-1.0, 0.0), (0.0, -1.0))
    by_b = {term.g is identity: term.matrix for term in fast.system.derivative("b")[0]}
    assert by_b == {False: ((0.0, 0.0), (-4.0, -0.6)), True: ((0.0, 0.0), (-1.0, 0.0))}
