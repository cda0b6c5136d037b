"""A sample of `tests.campaign`: random problems of every family, each number beside a second method."""

import numpy as np
import pytest

from fpsolve.theory import scale_of
from tests.campaign import FAMILIES
from tests.campaign.numbers import elements
from tests.campaign.paths import numbers_of_agreement, numbers_of_responses, numbers_of_simulations
from tests.campaign.planar import numbers, oscillator

EVEN = (0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12, 23, 26, 49, 53)
"""Planar systems that take least."""
QUICK = {
    "planar": (0, 4),
    "walls": (0, 2, 5, 8, 9),
    "paper": (2, 12, 18),
    "tolerances": (8, 10),
    "units": (0, 4, 9),
    "many": (1, 2, 4, 8, 10, 12, 14, 16, 24, 33),
    "delays": (1, 2, 4, 5, 8, 12),
    "fits": (3,),
    "proofs": (3,),
}
SLOW = {
    "planar": (2, 5, 8),
    "walls": (10, 11),
    "paper": range(20, 26),
    "tolerances": (1,),
    "units": range(10, 13),
    "many": (3, 7),
    "delays": (2, 3),
    "loose": (0,),
    "fits": (0,),
    "proofs": (0, 1),
}
"""The other families, and more seeds, are for the program: a minute or more each."""
ITEMS = [
    *(pytest.param(family, seed, id=f"{family} {seed}") for family, seeds in QUICK.items() for seed in seeds),
    *(
        pytest.param(family, seed, id=f"{family} {seed}", marks=pytest.mark.slow)
        for family, seeds in SLOW.items()
        for seed in seeds
    ),
]


def right(found):
    """Each number is given, and within what it states, and a second method tells of one at least."""
    every = [*found]
    assert not [str(each) for each in every if each.is_wrong or each.found.reason]
    assert not all(each.is_unknown for each in every)


@pytest.mark.parametrize(("family", "seed"), ITEMS)
def test_numbers_of_random_problems_are_those_of_second_methods(family, seed):
    right(FAMILIES[family][0](seed))


@pytest.mark.parametrize("seed", EVEN)
def test_even_moments_of_random_planar_systems_are_those_of_closed_equations(seed):
    right(numbers(seed, has_others=False))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_a_random_system_is_simulated(seed):
    right(numbers_of_simulations(seed, paths=4096, lengths=1.0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9])
def test_both_estimators_agree_with_elements(seed):
    right(numbers_of_agreement(seed, paths=2048, transients=8))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_means_of_a_random_response_are_those_of_paths(seed):
    right(numbers_of_responses(seed, rtol=1e-3, paths=1024))


def test_random_oscillators_of_the_paper_are_solved_to_the_tolerance_in_milliseconds():
    """`python -m tests.campaign paper` compares 300 with Fourier series."""
    seconds = []
    for seed in range(30):
        system, p = oscillator(seed)
        [found] = elements(system.problem, [p], 1e-8)
        assert found.stated <= 1e-8 * max(abs(found.value), scale_of(system.problem).moment(p))
        seconds.append(found.seconds)
    assert max(seconds) < 2
    assert np.median(seconds) < 0.05
