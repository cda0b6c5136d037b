"""ẍ + 2bẋ + (k + ξ)x = 0 with a wall at x = 0 under every kind of noise: moment hierarchies and closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    OrnsteinUhlenbeck,
    Problem,
    boundary,
    load_case,
    lyapunov_exponent,
    moment_lyapunov,
    sensitivities,
)
from fpsolve.analysis import Axis
from fpsolve.cli import main
from fpsolve.errors import CaseError
from fpsolve.exponent import critical_restitution
from fpsolve.model import ParametricOscillator, Telegraph, White, system_kind
from tests.oracles import closed_forms, moment_hierarchy, phase_circle

FLIP = np.array([[-1.0, 1.0], [1.0, -1.0]])


def drift(stiffness, damping):
    return [[0.0, 1.0], [-stiffness, -2 * damping]]


def driven(size):
    return [[0.0, 0.0], [-size, 0.0]]


def hierarchy(system, noise, p):
    """Λ(p) of even p for R = 1."""
    if isinstance(noise, White):
        return moment_hierarchy.white_noise_exponent(drift(system.stiffness, system.damping), [driven(noise.s)], p)
    if isinstance(noise, Telegraph):
        states = [drift(system.stiffness + xi, system.damping) for xi in (-noise.a, noise.a)]
        return moment_hierarchy.moment_lyapunov(states, noise.k * FLIP, p)
    steady = drift(system.stiffness, system.damping)
    return moment_hierarchy.ornstein_uhlenbeck_exponent(
        steady, driven(1.0), noise.alpha, noise.standard_deviation, p, 24
    )


NOISES = [White(s=0.7), Telegraph(a=0.8, k=1.3), OrnsteinUhlenbeck(alpha=1.0, sigma=0.8)]


@pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.kind)
@pytest.mark.parametrize(("stiffness", "damping"), [(1.0, 0.1), (0.0, 0.0), (-0.5, 0.3), (4.0, -0.2)])
def test_even_moments(noise, stiffness, damping):
    system = ParametricOscillator(stiffness=stiffness, damping=damping)
    for p in (2, 4):
        solver = ExponentSolver(Problem(system, noise), rtol=1e-9)
        found = solver.solution(float(p))
        expected = hierarchy(system, noise, p)
        assert abs(found.pair.value - expected) <= max(found.error, 1e-9 * solver.scale(p)), p


@pytest.mark.parametrize("stiffness", [1.0, 0.0, -1.0])
def test_white_noise_and_a_wall(stiffness):
    """λ in Airy functions."""
    found = lyapunov_exponent(Problem(ParametricOscillator(stiffness, 0.1, 0.8), White(s=0.5)), rtol=1e-10)
    assert found.value == pytest.approx(closed_forms.white_stiffness(stiffness, 0.5, 0.1, 0.8), abs=1e-10)


def test_telegraph_noise_and_a_wall():
    """λ and Λ of any p by Fourier series."""
    problem = Problem(ParametricOscillator(1.0, 0.05, 0.9), Telegraph(a=0.5, k=1.0))
    made = phase_circle.chain([drift(1 + xi, 0.05) for xi in (-0.5, 0.5)], FLIP)
    found = moment_lyapunov(problem, [-1.0, 1.0, 2.0], rtol=1e-10)
    expected = [phase_circle.moment_exponent(made, p, 20, 0.9) for p in (-1.0, 1.0, 2.0)]
    np.testing.assert_allclose(found.value, expected, atol=1e-10)
    exponent = phase_circle.lyapunov_exponent(made, 20, 0.9)
    assert lyapunov_exponent(problem, rtol=1e-10).value == pytest.approx(exponent, abs=1e-10)


def test_no_noise_is_left_where_it_is_weak():
    """Λ(p) = −pb + p (ω/π) ln R, ω² = k − b²."""
    found = moment_lyapunov(
        Problem(ParametricOscillator(2.0, 0.3, 0.7), Telegraph(a=1e-9, k=1.0)), [1.0, 3.0], rtol=1e-10
    )
    rate = -0.3 + math.sqrt(2.0 - 0.09) / math.pi * math.log(0.7)
    np.testing.assert_allclose(found.value, [rate, 3 * rate], rtol=1e-9)


@pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.kind)
def test_sensitivities_are_differences(noise):
    """By the hierarchy without a wall; by λ = λ₀ + N ln R with one."""
    theta = {"stiffness": 1.3, "damping": 0.1}
    [found] = sensitivities(Problem(ParametricOscillator(**theta), noise), 2.0).moments
    assert {*found} == {*(f"system.{name}" for name in (*theta, "restitution")), *(f"noise.{name}" for name in
                        noise.values if name != "interpretation")}  # fmt: skip
    for name, value in theta.items():
        ahead, behind = (hierarchy(ParametricOscillator(**{**theta, name: value + h}), noise, 2) for h in (1e-4, -1e-4))
        assert found[f"system.{name}"].value == pytest.approx((ahead - behind) / 2e-4, rel=1e-6)
    if isinstance(noise, White):
        [wall] = sensitivities(Problem(ParametricOscillator(**theta, restitution=0.8), noise), 1e-7).moments
        rate = closed_forms.white_stiffness(1.3, 0.7, 0.1, math.e) - closed_forms.white_stiffness(1.3, 0.7, 0.1)
        assert wall["system.restitution"].value / 1e-7 == pytest.approx(rate / 0.8, rel=1e-6)


def test_what_it_loses_at_the_wall_for_stability():
    """λ = 0 at the critical restitution."""
    problem = Problem(ParametricOscillator(1.0, 0.0, 0.9), White(s=1.0))
    at = critical_restitution(ExponentSolver(problem, rtol=1e-9)).value
    assert closed_forms.white_stiffness(1.0, 1.0, 0.0, at) == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_a_chart_over_stiffness_and_damping():
    frame = Axis("system.stiffness", 0.5, 3.0), Axis("system.damping", 0.01, 0.5)
    problem = Problem(ParametricOscillator(1.0, 0.1), White(s=0.5))
    [branch] = boundary(problem, {"moment": 2.0}, *frame, nodes=5).branches
    np.testing.assert_allclose(4 * branch.x * branch.y, 0.25, rtol=1e-6)  # s² = 4kb


CASE = """\
title = "parametric"
[system]
kind = "parametric"
stiffness = 1.0
damping = 0.05
[noise]
kind = "telegraph"
a = 0.5
k = 1.0
[moments]
p = [2.0]
[output]
quantities = ["moment", "lyapunov_exponent", "sensitivities"]
[vary]
"system.damping" = [0.05, 0.1]
[[expect]]
quantity = "moment"
p = 2.0
value = -0.0332610990213474
rtol = 1e-8
source = "moment hierarchy of the two states"
where = { "system.damping" = 0.05 }
"""


def test_a_case_file(tmp_path: Path) -> None:
    path = tmp_path / "parametric.toml"
    path.write_text(CASE, encoding="utf-8")
    assert load_case(path).system == ParametricOscillator(1.0, 0.05)
    assert system_kind("parametric") is ParametricOscillator
    assert main(["check", str(path), "--jobs", "1"]) == 0
    for wrong, words in (
        ("restitution = 1.5", "system.restitution: got 1.5; must be a finite number > 0 and <= 1"),
        ("omega = 1.0", "system.omega: unknown key; "),
    ):
        path.write_text(CASE.replace("damping = 0.05", f"damping = 0.05\n{wrong}", 1), encoding="utf-8")
        with pytest.raises(CaseError) as raised:
            load_case(path)
        [fault] = raised.value.faults
        assert f"{fault.key}: {fault.sentence}".startswith(words)
