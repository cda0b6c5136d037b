"""Systems of more than four variables: even p with bounds, derivatives, charts, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, Problem, lyapunov_exponent, moment_lyapunov, sensitivities, stability_index
from fpsolve.analysis import Axis, boundary, uncertainty
from fpsolve.arrays import identity
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.messages import Code
from fpsolve.model import CoefficientMatrix, LinearSystem, ModalSystem, NonGaussianNoise, Poisson, White
from tests.kit import chain_of_masses
from tests.oracles import kronecker

CASE = """\
title = "Three masses"
[system]
variables = ["a", "u", "b", "v", "c", "w"]
drift = ["u", "-2*a + b - d*u - xi*a", "v", "a - 2*b + c - d*v", "w", "b - c - d*w"]
parameters = { d = 0.1 }
[noise]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 0.3
[moments]
p = [2.0, 4.0]
"""


def masses(count, noise, damping=0.02):
    """A chain with noise in its first spring, and the damping ratio as a parameter."""
    free, driven, _ = chain_of_masses(count, 1.0)
    stiffness, damper, load = -free[count:, :count], -free[count:, count:], -driven[count:, :count]
    damper = [[f"{each!r}*zeta" for each in row] for row in damper.tolist()]
    values = {"zeta": damping}
    return Problem(ModalSystem.of(np.eye(count), stiffness, damper, stiffness_noise=load, parameters=values), noise)


@pytest.mark.slow
def test_even_moments_and_bounds():
    """By Kronecker products; the note bounds λ and δ_p."""
    noise = OrnsteinUhlenbeck(1.0, 0.3)
    found = moment_lyapunov(masses(3, noise), [4.0, 2.0])
    free, driven, _ = chain_of_masses(3)
    for p, value, error in zip(found.p, found.value, found.error_estimate, strict=True):
        expected = kronecker.ornstein_uhlenbeck(free, driven, 1.0, 0.3 / math.sqrt(2), int(p), 10)
        assert abs(value - expected) <= error + 1e-13
        assert error < 1e-7
    [note] = found.notes
    assert note.code is Code.CONVEX_BOUNDS
    assert note.data["bound"] == pytest.approx(found.value[1] / 2, abs=1e-8)
    assert note.data["root"] == "> 4"
    assert found.to_xarray().attrs["method"] == "closed equations of moments"
    assert np.isnan(found.derivative_error).all()


def test_what_is_refused():
    problem = masses(3, White(s=0.2))
    with pytest.raises(NoSuchExponent, match=r"Λ\(1\) is not computed: of 6 variables .* λ <= Λ\(2\)/2"):
        moment_lyapunov(problem, [1.0, 2.0])
    for function in (lyapunov_exponent, stability_index):
        with pytest.raises(NoSuchExponent, match="follows from eigenfunctions, is not computed: of 6 variables"):
            function(problem)
    with pytest.raises(NotConverged, match="5005 moments are more than 1000"):
        moment_lyapunov(masses(5, White(s=0.2)), 6.0)
    with pytest.raises(ValueError, match="algebraic tails is for two variables only"):
        masses(3, NonGaussianNoise(0.1, 0.5, 1.2))


@pytest.mark.parametrize("count", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_derivatives(count):
    """Against differences, of one vector and of matrices."""
    problem = masses(count, OrnsteinUhlenbeck(1.0, 0.4))
    [slopes] = sensitivities(problem, 2.0, rtol=1e-9).moments
    for key in ("system.zeta", "noise.alpha", "noise.sigma"):
        at, step = problem.values[key], 1e-4 * problem.values[key]
        near = [problem.at({key: at + each}) for each in (step, -step)]
        ahead, behind = (moment_lyapunov(each, 2.0, rtol=1e-9).value[0] for each in near)
        error = slopes[key].error_estimate + 1e-6 * abs(slopes[key].value)  # of a difference
        assert abs(slopes[key].value - (ahead - behind) / (2 * step)) <= error
        assert slopes[key].error_estimate < 1e-5 * abs(slopes[key].value)


@pytest.mark.slow
def test_a_chart_and_uncertain_parameters():
    """Λ(2) = 0 at the points of the line, by Kronecker products."""
    problem = masses(3, OrnsteinUhlenbeck(1.0, 0.4))
    x, y = Axis("system.zeta", 0.01, 0.05), Axis("noise.sigma", 0.1, 1.5)
    [branch] = boundary(problem, {"moment": 2.0}, x, y, nodes=4).branches
    for zeta, sigma in list(zip(branch.x, branch.y, strict=True))[::6]:
        free, driven, _ = chain_of_masses(3, zeta)
        assert kronecker.ornstein_uhlenbeck(free, driven, 1.0, sigma / math.sqrt(2), 2, 12) == pytest.approx(
            0, abs=1e-8
        )
    found = uncertainty(problem, {"system.zeta": 0.1}, 2.0)
    slope = found.sensitivities.moments[0]["system.zeta"].value
    assert found.moments[0].deviation == pytest.approx(abs(slope) * 0.002, rel=1e-6)
    assert not found.indices


@pytest.mark.parametrize("masses", [2, 12])
def test_impulses_of_many_variables(masses):
    rng, still, one = np.random.default_rng(5), np.zeros((masses, masses)), np.eye(masses)
    stiffness, damping, load = rng.standard_normal((3, masses, masses)) / 5
    stiffness -= np.diag(np.linspace(0.7, 4, masses))
    free, driven = (
        np.block([[still, one], [stiffness, 0.3 * (damping - one)]]),
        np.block([[still, still], [load, still]]),
    )
    terms = [CoefficientMatrix(0, free), CoefficientMatrix(0, driven, identity)]
    found = moment_lyapunov(Problem(LinearSystem(terms), Poisson(2.0, (-0.4, 0.2))), 2.0).value[0]
    impulses = [(1.0, -0.4 * driven), (1.0, 0.2 * driven)]
    assert found == pytest.approx(kronecker.several(free, [], [], impulses, 2, found + 0.01), abs=1e-12)


def test_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """It asks for even p, has the bounds, and refuses what there is not before anything is written."""
    path = tmp_path / "masses.toml"
    path.write_text(CASE, encoding="utf-8")
    command = ["run", str(path), "--out", str(tmp_path / "out"), "--jobs", "1"]
    for more in (["--set", "moments.p=[1.0]"], ["--set", 'output.quantities=["lyapunov_exponent"]']):
        assert main([*command, *more]) == BAD_INPUT
        assert "of 6 variables" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
    assert main(command) == 0
    told = capsys.readouterr()
    assert "mean square decays" in told.out
    assert "λ <= Λ(2)/2 <= -0.0486798" in " ".join(told.err.split())
