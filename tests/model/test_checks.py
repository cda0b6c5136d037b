"""Every member of a noise against what the others make of it: a planted fault is named, and no kind of ours has one."""

import math
from typing import Annotated, ClassVar

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem, sensitivities
from fpsolve.errors import NoDerivative
from fpsolve.model import Bounded, Filter, MarkovChain, Noise, Noises, ReducedNoise, SineWiener, Telegraph, White
from fpsolve.model.noise import NoiseDerivative
from fpsolve.model.noises.ornstein_uhlenbeck import linear_step
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.testing import check_noise

OURS = [
    OrnsteinUhlenbeck(alpha=2.0, sigma=1e-3),
    ReducedNoise(D0=0.7, tau0=1.3, r0=0.9),
    *(NonGaussianNoise(D0=0.7, tau0=1.3, r0=r0) for r0 in (-1.0, 0.9, 1.0, 1.3)),
    SineWiener(amplitude=0.4, sigma=0.6),
    Bounded(mu=0.4, nu=2.0, sigma=0.5),
    Bounded(mu=0.4, nu=0.0, sigma=0.5),
    Bounded(mu=0.4, nu=2.0, sigma=0.0),
    Filter(omega=2.0, zeta=0.1, s=0.5, c0=1.0, c1=0.3),
    Filter(omega=2.0, zeta=1.0, s=0.5, c0=0.0, c1=0.3),
    Telegraph(a=0.5, k=1.0),
    MarkovChain((-1.0, 0.5, 2.0), ((-1.0, 1.0, 0.0), (0.3, -0.7, 0.4), (0.0, 2.0, -2.0))),
    White(s=1.0),
]


@dataclass(frozen=True, config=STRICT)
class Gaussian(Noise):
    """dξ = −αξ dt + s√(2α) dW, written as somebody would who has read the reference only."""

    alpha: Annotated[float, parameter("rate", "alpha = 1.0", gt=0)] = 0.8
    s: Annotated[float, parameter("size", "s = 1.0", gt=0)] = 0.6

    kind: ClassVar[str] = "gaussian"
    standard_deviation = property(lambda self: self.s)
    correlation_time = property(lambda self: 1 / self.alpha)
    diffusion = property(lambda self: self.s * math.sqrt(2 * self.alpha))
    largest_step = property(lambda self: 0.5 / self.alpha)

    def spectral_density(self, omega):
        return 2 * self.alpha * self.s**2 / (self.alpha**2 + omega**2)

    def log_density(self, xi):
        return -0.5 * (np.asarray(xi) / self.s) ** 2 - 0.5 * math.log(2 * math.pi * self.s**2)

    def sample(self, size, rng):
        return self.s * rng.standard_normal(size)

    def step(self, h, bias=0.0):
        return linear_step(self.alpha, self.diffusion, h, bias)

    def derivative(self, name):
        if name == "alpha":
            return NoiseDerivative(0.5 / self.alpha)
        return NoiseDerivative(1 / self.s, lambda xi: xi**2 / self.s**3)


@dataclass(frozen=True, config=STRICT)
class Beta(Noise):
    """P_s ~ (1 − ξ²)^a and σ = 1."""

    a: Annotated[float, parameter("exponent", "a = 1.0", gt=0)] = 2.0

    kind: ClassVar[str] = "beta"
    half_width = 1.0
    end_exponent = property(lambda self: self.a)
    standard_deviation = property(lambda self: 1 / math.sqrt(2 * self.a + 3))
    correlation_time = property(lambda self: 1 / (2 * self.a + 1))
    diffusion = 1.0
    approximates_spectrum = True

    def spectral_density(self, omega):
        return 1.0

    def log_density(self, xi):
        size = math.lgamma(self.a + 1) + 0.5 * math.log(math.pi) - math.lgamma(self.a + 1.5)
        with np.errstate(all="ignore"):
            return np.where(np.abs(xi) < 1, self.a * np.log1p(-(np.asarray(xi) ** 2)), -math.inf) - size

    def derivative(self, name):
        return NoiseDerivative(0.0, lambda xi: np.log1p(-(xi**2)), 1.0)


@pytest.mark.parametrize("noise", [*OURS, Gaussian(), Beta()], ids=lambda noise: noise.kind)
def test_no_kind_has_a_fault(noise):
    assert check_noise(noise) == ()


def slope(**wrong):
    """Gaussian's derivative with another part, for s."""
    right = {"log_diffusion": 1 / 0.6, "log_density": lambda xi: xi**2 / 0.6**3}
    return lambda self, name: (
        NoiseDerivative(**{**right, **wrong}) if name == "s" else NoiseDerivative(0.5 / self.alpha)
    )


def late(self, h, bias=0.0):
    """Half as fast as it should be."""
    return linear_step(0.5 * self.alpha, self.diffusion / math.sqrt(2), h, bias)


FAULTS = {
    "density": (Gaussian, {"log_density": lambda self, xi: -0.5 * (xi / self.s) ** 2}, "the integral of exp(log_dens"),
    "no density": (Gaussian, {"log_density": lambda self, xi: xi * math.nan}, "the integral of exp(log_density)"),
    "raises": (Gaussian, {"log_density": lambda self, xi: xi.real.nothing}, "the noise: AttributeError"),
    "mean": (Gaussian, {"mean": 0.1}, "mean is 0.1, but the integral of ξ P_s gives "),
    "deviation": (Gaussian, {"standard_deviation": 0.7}, "standard_deviation is 0.7, but the integral of ξ² P_s"),
    "infinite": (Gaussian, {"standard_deviation": math.inf}, "standard_deviation is inf; it must be a finite number"),
    "time": (Gaussian, {"correlation_time": 50.0}, "correlation_time is 50, but ∫C(t) dt/C(0) over t > 0 gives 1.25"),
    "spectrum": (Gaussian, {"spectral_density": lambda self, w: 1.0}, "spectral_density(0) is 1, but the generator"),
    "one side": (
        Gaussian,
        {"spectral_density": lambda self, w: 2 * Gaussian.spectral_density(self, w)},
        "spectral_density(0) is 1.8, but the generator gives 0.9",
    ),
    "diffusion": (Gaussian, {"squared_diffusion": lambda self, xi: 2 * xi**0}, "diffusion is 0.758947, but √squared"),
    "negative": (Gaussian, {"squared_diffusion": lambda self, xi: -(xi**0)}, "squared_diffusion"),
    "drift": (Gaussian, {"drift": lambda self, xi: 0.8 * xi}, "drift at xi = "),
    "sample": (Gaussian, {"sample": lambda self, n, rng: rng.standard_normal(n)}, "sample: what it draws has another"),
    "shape": (Gaussian, {"sample": lambda self, n, rng: rng.standard_normal((n, 1))}, "sample: it returns the shape"),
    "step": (Gaussian, {"step": late}, "the correlation of ξ after "),
    "law": (Gaussian, {"step": lambda self, h, b=0.0: linear_step(0.8, 2.0, h, b)}, "step: after "),
    "bias": (Gaussian, {"step": lambda self, h, b=0.0: linear_step(0.8, self.diffusion, h, 2 * b)}, "what a bias b of"),
    "largest step": (Gaussian, {"largest_step": 0.0}, "largest_step is 0; it must be a finite number > 0"),
    "log_diffusion": (Gaussian, {"derivative": slope(log_diffusion=1.0)}, 'derivative("s").log_diffusion at xi = '),
    "log_density": (Gaussian, {"derivative": slope(log_density=np.zeros_like)}, 'derivative("s").log_density at xi = '),
    "log_scale": (Gaussian, {"derivative": slope(log_scale=1.0)}, 'derivative("s").log_density at xi = '),
    "fails": (Gaussian, {"derivative": lambda self, name: 1 / 0}, 'derivative("alpha"): ZeroDivisionError'),
    "support": (Beta, {"half_width": 1.2}, "end_exponent is 2, but"),
    "end": (Beta, {"end_exponent": 1.0}, "end_exponent is 1, but the slope of log_density"),
    "end of the derivative": (
        Beta,
        {"derivative": lambda self, name: NoiseDerivative(end_exponent=1.0)},
        'derivative("a").log_density at xi = ',
    ),
    "no end of the derivative": (
        Beta,
        {"derivative": lambda self, name: NoiseDerivative(log_density=lambda xi: np.log1p(-(xi**2)))},
        'derivative("a").end_exponent is 0, but the difference of end_exponent gives 1',
    ),
    "chain": (Telegraph, {"derivative": lambda self, name: NoiseDerivative()}, 'derivative("a").states'),
    "chain's spectrum": (Telegraph, {"spectral_density": lambda self, w: 3.0}, "spectral_density(0) is 3, but the gen"),
    "filter": (Filter, {"derivative": lambda self, name: NoiseDerivative()}, 'derivative("omega").log_scale'),
    "waves": (Bounded, {"derivative": lambda self, name: NoiseDerivative()}, 'derivative("mu").log_scale'),
}
ARGUMENTS = {Telegraph: (0.5, 1.0), Filter: (2.0, 0.1, 0.5), Bounded: (0.4, 2.0, 0.5)}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named(fault):
    base, members, told = FAULTS[fault]
    found = check_noise(type("Changed", (base,), members)(*ARGUMENTS.get(base, ())))
    assert any(told in each for each in found), found


def test_of_several_noises_each_is_checked():
    wrong = type("Changed", (Gaussian,), {"mean": 0.1})()
    assert check_noise(Noises({"one": Gaussian(), "two": wrong})) == check_noise(wrong) != ()


def test_a_wrong_derivative_gives_no_sensitivity():
    """With end_exponent alone it would be a number with a small error, and wrong."""
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.2*v - xi*x"))
    assert sensitivities(Problem(system, Beta()), 2.0).moments[0]["noise.a"].value < 0  # less noise
    wrong = type("Changed", (Beta,), {"derivative": lambda self, name: NoiseDerivative(end_exponent=1.0)})()
    with pytest.raises(NoDerivative, match=r'no sensitivities under beta noise: derivative\("a"\)\.log_density at xi'):
        sensitivities(Problem(system, wrong), 2.0)
