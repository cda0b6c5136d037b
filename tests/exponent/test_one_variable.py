"""One variable, ẋ = −ax + bξx: Λ(p) by closed forms, and as the largest eigenvalue of the noise's own generator."""

import math
from pathlib import Path

import numpy as np
import pytest

from fpsolve import (
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    lyapunov_exponent,
    moment_lyapunov,
    sensitivities,
    stability_index,
)
from fpsolve.cli import main
from fpsolve.model import Bounded, Poisson, SineWiener, Telegraph, White
from tests.oracles import kronecker

P = np.array([-1.0, 0.3, 1.0, 2.0, 3.7])
A, B = 0.1, 0.8


def scalar(noise, unit=1.0):
    """With the unit of time of ẋ = −ax."""
    return Problem(PlaneSystem.of_equations(("x",), ("-a*x + b*xi*x",), {"a": A * unit, "b": B * unit}), noise)


def turning(amplitude, nu, sigma, is_sine):
    generator, xi = kronecker.turning(amplitude, nu, sigma, 24, is_sine)
    return lambda p: float(np.max(np.linalg.eigvals(generator + p * B * xi).real))


@pytest.mark.parametrize(
    ("noise", "tilted"),
    [
        (White(s=0.5), lambda p: 0.5 * (p * B * 0.5) ** 2),
        (White(s=0.5, interpretation="ito"), lambda p: 0.5 * p * (p - 1) * (B * 0.5) ** 2),
        (OrnsteinUhlenbeck(1.5, 0.6), lambda p: 0.5 * (p * B * 0.6 / 1.5) ** 2),
        (Telegraph(0.5, 1.0), lambda p: math.hypot(1.0, 0.5 * p * B) - 1.0),
        (Poisson(2.0, (-0.5, 0.8)), lambda p: math.exp(-0.5 * p * B) + math.exp(0.8 * p * B) - 2),
        (SineWiener(0.5, 1.0), turning(0.5, 0.0, 1.0, True)),
        (Bounded(0.5, 1.0, 0.7), turning(0.5, 1.0, 0.7, False)),
    ],
    ids=lambda each: getattr(each, "kind", ""),
)
def test_moments_and_indices(noise, tilted):
    problem, step = scalar(noise), 1e-3
    found = moment_lyapunov(problem, P)
    for p, value, error in zip(P, found.value, found.error_estimate, strict=True):
        expected = tilted(p) - A * p
        assert abs(value - expected) <= error + 3e-14  # of rounding
    slope = (8 * (tilted(step) - tilted(-step)) - tilted(2 * step) + tilted(-2 * step)) / (12 * step)
    assert lyapunov_exponent(problem).value == pytest.approx(slope - A, abs=1e-11)
    root = stability_index(problem).value
    assert tilted(root) - A * root == pytest.approx(0, abs=1e-12)


def test_derivatives_and_the_unit_of_time():
    """Λ(p) = −ap + (pbσ/α)²/2, which scales exactly."""
    [slopes] = sensitivities(scalar(OrnsteinUhlenbeck(1.5, 0.6)), 2.0).moments
    expected = {
        "system.a": -2,
        "system.b": 4 * B * 0.16,
        "noise.alpha": -4 * B**2 * 0.16 / 1.5,
        "noise.sigma": 4 * B**2 * 0.6 / 2.25,
    }
    for key, value in expected.items():
        assert slopes[key].value == pytest.approx(value, abs=1e-12)
    slow, fast = (
        moment_lyapunov(scalar(OrnsteinUhlenbeck(1.5 * unit, 0.6 * math.sqrt(unit)), unit), P).value / unit
        for unit in (4.0**-12, 4.0**12)
    )
    np.testing.assert_allclose(slow, fast, rtol=1e-13)


def test_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "one.toml"
    path.write_text(
        'title = "One"\n[system]\nvariables = ["x"]\ndrift = ["-a*x + xi*x"]\nparameters = { a = 0.2 }\n'
        '[noise]\nkind = "white"\ns = 0.6\n[moments]\np = [2.0]\n',
        encoding="utf-8",
    )
    assert main(["run", str(path), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    assert "the mean square grows, doubling in a time of 2.17" in capsys.readouterr().out  # ln 2/0.32
