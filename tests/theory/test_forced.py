"""Stationary moments of forced states with delays, beside closed forms, spectra, and a discretised segment."""

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec

from fpsolve import OrnsteinUhlenbeck, Problem
from fpsolve.errors import FpsolveError
from fpsolve.model import Poisson, Telegraph, White
from fpsolve.model.faults import TableError
from fpsolve.model.systems.equations import EquationSystem
from fpsolve.theory import stationary_moments
from tests.oracles.segments import Segment, written

ITO = White(s=1.0, interpretation="ito")


def moments(rate: str, noise=ITO, rtol: float = 1e-6):
    return stationary_moments(Problem(EquationSystem(("x",), (rate,)), noise), rtol)


def of_scalar(a: float, b: float, tau: float) -> float:
    """E x² of dx = (ax + b x(t − τ)) dt + dW (Küchler, Mensch 1992)."""
    q = complex(a * a - b * b) ** 0.5
    return ((q - b * np.sinh(q * tau)) / (2 * q * (-a - b * np.cosh(q * tau)))).real


@pytest.mark.parametrize(
    ("a", "b", "tau"), [(-1, 0.4, 1), (-1, -0.4, 1), (-0.2, -1, 1), (0.3, -1, 0.8), (-2, 1.9, 5), (-1, -0.9, 50)]
)
def test_one_variable(a, b, tau):
    found = moments(f"{a}*x + {b}*x(t - {tau}) + xi")
    assert abs(found.square[0, 0] - of_scalar(a, b, tau)) <= found.error_estimate[0, 0] + 1e-14
    assert found.error_estimate[0, 0] <= 1e-12


@pytest.mark.parametrize("past", ["x", "x(t - 1)"])
def test_noise_that_multiplies_adds_to_what_forces(past):
    """V = k(σ² + β²V), k what unit noise makes, as βx dW has no correlation with what was before."""
    system = EquationSystem(
        ("x",), (f"-x - 0.8*x(t - 1) + 0.7*w*{past} + 0.5*f",), (), (("w", "noise.w"), ("f", "noise.f"))
    )
    found, k = stationary_moments(Problem(system, {"w": ITO, "f": ITO})), of_scalar(-1, -0.8, 1)
    assert found.square[0, 0] == pytest.approx(0.25 * k / (1 - 0.49 * k), rel=1e-13)


def test_impulses_that_force_and_multiply():
    found = moments("-3*x + xi*x(t - 0.7) + xi", Poisson(1.5, (-1.2, 1.2)))
    assert found.square[0, 0] == pytest.approx(1.5 * 1.44 / (6 - 1.5 * 1.44), rel=1e-13)


def test_coloured_noise_is_that_of_a_filter():
    own = moments("-x + 0.3*x(t - 1) + xi", OrnsteinUhlenbeck(alpha=1.5, sigma=0.8))
    filtered = EquationSystem(("x", "y"), ("-x + 0.3*x(t - 1) + y", "-1.5*y + 0.8*xi"))
    assert own.square[0, 0] == pytest.approx(stationary_moments(Problem(filtered, ITO)).square[0, 0], rel=1e-12)


def test_a_noise_that_does_both_moves_the_mean():
    """Under Stratonovich's noise ξ(ax + b) the mean rests where (−1 + ½a² + c)m + ½ab = 0."""
    found = moments("-x + 0.3*x(t - 1) + xi*(0.4*x + 0.5)", White(s=1.0))
    assert found.mean[0] == pytest.approx(0.1 / (1 - 0.08 - 0.3), rel=1e-13)
    k, size = of_scalar(-0.92, 0.3, 1), 0.4 * found.mean[0] + 0.5  # what unit noise makes, and the noise at the mean
    assert found.covariance[0, 0] == pytest.approx(k * size**2 / (1 - 0.16 * k), rel=1e-12)


@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_units_of_a_variable(unit):
    """The pair (x, v/unit) has the moments of (x, v)."""
    x, v = (
        EquationSystem(("x", "v"), rates)
        for rates in (
            ("v", "-x - 0.3*v + 0.2*x(t - 1) + 0.2*xi*x(t - 1) + xi"),
            (f"{unit}*v", f"(-x - 0.3*{unit}*v + 0.2*x(t - 1) + 0.2*xi*x(t - 1) + xi)/{unit}"),
        )
    )
    one, other = (stationary_moments(Problem(each, ITO)) for each in (x, v))
    scales = np.array([1.0, unit])
    assert other.square * np.outer(scales, scales) == pytest.approx(one.square, rel=1e-11)
    assert other.mean * scales == pytest.approx(one.mean, rel=1e-11)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_spectrum(n):
    """∫ H bbᵀ H* dω/2π, H = (iω − A − B e^(−iωτ))⁻¹, less that of (iω + 1)⁻¹, bbᵀ/2."""
    rng = np.random.default_rng(n)
    a, b = rng.standard_normal((2, n, n)) / n
    a -= 2.5 * np.eye(n)
    force, tau = rng.standard_normal(n), 0.8
    names = ("x", "y", "z", "w")[:n]
    system = EquationSystem(names, written([("", [(0.0, a), (tau, b)])], names, force, "xi"))
    found = stationary_moments(Problem(system, ITO))

    def share(omega):
        h = np.linalg.solve(1j * omega * np.eye(n) - a - b * np.exp(-1j * omega * tau), force)
        return (np.outer(h, h.conj()).real - np.outer(force, force) / (1 + omega**2)) / math.pi

    value, error = quad_vec(share, 0, 2000, epsabs=1e-10, limit=5000)
    value += 0.5 * np.outer(force, force)
    assert np.abs(found.square - value).max() <= error + 1e-6  # of the tail beyond


def test_a_discretised_segment_comes_nearer():
    """Under a telegraph noise that multiplies, of which Λ(2) < 0."""
    noise = Telegraph(a=0.8, k=0.7)
    drift, load = [(0.0, np.array([[-1.0]])), (1.0, np.array([[0.4]]))], [(0.0, np.array([[0.5]]))]
    rates = written([("", drift), ("z*", load)], ("x",), [1.0])
    system = EquationSystem(("x",), rates, (), (("z", "noise.z"), ("f", "noise.f")))
    found = stationary_moments(Problem(system, {"z": noise, "f": ITO}))
    errors = []
    for size in (8, 16, 32):
        own = Segment(drift, load, [], noise.states, noise.rates, size)
        errors.append(abs(own.stationary([1.0], noise.probabilities)[0, 0] - found.square[0, 0]))
    assert errors[2] < errors[1] / 4 < errors[0] / 16
    assert errors[2] <= 1e-6


def test_simulated_paths():
    """By Euler's method, in steps of a hundredth of the delay."""
    rng, paths, lag, h = np.random.default_rng(1), 8_000, 100, 0.01
    system = (
        ("x", "v"),
        ("v", "-x - 0.8*v - 0.4*x(t - 1) + 0.3*w*x(t - 1) + f"),
        (),
        (("w", "noise.w"), ("f", "noise.f")),
    )
    found = stationary_moments(Problem(EquationSystem(*system), {"w": ITO, "f": ITO}))
    x, v = np.zeros((2, lag + 1, paths))
    for step in range(1500):
        now, past = step % (lag + 1), (step + 1) % (lag + 1)
        w, f = rng.standard_normal((2, paths)) * math.sqrt(h)
        x_then, x_now, v_now = x[past], x[now], v[now]
        v_next = v_now + h * (-x_now - 0.8 * v_now - 0.4 * x_then) + 0.3 * w * x_then + f
        x[past], v[past] = x_now + h * v_next, v_next  # of the second order in h, as v is not of the first
    squares = np.stack([x[past] ** 2, v[past] ** 2])
    deviations = squares.std(axis=1) / math.sqrt(paths)
    assert np.all(np.abs(squares.mean(axis=1) - np.diag(found.square)) <= 4 * deviations)
    assert np.all(deviations <= 0.02 * np.diag(found.square))


def test_what_is_refused():
    with pytest.raises(FpsolveError, match=r"Λ\(2\) = 1\.\d+ .* is not negative"):
        moments("x - 0.1*x(t - 1) + xi")
    with pytest.raises(FpsolveError, match="nothing limits the amplitude"):
        moments("-x + xi*x(t - 1)")
    with pytest.raises(TableError, match="shifts where x rest"):
        EquationSystem(("x",), ("-x + x(t - 1) + 0.3 + xi",))
