"""Telegraph noise: its law, Λ(p) against moment equations, its parameters in sensitivities and charts."""

from typing import Annotated

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from fpsolve import PlaneSystem, Problem, boundary, lyapunov_exponent, moment_lyapunov, sensitivities
from fpsolve.analysis import Axis
from fpsolve.model import MarkovChain, Telegraph, White, noise_kind
from fpsolve.model.noise import NoiseDerivative
from fpsolve.model.noises.markov_chain import Chain
from fpsolve.model.parameters import parameter
from tests.oracles import moment_hierarchy


def spring(stiffness, damping):
    """ẍ + 2 damping ẋ + (stiffness + ξ) x = 0."""
    values = {"stiffness": stiffness, "damping": damping}
    return PlaneSystem.of_equations(("x", "v"), ("v", "-stiffness*x - 2*damping*v - xi*x"), values)


def matrices(states, stiffness=1.0, damping=0.1):
    return [[[0.0, 1.0], [-stiffness - xi, -2 * damping]] for xi in states]


def of(a=0.5, k=1.0, damping=0.05, stiffness=1.0):
    return Problem(spring(stiffness, damping), Telegraph(a=a, k=k))


def hierarchy(p, a=0.5, k=1.0, damping=0.05, stiffness=1.0):
    flip = [[-k, k], [k, -k]]
    return moment_hierarchy.moment_lyapunov(matrices((-a, a), stiffness, damping), flip, p)


def test_it_is_the_chain_of_two_states():
    own, chain = Telegraph(a=0.7, k=1.9), MarkovChain.telegraph(0.7, 1.9)
    assert noise_kind("telegraph") is Telegraph
    assert (own.states, own.rates) == (chain.states, chain.rates)
    for omega in (0.0, 0.5, 4.0):
        assert own.spectral_density(omega) == pytest.approx(4 * 1.9 * 0.49 / (4 * 1.9**2 + omega**2), rel=1e-13)
    with pytest.raises(ValueError, match=r"k: got -1\.0; must be a finite number >= 1e-15"):
        Telegraph(a=1.0, k=-1.0)


def test_moments_of_a_spring():
    found = moment_lyapunov(of(), [2.0, 4.0], rtol=1e-11)
    np.testing.assert_allclose(found.value, [hierarchy(2), hierarchy(4)], atol=1e-11)
    assert lyapunov_exponent(of(), rtol=1e-11).value == pytest.approx(-0.03297945668172, abs=1e-11)


def test_sensitivities_are_differences_of_moment_equations():
    theta = {"a": 0.5, "k": 1.0, "damping": 0.05, "stiffness": 1.0}
    [found] = sensitivities(of(**theta), 2.0).moments
    assert {key.partition(".")[2] for key in found} == {*theta}
    for name, h in dict.fromkeys(theta, 1e-4).items():
        ahead, behind = (hierarchy(2, **{**theta, name: theta[name] + d}) for d in (h, -h))
        key = next(key for key in found if key.endswith(f".{name}"))
        assert found[key].value == pytest.approx((ahead - behind) / (2 * h), rel=1e-7), key


@dataclass(frozen=True)
class Ring(Chain):
    """Three states, one of which moves and is left faster with θ; without detailed balance, so that π changes too."""

    theta: Annotated[float, parameter("θ", "theta = 0.3")]

    @property
    def states(self):
        return -0.5, self.theta, 0.7

    @property
    def rates(self):
        half, more = 0.5 * self.theta, 1 + self.theta
        return (-2.0, 2.0, 0.0), (half, -half - more, more), (0.5, 0.0, -0.5)

    def derivative(self, name):
        return NoiseDerivative(states=(0.0, 1.0, 0.0), rates=((0.0,) * 3, (0.5, -1.5, 1.0), (0.0,) * 3))


def test_sensitivities_to_states_and_rates_of_any_chain():
    def at(theta):
        ring = Ring(theta)
        return moment_hierarchy.moment_lyapunov(matrices(ring.states), ring.rates, 2)

    [found] = sensitivities(Problem(spring(1.0, 0.1), Ring(0.3)), 2.0).moments
    assert found["noise.theta"].value == pytest.approx((at(0.3 + 1e-4) - at(0.3 - 1e-4)) / 2e-4, rel=1e-6)


@pytest.mark.slow
def test_a_chart_over_its_parameters():
    frame = Axis("noise.a", 0.4, 1.5), Axis("noise.k", 0.3, 3.0)
    [branch] = boundary(of(damping=0.1), {"moment": 2.0}, *frame, nodes=5).branches
    assert branch.x.size > 10
    for a, k in zip(branch.x[::5], branch.y[::5], strict=True):
        assert hierarchy(2, a, k, 0.1) == pytest.approx(0, abs=1e-9)


def test_fast_noise_is_white():
    """a²/k = S(0) fixed: Λ(p) comes nearer to that of white noise as 1/k does, by the moment equations of both too."""
    white = moment_lyapunov(Problem(spring(1.0, 0.05), White(s=0.5)), [1.0, 2.0])
    exact = moment_hierarchy.white_noise_exponent([[0.0, 1.0], [-1.0, -0.1]], [[[0.0, 0.0], [-0.5, 0.0]]], 2)
    assert white.value[1] == pytest.approx(exact, abs=1e-9)
    rates = np.array([2048.0, 4096.0, 8192.0])
    found = [moment_lyapunov(of(a=0.5 * np.sqrt(k), k=k), [1.0, 2.0], rtol=1e-10) for k in rates]
    for each, k in zip(found, rates, strict=True):
        assert each.value[1] == pytest.approx(hierarchy(2, a=0.5 * np.sqrt(k), k=k), abs=1e-9)
    orders = -np.diff(np.log2(np.abs([each.value - white.value for each in found])), axis=0)
    np.testing.assert_allclose(orders, 1.0, atol=0.02)
