"""Internals of the solver of Λ(p) that no number shows: errors told beforehand, coordinates, curves, convexity."""

from dataclasses import replace

import numpy as np
import pytest

from fpsolve.exponent import principal_pair
from fpsolve.exponent.curve import polynomial, values
from fpsolve.exponent.modes import SphereStart, modal_coordinates
from fpsolve.exponent.solver import broken_convexity
from fpsolve.fem.space import Space, first_axis
from fpsolve.model import OrnsteinUhlenbeck
from tests.numbers.rows.modes import random_system
from tests.numbers.test_identities import changed


def on_sphere(problem, waves=4, **changes):
    """Directions with so many waves, and functions of the noise."""
    noises = [replace(first_axis(each, 5), **changes) for each in problem.valued.parts.values()]
    return SphereStart(problem, Space((replace(SphereStart.directions(problem), waves=waves), *noises)))


def test_generator_of_many_variables_prints_its_terms():
    text = str(on_sphere(random_system(0, 3)).generator)
    assert all(f"  {term}\n" in text for term in ("ε⁰:  h·∇", "ε⁰:  p q", "ε⁰:  L_ξ, the generator of the noise")), text


def test_what_finer_waves_change_is_told_to_first_order():
    start, finer = (on_sphere(random_system(0, 3), waves) for waves in (4, 6))
    found = [principal_pair(each.generator, 1.0) for each in (start, finer)]
    change, solution = found[1].value - found[0].value, start.judged(found[0], 1.0)
    assert solution.pair.correction == pytest.approx(change, rel=0.1)
    assert abs(solution.pair.value - found[1].value) < min(0.1 * abs(change), solution.unresolved)


def test_what_polynomials_of_the_noise_lack_is_told():
    start = on_sphere(random_system(1, 3, OrnsteinUhlenbeck(alpha=1.2, sigma=1.6)), count=6)
    finer = replace(start, space=start.space.with_axis(1, start.space.xi.enriched()), generators={})
    pair = start.solved(0.5, None)
    lacking = abs(finer.solved(0.5, pair).eigenvalue - pair.eigenvalue)
    assert lacking < start.judged(pair, 1e-12).measured[1] < 50 * lacking


@pytest.mark.parametrize("seed", range(4))
def test_layers_of_directions_are_those_of_the_system_in_other_coordinates(seed):
    problem, turn = random_system(seed, 4), np.random.default_rng(seed).standard_normal((4, 4))
    assert modal_coordinates(changed(problem, turn))[1] == pytest.approx(modal_coordinates(problem)[1], rel=1e-3)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("corner", [-0.83, 0.07, 0.77])
def test_no_corner_of_a_curve_is_passed_over(size, corner):
    """However small: it is refused, or its error covers it."""

    def ratio(p):
        return np.exp(0.1 * p) + size * np.maximum(p - corner, 0.0)

    def solved(p):
        return ratio(p), 0.1 * np.exp(0.1 * p) + size * (p > corner), 1e-12

    p = np.linspace(-1, 1, 501)
    curve = polynomial(solved, -1.0, 1.0, lambda p: 1e-8)
    assert curve or size > 1e-8
    found = values([curve] if curve else [], p)
    assert np.all(np.abs(found.value - p * ratio(p)) <= found.error + 1e-15) or not curve


@pytest.mark.parametrize("wrong", [0, 4321, 14_999])
def test_of_many_moments_one_that_breaks_convexity_is_found(wrong):
    p = np.linspace(-2.0, 6.0, 15_000)
    value, slope, errors = 0.3 * p**2 - 0.1 * p, 0.6 * p - 0.1, np.full(p.size, 1e-9)
    assert broken_convexity(p, value, slope, errors, lambda: errors) is None
    value[wrong] += 1e-4
    assert broken_convexity(p, value, slope, errors, lambda: errors).data["p"] in p[[max(wrong - 1, 0), wrong]]
