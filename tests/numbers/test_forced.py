"""First and second moments of systems that noise both multiplies and forces, beside Kronecker products."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from scipy.sparse.linalg import spsolve

from fpsolve import FpsolveError, boundary, design
from fpsolve.analysis import Axis
from fpsolve.exponent import stationary_moments
from fpsolve.model import Bounded, Filter, MarkovChain, OrnsteinUhlenbeck, Poisson, SineWiener, Telegraph, White
from tests.kit import rates
from tests.numbers.second import by_kind
from tests.oracles import kronecker
from tests.oracles.segments import written

NOISES = (
    White(s=0.5),
    White(s=0.5, interpretation="ito"),
    OrnsteinUhlenbeck(alpha=1.5, sigma=1.0),
    SineWiener(0.8, 1.2),
    Bounded(mu=0.5, nu=1.5, sigma=0.8),
    Telegraph(a=0.5, k=0.7),
    MarkovChain(states=(-0.5, 0.1, 0.6), rates=((-1.0, 0.7, 0.3), (0.2, -0.5, 0.3), (1.0, 0.0, -1.0))),
    Poisson(1.5, (-0.3, 0.3)),
    Filter(omega=2.0, zeta=0.3, s=0.4),
)


@pytest.mark.parametrize("seed", range(45))
def test_moments_are_those_of_kronecker_products(seed):
    """Of y = (x, 1), ẏ = (A + ξB)y: the noise is the same in the load and in the force."""
    rng, noise, n = np.random.default_rng(seed), NOISES[seed % 9], 2 + seed // 9 * (2 if seed % 9 < 8 else 0) % 7
    whole, names = 0.4 * rng.standard_normal((2, n + 1, n + 1)), [f"x{k}" for k in range(n)]
    whole[0, :, n] = whole[:, n] = 0.0
    whole[0, :n, :n] -= 1.5 * np.sqrt(n) * np.eye(n)
    terms = [("", [(0.0, whole[0, :n, :n])]), ("xi*", [(0.0, whole[1, :n, :n])])]
    text = "; ".join(
        f"{x}' = {rate}" for x, rate in zip(names, written(terms, names, whole[1, :n, n], "xi"), strict=True)
    )
    found = stationary_moments(rates(text, noise))

    coloured, *others = by_kind([(whole[1], noise)], 20)
    h = kronecker.equations(whole[0], coloured, *others).tocsr()
    own = coloured[0][1] if coloured else np.zeros((1, 1))
    mean, sums = (np.linalg.svd(each)[2][-1].conj() for each in (own, own.T))
    is_one = np.arange(h.shape[0]) % (h.shape[0] // len(own)) == h.shape[0] // len(own) - 1
    moments = np.zeros(h.shape[0], dtype=complex)
    moments[is_one] = mean
    moments[~is_one] = spsolve(h[~is_one][:, ~is_one].tocsc(), -h[~is_one][:, is_one] @ mean)
    right = (sums @ moments.reshape(len(own), -1) / (sums @ mean)).real
    at = np.triu_indices(n + 1)
    assert np.all(np.abs(found.whole[at] - right) <= found.errors[at] + 1e-9 * np.max(right))


def test_moments_of_many_variables_are_those_of_lyapunov_s_equation():
    """Of 60 variables under white noise: E xxᵀ by its fixed point, as BE yyᵀBᵀ is small."""
    rng, n = np.random.default_rng(0), 60
    a, b = 0.1 * rng.standard_normal((n, n)) - 2 * np.eye(n), 0.03 * rng.standard_normal((n, n + 1))
    names = [f"x{k}" for k in range(n)]
    texts = zip(names, written([("", [(0.0, a)]), ("xi*", [(0.0, b[:, :n])])], names, b[:, n], "xi"), strict=True)
    found = stationary_moments(rates("; ".join(f"{x}' = {rate}" for x, rate in texts), White(s=1.0)))

    whole = np.vstack([b, np.zeros(n + 1)])
    drift = a + 0.5 * (whole @ whole)[:n, :n], 0.5 * (whole @ whole)[:n, n]
    mean = -np.linalg.solve(*drift)
    square, push = np.zeros((n, n)), np.outer(drift[1], mean)
    for _ in range(60):
        of_all = np.block([[square, mean[:, None]], [mean, 1.0]])
        square = solve_continuous_lyapunov(drift[0], -(push + push.T + b @ of_all @ b.T))
    assert np.all(np.abs(found.mean - mean) <= found.errors[-1, :-1] + 1e-14)
    assert np.all(np.abs(found.square - square) <= found.errors[:-1, :-1] + 1e-14)
    assert np.max(found.errors) < 1e-11


def test_there_are_none_where_the_mean_square_grows():
    with pytest.raises(FpsolveError, match=r"Λ\(2\) = 2.3\d* ± \S+ is not negative"):
        stationary_moments(rates("x' = v; v' = -x - 0.2*v - 3*xi*x + 0.2*xi", OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)))


LOAD_AND_FORCE = "x' = v; v' = -x - c*v - k*xi*x + f*xi"
"""⟨x²⟩ = f²s²/(2c − k²s²) under white noise, and Λ(2) = 0 where k²s² = 2c."""


def loaded(**values):
    return rates(LOAD_AND_FORCE, White(s=1.0), **{"c": 0.2, "k": 0.3, "f": 0.2, **values})


@pytest.mark.parametrize(
    ("key", "stop", "value"),
    [("system.k", 2.0, np.sqrt(0.2)), ("system.c", 1.0, 0.145), ("noise.s", 2.0, np.sqrt(0.4 / 0.29))],
)
def test_design_finds_a_mean_square(key, stop, value):
    """Also from where there is none, beyond k² = 2c."""
    found = design(loaded(), "square(x) = 0.2", Axis(key, 0.01, stop))
    assert abs(found.values[key].value - value) <= found.values[key].error_estimate < 1e-7
    assert abs(found.found.value - 0.2) <= found.found.error_estimate < 1e-9


def test_design_tells_what_mean_squares_there_are():
    found = design(loaded(), "square(v) = 0.01", Axis("system.c", 0.1, 0.5))
    assert found.reason.data["least"] == pytest.approx(0.04 / (1 - 0.09))
    with pytest.raises(FpsolveError, match="must be of x, v"):
        design(loaded(), "square(xi) = 1", "system.c")
    with pytest.raises(FpsolveError, match="no stationary response"):
        design(rates("x' = v; v' = -x - c*v - xi*x", White(s=1.0), c=0.2), "square(x) = 1", "system.c")


def test_line_of_a_mean_square_is_that_of_its_closed_form():
    """s²(k² + f²/v) = 2c, next to k²s² > 2c, where there is none; its points are as near as they say."""
    line = boundary(loaded(), "square(x) = 3", Axis("system.k", 0.0, 1.0), Axis("noise.s", 0.1, 1.5), nodes=5, step=0.1)
    [branch] = line.branches
    off = branch.y - np.sqrt(0.4 / (branch.x**2 + 0.04 / 3))
    assert np.all(np.abs(off) <= 1e-8)
    assert np.ptp(branch.x) > 0.5
    assert np.all(branch.width < 1e-8)


def test_sides_of_the_line_of_a_mean_square_are_those_of_its_closed_form():
    """In weak noise, too, where ⟨x²⟩ is a hundredth of what it is on the line."""
    line = boundary(loaded(), "square(x) = 0.01", Axis("system.c", 0.1, 0.6), Axis("noise.s", 0.02, 2.0))
    at = np.linspace(0, 1, 99)
    c, s = 0.1 + 0.5 * at[:, None], 0.02 + 1.98 * at
    assert np.mean((line.scan.on(at) > 0) == (4.09 * s**2 > 2 * c)) > 0.99
