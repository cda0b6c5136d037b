"""Notes on weak noise, forms of moments, and the command that compares with them, where it must differ."""

from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, Problem, VibroImpactOscillator, moment_lyapunov
from fpsolve.errors import NoHierarchy
from fpsolve.exponent import even_moment
from fpsolve.messages import Code
from fpsolve.model import Bounded, White
from fpsolve.theory.perturbation import perturbed_moments, weak_noise_note
from tests.conftest import sampled
from tests.kit import matrices, run
from tests.numbers.rows.even import NOISES, WAVY, drawn
from tests.numbers.second import LOAD, even, spring
from tests.oracles import perturbation

CASE = """
title = "hierarchy"
[system]
kind = "parametric"
stiffness = 1.0
damping = 0.05
[noise]
kind = "telegraph"
a = 0.5
k = 1.0
[moments]
p = [-1.0, 1.0, 2.0, 4.0]
[vary]
"noise.k" = [0.5, 1.0]
"""


@pytest.mark.parametrize("name", sampled(*NOISES, keep=3))
def test_moments_as_matrices_are_those_as_one_vector(monkeypatch, name):
    drift, load = drawn(7, 3)
    monkeypatch.setattr("fpsolve.exponent.moments.MOST_AS_POWERS", 0)
    found = even_moment(matrices(drift, 0.3 * load, NOISES[name]), 2)
    assert abs(found.value - even(2, drift, (0.3 * load, NOISES[name]))) <= found.error + 1e-11


def test_error_of_moments_is_what_few_functions_lack(rng):
    problem = matrices(spring(), LOAD, OrnsteinUhlenbeck(1.0, 1.0))
    exact, found = even_moment(problem, 4).value, even_moment(problem, 4, 1e-3)
    assert found.error == pytest.approx(abs(found.eigenvalue - exact), rel=0.2)
    assert abs(found.value - exact) <= 0.25 * abs(found.eigenvalue - exact)  # as the lacking ones are in the value
    for _ in range(2):
        problem = matrices(*rng.standard_normal((2, 2, 2)), OrnsteinUhlenbeck(1.0, 1.0))
        exact = even_moment(problem, 4).value
        for tolerance in (1e-2, 1e-7):
            found = even_moment(problem, 4, tolerance)
            assert abs(found.value - exact) <= found.error <= tolerance


@pytest.mark.parametrize("most", [30, 70])
def test_functions_that_see_little_of_the_noise_and_are_too_many_give_no_moment(most):
    with pytest.raises(NoHierarchy, match="are too few"):
        even_moment(WAVY, 2, most=most)


def test_command_compares_with_the_moments_and_tells_what_differs(tmp_path, monkeypatch):
    found = run(tmp_path, "check", "--hierarchy", "case.toml", "--jobs", "1", case=CASE)
    assert found.code == 0
    assert all(each in found.out for each in ("4 of 4 ok", "moment, p = 4", "-0.0332610990213"))
    for override, words in (
        ("system.restitution=0.9", "with noise.k = 0.5: the equations of the moments do not close where a wall"),
        ("moments.p=[1.0, 3.0]", "moments.p: has no even p > 0, and the hierarchy is for these; add 2.0"),
    ):
        refused = run(tmp_path, "check", "--hierarchy", "case.toml", "--set", override)
        assert refused.code == 2
        assert words in " ".join(refused.err.split())
    monkeypatch.setattr("fpsolve.solve.check.even_moment", lambda *_: SimpleNamespace(value=0.1, error=1e-12))
    failed = run(tmp_path, "check", "--hierarchy", "case.toml", "--jobs", "1", "--quiet")
    assert (failed.code != 0, failed.out) == (True, "case: 0 of 4 ok\n")


def test_note_on_strong_noise_has_the_largest_share_and_weak_noise_none():
    p, noise = np.array([-1.0, 0.0, 1.0, 2.0]), OrnsteinUhlenbeck(alpha=2.0, sigma=2.8)
    weak, strong = (VibroImpactOscillator(1.0, 0.8, 0.1, epsilon) for epsilon in (0.1, 0.6))
    values = [moment_lyapunov(Problem(each, noise), p, rtol=1e-6).value for each in (weak, strong)]
    assert weak_noise_note(Problem(weak, noise), p, values[0]) is None
    note = weak_noise_note(Problem(strong, noise), p, values[1])
    rest = values[1] - perturbation.moment_exponent(strong, noise, p)
    shares = np.abs(rest[p != 0]) / perturbation.moment_scale(strong, noise, p[p != 0])
    worst = shares.argmax()
    told = f"is {rest[p != 0][worst]:.3g}, {shares.max():.0%} of them, at p = {p[p != 0][worst]:g}"
    assert told in note


def test_no_theory_stands_beside_a_harmonic_load():
    """Its S is 0 at all frequencies but one, as if it did not pump; the note names it, and not strong noise."""
    p, value = np.array([1.0, 2.0]), np.array([0.3, 0.6])
    pumped, noisy = (
        matrices(spring(1.69, 0.1), [LOAD, LOAD], [Bounded(0.5, 2.6, sigma), White(s=0.1)]) for sigma in (0.0, 2.0)
    )
    assert np.all(np.isnan(perturbed_moments(pumped, p)))
    note = weak_noise_note(pumped, p, value)
    assert note.code is Code.LOAD_LEFT_OUT
    assert "noise.xi1 with sigma = 0 is" in str(note)
    assert weak_noise_note(noisy, p, value).code is Code.STRONG_NOISE
