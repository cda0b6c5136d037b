"""Second methods: even moments by monomials times functions of the noises, discretised segments, differences."""

from collections.abc import Callable

import numpy as np
from numpy.polynomial.hermite_e import hermegauss, hermeval

from fpsolve.model import Bounded, Filter, OrnsteinUhlenbeck, Poisson, SineWiener, White
from tests.kit import rates as problem_of
from tests.oracles import kronecker
from tests.oracles.segments import Segment, written

POINTS = 14
"""Values that stand for Gaussian noise beside a segment."""


def spring(stiffness=1.0, damping=0.05):
    """A₀ of ẍ + 2 damping ẋ + stiffness x = 0."""
    return np.array([[0.0, 1.0], [-stiffness, -2 * damping]])


LOAD = np.array([[0.0, 0.0], [-1.0, 0.0]])
"""A₁ of a noise in the stiffness."""


def even(p, drift, *driven, count=24, near=0.0):
    """Λ(p) of ẋ = (A₀ + Σ ξ_k A_k)x for pairs (A_k, ξ_k), with `count` functions of each ξ_k."""
    return kronecker.several(np.array(drift), *by_kind(driven, count), p, near)


def by_kind(driven, count):
    """Coloured, white and impulses of such pairs, as `kronecker` takes them."""
    coloured, white, impulses = [], [], []
    for load, noise in driven:
        match noise:
            case White():
                white.append((noise.s * np.array(load), str(noise.interpretation)))
            case Poisson():
                impulses += [
                    (noise.rate * each, size * load) for each, size in zip(noise.shares, noise.sizes, strict=True)
                ]
            case _ if hasattr(noise, "alpha"):
                coloured.append((load, *kronecker.gaussian(noise.alpha, noise.sigma / (2 * noise.alpha) ** 0.5, count)))
            case SineWiener():
                coloured.append((load, *kronecker.turning(noise.amplitude, 0.0, noise.sigma, count, True)))
            case Bounded():
                coloured.append((load, *kronecker.turning(noise.mu, noise.nu, noise.sigma, count, False)))
            case Filter():
                law = noise.omega, noise.zeta, noise.s, noise.c0, noise.c1
                coloured.append((load, *kronecker.filtering(law, min(count, 18))))
            case _:
                coloured.append((load, *kronecker.jumping(noise.states, noise.rates)))
    return coloured, white, impulses


def slope_of(value: Callable[..., float], name: str, step: float = 1e-3, **values: float) -> float:
    """The derivative of a function by one of its arguments, by differences of the fourth order."""
    h = step * (abs(values[name]) or 1.0)
    ends = [value(**{**values, name: values[name] + k * h}) for k in (-2, -1, 1, 2)]
    return (8 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12 * h)


def gaussian(noise):
    """Values of Ornstein-Uhlenbeck noise at the points of a rule of Gauss, and the generator on functions there."""
    z, weights = hermegauss(POINTS)
    weights /= weights.sum()
    table = np.array([hermeval(z, each) for each in np.eye(POINTS)])
    table /= np.sqrt(np.cumprod(np.maximum(np.arange(POINTS), 1.0)))[:, None]
    return noise.sigma / (2 * noise.alpha) ** 0.5 * z, -noise.alpha * (table.T * np.arange(POINTS)) @ table * weights


def segment(drift, driven, nodes):
    """A discretised path under one coloured noise at most and white ones; driven are pairs (terms, noise)."""
    still, coloured, white, states, rates = list(drift), [], [], np.zeros(1), np.zeros((1, 1))
    for terms, noise in driven:
        if isinstance(noise, White):
            white.append([(delay, noise.s * each) for delay, each in terms])
            if str(noise.interpretation) == "stratonovich":  # A + ½α², B + ½αβ
                still += [(delay, 0.5 * noise.s**2 * terms[0][1] @ each) for delay, each in terms]
        else:
            coloured = terms
            gauss = isinstance(noise, OrnsteinUhlenbeck)
            states, rates = gaussian(noise) if gauss else (noise.states, np.array(noise.rates, dtype=float))
    return Segment(still, coloured, white, states, rates, nodes)


def with_segment(drift, driven):
    """The problem of these terms, and its discretised path as a function of the nodes."""
    names, noises = "xyzu"[: len(drift[0][1])], [noise for _, noise in driven]
    factors = [f"xi{k}*" if len(driven) > 1 else "xi*" for k, _ in enumerate(driven, 1)]
    text = written([("", drift), *((factor, of) for factor, (of, _) in zip(factors, driven, strict=True))], names)
    equations = "; ".join(f"{one}' = {rate}" for one, rate in zip(names, text, strict=True))
    return problem_of(equations, noises if len(noises) > 1 else noises[0]), lambda nodes: segment(drift, driven, nodes)
