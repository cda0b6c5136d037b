"""Sample paths: free flight and bounces in closed form, the Zhuravlev map, the laws of the noise."""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.stats import kstest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, VibroImpactOscillator
from fpsolve.model.noises.ornstein_uhlenbeck import linear_step
from fpsolve.simulation.bounces import DampedMotion, motion_of, move
from fpsolve.simulation.coefficients import coefficients
from fpsolve.simulation.kernels import advance
from fpsolve.simulation.motions import draw, drawn
from fpsolve.simulation.setup import default_step, largest_step
from tests.conftest import FIG1_NOISE, UNIT_NOISE, sampled

STRONG = VibroImpactOscillator(omega=1.0, restitution=0.7, c1=0.2, epsilon=1.0, impact="restitution")


def room(n):
    return np.empty(n), np.empty(n), np.empty(n, np.bool_)


def moved(m, h, x, u, mean, rise, steps=1):
    """The state after some steps under the same noise in each, and the number of impacts."""
    x, u = np.atleast_1d(np.array(x, dtype=float)), np.atleast_1d(np.array(u, dtype=float))
    mean, rise = np.full(x.size, float(mean)), np.full(x.size, float(rise))
    impacts = sum(move(m, h, x, u, mean, rise, *room(x.size)) for _ in range(steps))
    return x, u, impacts


def free(omega, R):
    return DampedMotion(omega=omega, strength=1.0, linear=0.0, cubic=0.0, rayleigh=0.0, bounce=-R)


@pytest.mark.parametrize("R", [1.0, 0.99])
@pytest.mark.parametrize("omega_h", [0.05, 0.3, 0.7])
def test_free_bounces_are_exact(R, omega_h):
    """Without noise and damping x = Rⁿ |sin ωt|, n the number of impacts."""
    omega = 1.7
    steps = math.ceil(1000.4 * math.pi / omega_h)
    x, u, impacts = moved(free(omega, R), omega_h / omega, 0.0, 1.0, 0.0, 0.0, steps)
    n, angle = divmod(steps * omega_h, math.pi)
    assert impacts == n == 1000
    assert x[0] / R**n == pytest.approx(math.sin(angle), abs=1e-10)
    assert u[0] / R**n == pytest.approx(math.cos(angle), abs=1e-10)


def test_many_bounces_in_one_step():
    """A step of 20 half-turns has 20 impacts."""
    h = 20.3 * math.pi
    x, u, impacts = moved(free(1.0, 0.9), h, 0.0, 1.0, 0.0, 0.0)
    assert impacts == 20
    np.testing.assert_allclose([x[0], u[0]], 0.9**20 * np.array([math.sin(0.3 * math.pi), math.cos(0.3 * math.pi)]))


@pytest.mark.parametrize("start", [1e-14, 1e-9, 0.05, 0.0999])
def test_instant_of_impact(start):
    """x = A sin(ωt + a) meets the wall at ωt = π − a: what follows is known to 1e-12 of the step."""
    h = 0.1
    x, u, impacts = moved(free(1.0, 0.5), h, math.sin(start), -math.cos(start), 0.0, 0.0)
    assert impacts == 1
    np.testing.assert_allclose([x[0], u[0]], [0.5 * math.sin(h - start), 0.5 * math.cos(h - start)], atol=1e-13)


def test_a_mass_on_the_wall_bounces_at_once():
    x, u, _ = moved(free(1.0, 0.5), 0.1, 0.0, -1.0, 0.0, 0.0)
    np.testing.assert_allclose([x[0], u[0]], [0.5 * math.sin(0.1), 0.5 * math.cos(0.1)], atol=1e-14)


def test_grazing_impacts():
    """A flight that ends a rounding error before or after a step does not go through the wall."""
    for shift in (-1e-15, -1e-16, 0.0, 1e-16, 1e-15):
        h = 0.1 + shift
        x, u, impacts = moved(free(1.0, 0.8), h, math.sin(0.1), -math.cos(0.1), 0.0, 0.0)
        assert x[0] >= 0
        x, u, again = moved(free(1.0, 0.8), 0.05, x[0], u[0], 0.0, 0.0)
        assert impacts + again == 1
        np.testing.assert_allclose([x[0], u[0]], [0.8 * math.sin(0.05), 0.8 * math.cos(0.05)], atol=1e-14)


@pytest.mark.parametrize("gain", [-1.5, 0.4, 1.2])
def test_constant_noise_has_order_four(gain):
    """ẍ + ω²x = g ẋ has x = e^(gt/2) sin Ωt between impacts π/Ω apart, Ω² = ω² − g²/4."""
    big_omega, R, time = math.sqrt(1 - gain**2 / 4), 0.8, 10.0
    n, rest = divmod(time, math.pi / big_omega)
    scale = R**n * math.exp(gain * time / 2)
    exact = scale * math.sin(big_omega * rest)
    errors = []
    for steps in (200, 400, 800):
        x, _, impacts = moved(free(1.0, R), time / steps, 0.0, big_omega, gain, 0.0, steps)
        assert impacts == n
        errors.append(abs(x[0] - exact) / scale)
    assert errors[-1] < 1e-8
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.8)


@settings(max_examples=200, deadline=None)
@example(phase=2.4453125, size=0.0, mean=175.078125, rise=0.029296875, h=1.0, cubic=0.3)  # a stiff limit cycle
@given(
    phase=st.floats(0, math.pi),
    size=st.floats(-8, 8),
    mean=st.floats(-200, 200),
    rise=st.floats(-200, 200),
    h=st.floats(1e-4, 3.0),
    cubic=st.sampled_from([0.0, 0.3]),
)
def test_no_mass_is_lost_behind_the_wall(phase, size, mean, rise, h, cubic):
    """Whatever the noise and the step, x stays ≥ 0 and finite; the linear motion does not depend on the amplitude."""
    m = DampedMotion(omega=1.0, strength=1.0, linear=0.1, cubic=cubic, rayleigh=cubic, bounce=-0.6)
    unit = 10.0**size if cubic == 0 else 1.0
    x, u, impacts = moved(m, h, unit * math.sin(phase), unit * math.cos(phase), mean, rise)
    assert x[0] >= 0
    assert np.isfinite([x[0], u[0]]).all()
    if cubic == 0 and math.sin(phase) > 1e-6:
        other = moved(m, h, math.sin(phase), math.cos(phase), mean, rise)
        assert impacts == other[2]
        norm = np.hypot(other[0][0], other[1][0])
        np.testing.assert_allclose([x[0] / unit, u[0] / unit], [other[0][0], other[1][0]], atol=1e-6 * norm)


@pytest.mark.parametrize("nonlinear", [0.0, 0.5])
def test_zhuravlev_map(nonlinear):
    """|y| = x and ẏ sgn y = ẋ, Eq. (4), for the same noise: the systems (3) and (6) are one."""
    oscillator = VibroImpactOscillator(
        omega=1.0, restitution=0.7, c1=0.2, epsilon=1.0, c2=nonlinear, c3=nonlinear, impact="restitution"
    )
    mass, _ = motion_of(oscillator)
    smooth = mass._replace(bounce=-mass.bounce)
    n, h, rng = 64, 0.05, np.random.default_rng(1)
    phase = rng.uniform(0, math.pi, n)
    x, u = np.sin(phase), np.cos(phase)
    y, w = -x, -u  # behind the wall, where it is not seen
    noise, xi = UNIT_NOISE.step(h), UNIT_NOISE.start(n, rng)
    mean, end, push = np.empty((3, n))
    impacts = 0
    for _ in range(2000):
        draw(noise, xi, mean, end, push, rng)
        rise = 0.5 * (end - xi)
        impacts += move(mass, h, x, u, mean, rise, *room(n))
        move(smooth, h, y, w, mean, rise, *room(n))
        xi[:] = end
        norm = np.hypot(x, u)
        assert np.all(x >= 0)
        np.testing.assert_allclose(np.abs(y), x, atol=1e-9 * norm.max())
        np.testing.assert_allclose(w * np.where(y < 0, -1, 1) / norm, u / norm, atol=1e-8)
        if nonlinear == 0:
            for state in (x, u, y, w):
                state /= norm
    assert impacts > 64 * 2000 * h / math.pi * 0.8


@pytest.mark.parametrize("a", [1e-8, 1e-4, 0.0199, 0.0201, 0.3, 1.0, 5.0])
def test_transition_of_ornstein_uhlenbeck_noise(a):
    """Moments of (ξ₁, ξ̄) from the response e^(−αs) of ξ to dW: variances and covariance as integrals."""
    noise, h = OrnsteinUhlenbeck(alpha=2.0, sigma=3.0), a / 2.0
    step = noise.step(h)

    def squares(s):
        end, mean = math.exp(-2.0 * s), -math.expm1(-2.0 * s) / a
        return 9.0 * np.array([end * end, end * mean, mean * mean])

    (var_end, covariance, var_mean), _ = quad_vec(squares, 0, h, epsrel=1e-12)
    assert step.decay == pytest.approx(math.exp(-a), rel=1e-14)
    assert step.mean == pytest.approx(-math.expm1(-a) / a, rel=1e-14)
    assert step.kick**2 == pytest.approx(var_end, rel=1e-12)
    assert step.kick * step.mean1 == pytest.approx(covariance, rel=1e-12)
    assert step.mean1**2 + step.mean2**2 == pytest.approx(var_mean, rel=1e-9)


class SummedStep(NamedTuple):
    """Ornstein-Uhlenbeck noise with ∫ξ dt in a second row."""

    decay: float
    kick: float
    h: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):
        for i in range(xi_end.size):
            xi_end[i] = step.decay * xi[0, i] + step.kick * rng.standard_normal()
            xi_mean[i] = 0.5 * (xi[0, i] + xi_end[i])
            xi[1, i] += step.h * xi_mean[i]


@pytest.mark.slow
def test_a_noise_may_have_more_numbers_than_its_value():
    """The first row is ξ, which ends where the step says; the others are the noise's own."""
    known = linear_step(1.0, 0.5, 0.1, 0.0)
    step, n = SummedStep(known.decay, known.kick, 0.1), 8
    mean, rise, push = np.zeros((3, n))
    state, numbers = np.zeros((2, n)), np.random.default_rng(5).standard_normal((20, n))
    xi, total, rng = np.zeros(n), np.zeros(n), np.random.default_rng(5)
    for number in numbers:
        drawn(step, state, mean, rise, push, rng)
        end = known.decay * xi + known.kick * number
        np.testing.assert_array_equal(state[0], end)
        np.testing.assert_allclose(mean - rise, xi, atol=1e-15)
        total, xi = total + 0.05 * (xi + end), end
        np.testing.assert_allclose(state[1], total, atol=1e-15)


def noise_after(noise, xi, time, rng, h=None, bias=0.0):
    h = h or default_step(STRONG, noise)
    step, (mean, end, push) = noise.step(h, bias), np.zeros((3, xi.size))
    for _ in range(math.ceil(time / h)):
        draw(step, xi, mean, end, push, rng)
        xi[:] = end
    return xi


@pytest.mark.parametrize(
    ("r0", "origin"),
    sampled(*product((0.5, 0.95, 1.2), ("zero", "stationary")), (0.0, "stationary"), keep=6),
)
def test_noise_has_its_stationary_law(r0, origin):
    """A Kolmogorov-Smirnov test of 4e4 independent paths against Eq. (9)."""
    noise = NonGaussianNoise(D0=0.8, tau0=1.3, r0=r0)
    rng = np.random.default_rng([7, int(100 * r0), len(origin)])
    xi = noise.start(40_000, rng) if origin == "stationary" else np.zeros(40_000)
    xi = noise_after(noise, xi, noise.tau0 * (2 if origin == "stationary" else 6), rng)
    assert np.all(np.abs(xi) < noise.half_width)
    reach = min(noise.half_width, 60 * noise.standard_deviation)
    nodes = reach * np.sin(np.linspace(-math.pi / 2, math.pi / 2, 20_001))
    density = noise.density((nodes[1:] + nodes[:-1]) / 2) * np.diff(nodes)
    cdf = np.concatenate([[0], np.cumsum(density)])
    assert cdf[-1] == pytest.approx(1, abs=1e-4)
    assert kstest(xi, lambda at: np.interp(at, nodes, cdf / cdf[-1])).pvalue > 0.01


@pytest.mark.slow
def test_heavy_tails_are_kept():
    """For r₀ = 1.2, P_s ~ |ξ|^(−10): of 4e5 paths some are beyond 5 std, where a Gaussian would have none."""
    noise = NonGaussianNoise(D0=0.8, tau0=1.0, r0=1.2)
    rng = np.random.default_rng(3)
    xi = noise_after(noise, noise.start(400_000, rng), 3 * noise.tau0, rng)
    far = 5 * noise.standard_deviation
    tail = np.linspace(far, 100 * far, 1_000_001)
    expected = 2 * 400_000 * np.trapezoid(noise.density(tail), tail)
    assert 10 < expected < 1000
    assert np.count_nonzero(np.abs(xi) > far) == pytest.approx(expected, abs=5 * math.sqrt(expected))


@pytest.mark.slow
def test_noise_with_a_bias_has_its_law():
    """With σ²b added to its drift the noise has the density P_s exp(2bξ)."""
    b, n, h = 0.4, 200_000, 0.02
    for noise in (FIG1_NOISE, FIG1_NOISE.ou_reduction()):
        rng = np.random.default_rng(5)
        xi = noise_after(noise, noise.start(n, rng), 6 * 0.5, rng, h, b)
        grid = np.linspace(-1, 1, 200_001) * min(noise.half_width, 12 * noise.standard_deviation)
        weight = np.nan_to_num(noise.density(grid)) * np.exp(2 * b * grid)
        expected = np.sum(weight * grid) / np.sum(weight)
        assert xi.mean() == pytest.approx(expected, abs=5 * xi.std() / math.sqrt(n) + 2e-3 * abs(expected))


def test_push_is_the_integral_of_the_drift():
    """Exactly for Ornstein-Uhlenbeck noise, whose mean over the step is known; for Eq. (7) by the trapezoidal rule."""
    n, h = 1000, 0.02
    rng = np.random.default_rng(6)
    xi = FIG1_NOISE.start(n, rng)
    mean, end, push = np.empty(n), np.empty(n), np.zeros(n)
    draw(FIG1_NOISE.step(h), xi, mean, end, push, rng)
    np.testing.assert_allclose(push, h / 2 * (FIG1_NOISE.drift(xi) + FIG1_NOISE.drift(end)), atol=1e-13)
    reduced = FIG1_NOISE.ou_reduction()
    push[:] = 0
    draw(reduced.step(h), xi, mean, end, push, rng)
    np.testing.assert_allclose(push, h * reduced.drift(mean), atol=1e-13)


def test_norms_are_taken_out_of_the_state():
    """Renormalised or not, ln‖x‖ is the same."""
    n, h = 300, 0.05
    logs = []
    for interval in (200, 1, 7):
        rng = np.random.default_rng(2)
        phase = rng.uniform(0, math.pi, n)
        x, u, xi = np.sin(phase), np.cos(phase), UNIT_NOISE.start(n, rng)
        log_norm, push = np.zeros((2, n))
        advance(
            coefficients(STRONG, UNIT_NOISE).motion(h),
            UNIT_NOISE.step(h),
            h,
            x,
            u,
            xi,
            log_norm,
            push,
            200,
            interval,
            rng,
        )
        logs.append(log_norm + np.log(np.hypot(x, u)))
        np.testing.assert_allclose(np.hypot(x, u), 1, rtol=1e-14)
    np.testing.assert_allclose(logs[1:], [logs[0]] * 2, atol=1e-9)


@pytest.mark.parametrize("r0", [-1.0, 0.5, 0.7, 0.95, 1.0, 1.2])
def test_largest_step_names_its_reason(r0):
    noise = NonGaussianNoise(D0=0.1, tau0=1e-3, r0=r0)
    assert largest_step(STRONG, noise)[1] == "the correlation time of the noise"
    fast = VibroImpactOscillator(omega=1e4, restitution=0.7, c1=0.2, epsilon=0.1)
    assert largest_step(fast, FIG1_NOISE)[1] == "the frequency"
    assert largest_step(STRONG, OrnsteinUhlenbeck(alpha=1.0, sigma=50.0))[1] == "the strength of the noise"
    assert default_step(fast, FIG1_NOISE) <= largest_step(fast, FIG1_NOISE)[0] / 2
