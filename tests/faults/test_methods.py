"""A method gives a number or a reason: each is called with random problems of every family."""

import pytest

from fpsolve import ExponentSolver, FpsolveError, moment_lyapunov, prove, sensitivities
from fpsolve.analysis import excursion
from fpsolve.exponent import Budget, even_moment, lyapunov_exponent, stability_index, stationary_moments
from fpsolve.theory import frozen_noise, second_order
from tests.campaign import planar, spaces

LITTLE = {"budget": Budget(seconds=0.3, unknowns=2000), "rtol": 1e-4}
METHODS = {
    "Λ(2)": lambda problem: moment_lyapunov(problem, 2.0, **LITTLE),
    "Λ(−0.5), Λ(1)": lambda problem: moment_lyapunov(problem, [-0.5, 1.0], **LITTLE),
    "λ": lambda problem: lyapunov_exponent(problem, **LITTLE),
    "δ_p": lambda problem: stability_index(problem, **LITTLE),
    "Λ″(0)": lambda problem: ExponentSolver(problem, **LITTLE).variance_rate(),
    "pair": lambda problem: ExponentSolver(problem, **LITTLE).pair(2.0),
    "sensitivities": lambda problem: sensitivities(problem, 2.0, **LITTLE),
    "excursions": lambda problem: excursion(problem, **LITTLE),
    "closed Λ(4)": lambda problem: even_moment(problem, 4),
    "response": stationary_moments,
    "weak noise": second_order,
    "slow noise": frozen_noise,
    "proof": lambda problem: prove(problem, 2.0, budget=Budget(seconds=0.3)),
}
FAMILIES = {
    "planar": lambda seed: planar.drawn(seed).problem,
    "walls": lambda seed: planar.walled(seed).problem,
    "paper": lambda seed: planar.oscillator(seed)[0].problem,
    "modes": spaces.modes,
    "stops": spaces.stopped,
    "many": lambda seed: spaces.many(seed)[0],
    "delays": lambda seed: spaces.delayed(seed)[0],
}
LONG = {"modes", "stops", "many"}
"""Families that take seconds."""
SEEDS = 2, 6


def reason(method, problem) -> str:
    """Why a method gives nothing, with a remedy where its class does not tell that this is a reason; or none."""
    try:
        method(problem)
    except FpsolveError as why:
        return f"{why}; "
    except (ValueError, TypeError) as why:
        return str(why)
    return "; "


def unreasonable(family, seeds):
    """The methods that fail without a reason."""
    problems = {seed: FAMILIES[family](seed) for seed in seeds}
    told = {(seed, name): reason(METHODS[name], problems[seed]) for seed in seeds for name in METHODS}
    return {key: words for key, words in told.items() if "; " not in words}


@pytest.mark.parametrize("family", [pytest.param(each, marks=[pytest.mark.slow] * (each in LONG)) for each in FAMILIES])
def test_methods_give_a_number_or_a_reason(family):
    assert unreasonable(family, [1]) == {}


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_methods_give_a_number_or_a_reason_for_more_problems(family):
    assert unreasonable(family, SEEDS) == {}
