"""More than four variables: even p, by Kronecker products."""

from functools import partial

import numpy as np

from fpsolve import OrnsteinUhlenbeck, Problem
from fpsolve.model import ModalSystem, Poisson, White
from tests.kit import chain_of_masses, matrices
from tests.numbers.by_problem import by_moments
from tests.numbers.second import even
from tests.numbers.values import Row, moment, slope, slope_by


def masses(count: int, noise, damping: float = 0.02):
    """A chain with noise in its first spring, and the damping ratio as a parameter."""
    free, driven, _ = chain_of_masses(count, 1.0)
    stiffness, damper, load = -free[count:, :count], -free[count:, count:], -driven[count:, :count]
    damper = [[f"{each!r}*zeta" for each in row] for row in damper.tolist()]
    values = {"zeta": damping}
    return Problem(ModalSystem.of(np.eye(count), stiffness, damper, stiffness_noise=load, parameters=values), noise)


def by_kronecker(count: int, p: int, alpha: float = 1.0, sigma: float = 0.3, zeta: float = 0.02) -> float:
    free, driven, _ = chain_of_masses(count, zeta)
    return even(p, free, (driven, OrnsteinUhlenbeck(alpha, sigma)), count=10, near=None)


def difference(count: int, key: str, at: float) -> float:
    ahead, behind = (by_kronecker(count, 2, **{"sigma": 0.4, key: at * (1 + step)}) for step in (1e-4, -1e-4))
    return (ahead - behind) / (2e-4 * at)


def struck(count: int):
    rng, still, one = np.random.default_rng(5), np.zeros((count, count)), np.eye(count)
    stiffness, damping, load = rng.standard_normal((3, count, count)) / 5
    stiffness -= np.diag(np.linspace(0.7, 4, count))
    return np.block([[still, one], [stiffness, 0.3 * (damping - one)]]), np.block([[still, still], [load, still]])


THREE = matrices(*np.random.default_rng(20).standard_normal((2, 3, 3)), White(s=0.5))
DENSE = (
    (0.16668973980979807, 0.23680414552986853, 0.16150317471122555),
    (0.15391505563304891, -0.3378594748085906, -0.8262245147008055),
    (0.1884994187295985, 0.15101233647581958, -0.9825750390291139),
)
DENSE_LOAD = (
    (-0.2512631342231162, -0.2060524212676378, -0.14396123066384206),
    (-0.19241871034233513, 0.1706016196225432, 0.05958345840226083),
    (0.3045398467934622, 0.25567618468872927, 0.16342331110213987),
)
"""A system without symmetries, to which elements on directions come slowly."""
DAMPED = ((-1.5612, -0.6549, -0.6816), (0.8191, 0.4922, -0.262), (-0.3801, -0.9241, -1.4047))
MOVED = ((0.2466, 0.2531, 0.2606), (-0.0608, -0.1893, 0.7478), (0.3586, -0.1471, -0.1528))
"""Of which functions of degree 2 hold Λ(2), and have a slope of 0.516."""

ROWS = [
    Row(
        matrices(DAMPED, MOVED, White(s=1.0)),
        slope(2.0),
        *(0.5640, 5e-5, 3e-3, "differences of Λ(2 ± 0.3) and Λ(2 ± 0.6)"),
        slow=True,
    ),
    Row(
        matrices(DENSE, DENSE_LOAD, White(s=0.59)),
        moment(1.0, rtol=1e-4),
        *(0.21640676535877, 1e-6, 1e-4, "homogeneous polynomials of three variables"),
        slow=True,
    ),
    *(
        Row(
            masses(3, OrnsteinUhlenbeck(1.0, 0.3)),
            moment(float(p)),
            partial(by_kronecker, 3, p),
            *(1e-13, 1e-7, "Kronecker products of three masses"),
            slow=p > 2,
        )
        for p in (2, 4)
    ),
    *(
        Row(
            masses(3, OrnsteinUhlenbeck(1.0, 0.4)),
            slope_by(key, 2.0, rtol=1e-9),
            partial(difference, 3, key.split(".")[1], at),
            *(1e-6, 1e-5, "differences of Kronecker products of three masses"),
        )
        for key, at in (("system.zeta", 0.02), ("noise.alpha", 1.0), ("noise.sigma", 0.4))
    ),
    *(
        Row(
            problem,
            moment(2.0),
            partial(by_moments, problem, 2, near=0.5),
            *(1e-12, 1e-8, f"Kronecker products of {count} masses under impulses"),
            slow=count > 2,
        )
        for count in (2, 12)
        for problem in [matrices(*struck(count), Poisson(2.0, (-0.4, 0.2)))]
    ),
    Row(
        THREE,
        moment(2.0, rtol=1e-3),
        partial(by_moments, THREE, 2),
        *(1e-11, 1e-10, "Kronecker products of three variables at a loose tolerance"),
    ),
]
