"""∂Λ(2)/∂θ of every parameter of every noise, by differences of moment equations."""

import numpy as np

from fpsolve import OrnsteinUhlenbeck
from fpsolve.model import (
    Bounded,
    Filter,
    MarkovChain,
    OrnsteinUhlenbeckByDeviation,
    OrnsteinUhlenbeckByIntensity,
    Poisson,
    SineWiener,
    Telegraph,
    White,
)
from tests.kit import rates
from tests.numbers.second import LOAD, even, slope_of, spring
from tests.numbers.values import Row, by, closed_by
from tests.oracles import moment_hierarchy

SPRING = "x' = v; v' = -stiffness*x - 2*damping*v - xi*x"
OWN = {"stiffness": 1.3, "damping": 0.1}
KINDS = (
    (White, {"s": 0.7}),
    (Telegraph, {"a": 0.5, "k": 1.0}),
    (OrnsteinUhlenbeck, {"alpha": 1.0, "sigma": 0.8}),
    (OrnsteinUhlenbeckByIntensity, {"D0": 0.6, "tau0": 1.4}),
    (OrnsteinUhlenbeckByDeviation, {"alpha": 0.7, "standard_deviation": 0.6}),
    (SineWiener, {"amplitude": 1.0, "sigma": 1.0}),
    (Bounded, {"mu": 0.4, "nu": 1.9, "sigma": 0.5}),
    (Filter, {"omega": 1.3, "zeta": 0.4, "s": 0.5, "c0": 0.7, "c1": -0.8}),
    (Poisson, {"rate": 1.2}),
    (
        MarkovChain,
        {"state_1": -0.6, "state_3": 0.8, "rate_1_2": 0.5, "rate_2_1": 0.7, "rate_2_3": 0.4, "rate_3_1": 1.1},
    ),
)


def made(kind, theta):
    if kind is MarkovChain:
        return kind((-1, 0, 1), ((0, 1, 0), (1, 0, 1), (1, 0, 0))).at(theta)
    return kind(**theta, sizes=(-0.5, 0.7)) if kind is Poisson else kind(**theta)


def value(kind, stiffness, damping, **theta):
    return even(2, spring(stiffness, damping), (LOAD, made(kind, theta)), count=9 if kind is Filter else 20)


def rows(kind, theta):
    problem = rates(SPRING, made(kind, theta), **OWN)
    for name in (*theta, *(OWN if kind in (White, Telegraph, Filter) else ())):
        key = f"system.{name}" if name in OWN else f"noise.{name}"
        for quantity in (closed_by(key, 2), *(() if kind is Filter else (by(key, 2.0),))):  # which takes a minute
            yield Row(
                problem,
                quantity,
                lambda name=name: slope_of(value, name, kind=kind, **OWN, **theta),
                1e-8,
                1e-4,
                f"differences of monomials: {kind.__name__}",
            )


def of_ito(a, b, epsilon):
    return even(2, spring(1.0, 0.1), (epsilon * np.array([[0.0, 0.0], [a, b]]), White(0.5, "ito")))


def ito(name):
    """A noise whose matrix does not commute with its derivative."""
    own = {"a": 0.8, "b": -0.6, "epsilon": 0.9}
    problem = rates("x' = v; v' = -x - 0.2*v + epsilon*xi*(a*x + b*v)", White(0.5, "ito"), **own)
    return Row(
        problem,
        by(f"system.{name}", 2.0),
        lambda: slope_of(of_ito, name, **own),
        1e-8,
        1e-5,
        "Itô's sense: differences",
    )


def of_load(mu, nu):
    return moment_hierarchy.harmonic_exponent(spring(), LOAD, mu, nu, 2, 0.3 * LOAD)


def loaded(name):
    problem = rates("x' = v; v' = -x - 0.1*v - (xi1 + xi2)*x", [Bounded(0.4, 1.9, 0.0), White(0.3)])
    right = (lambda: slope_of(of_load, name, mu=0.4, nu=1.9)) if name != "sigma" else 0.0
    return Row(problem, by(f"noise.xi1.{name}", 2.0), right, 1e-8, 1e-6, "differences of multipliers", True)


ROWS = [
    *(row for each in KINDS for row in rows(*each)),
    *map(loaded, ("mu", "nu", "sigma")),
    *map(ito, ("a", "b", "epsilon")),
]
