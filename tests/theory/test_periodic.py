"""Coefficients cos νt and sin νt as text, against their own moment equations over a period and Fourier series."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigs

from fpsolve import ExponentSolver, PlaneSystem, Problem, lyapunov_exponent, moment_lyapunov, sensitivities
from fpsolve.model import Bounded, MarkovChain, White
from fpsolve.model.faults import TableError
from fpsolve.model.systems.equations import EquationSystem
from fpsolve.simulation import simulate
from fpsolve.theory import even_moment
from tests.oracles import kronecker


@pytest.mark.slow
def test_periodic_coefficients_as_text(rng):
    """ẋ = (A + cos(νt) C + sin(kνt + φ) D)x, with Bx ∘ dW or a chain: multipliers of its own moment equations."""
    for case, n in enumerate(np.repeat((2, 3, 4), 4)):
        free, first, second, shake = (
            rng.standard_normal((4, n, n)) / math.sqrt(n) - np.eye(n) * np.eye(4)[0, :, None, None]
        )
        nu, strength, k, phase = rng.uniform(0.5, 4.0), rng.uniform(0.1, 0.6), 1 + case % 4, rng.uniform(-3, 3)
        waves = "cos(nu*t)", f"sin({k}*nu*t + {float(phase)!r})"
        matrices = {"": free, f"*{waves[0]}": first, f"*{waves[1]}": second, "*xi": shake}
        names = [f"x{i}" for i in range(n)]
        rates = [
            " + ".join(f"({float(a[i, j])!r}){of}*{names[j]}" for of, a in matrices.items() for j in range(n))
            for i in range(n)
        ]
        moved, size = kronecker.power(shake, 2), n * (n + 1) // 2
        if case % 2:
            noise = MarkovChain(states=(strength, -0.5 * strength), rates=((-1.0, 1.0), (0.5, -0.5)))
            steady = np.kron(np.array(noise.rates).T, np.eye(size)) + np.kron(np.diag(noise.states), moved)
        else:
            noise, steady = White(s=strength), 0.5 * strength**2 * moved @ moved
        powers = [np.kron(np.eye(len(steady) // size), kronecker.power(each, 2)) for each in (free, first, second)]
        steady, period, many = steady + powers[0], 2 * math.pi / nu, len(steady)

        def rate(t, x, steady=steady, powers=powers, nu=nu, k=k, phase=phase, many=many):
            now = steady + math.cos(nu * t) * powers[1] + math.sin(k * nu * t + phase) * powers[2]
            return (now @ x.reshape(many, many)).ravel()

        flow = solve_ivp(rate, (0.0, period), np.eye(many).ravel(), method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        multiplier = np.max(np.abs(np.linalg.eigvals(flow.reshape(many, many))))
        problem = Problem(EquationSystem(tuple(names), tuple(rates), (("nu", nu),)), noise)
        assert even_moment(problem, 2).value == pytest.approx(math.log(multiplier) / period, abs=1e-10)


@pytest.mark.slow
def test_three_variables_by_elements():
    """Λ(2) of a Mathieu oscillator with a lag under white noise, by elements, to which T* is not resolved."""
    rates = "v", "-0.2*v - (1 + 0.2*cos(2*t) + xi)*x + 0.3*u", "-0.5*u - 0.3*v"
    solver = ExponentSolver(Problem(EquationSystem(("x", "v", "u"), rates), White(s=0.3)), rtol=1e-1)
    found = solver.solution(2.0)
    assert abs(found.pair.value - solver.even(2.0).value) <= found.error


MATHIEU = EquationSystem(("x", "v"), ("v", "-0.2*v - (1 + mu*cos(nu*t) + xi)*x"), (("mu", 0.5), ("nu", 2.0)))


@pytest.mark.slow
def test_mathieu_with_white_noise():
    """ẍ + 0.2ẋ + (1 + 0.5 cos 2t + ξ)x = 0, s = 0.3; and elements, slopes and names."""
    problem = Problem(MATHIEU, White(s=0.3))
    found = even_moment(problem, 2)
    assert found.value == pytest.approx(0.06202216, abs=5e-9)
    assert moment_lyapunov(problem, 2.0).value[0] == pytest.approx(found.value, abs=1e-9)
    assert [*problem.values][:3] == ["system.mu", "system.nu", "noise.s"]
    slopes = sensitivities(problem, 2.0).moments[0]
    for key in "system.mu", "system.nu", "noise.s":
        at = problem.values[key]
        ahead, behind = (even_moment(problem.at({key: at + each}), 2).value for each in (1e-4, -1e-4))
        assert slopes[key].value == pytest.approx((ahead - behind) / 2e-4, rel=1e-6)
    load = {"load": "noise.load", "xi": "noise.xi"}
    other = PlaneSystem.of_equations(["x", "v"], ["v", "-0.2*v - (1 + load + xi)*x"], noises=load)
    bounded = Problem(other, {"load": Bounded(0.5, 2.0, 0.0), "xi": White(s=0.3)})
    assert lyapunov_exponent(problem).value == pytest.approx(lyapunov_exponent(bounded).value, abs=1e-9)


@pytest.mark.slow
def test_the_exponent_of_waves_in_their_own_fourier_series():
    """λ under cos νt and sin(2νt + φ) with white noise, e^(2ikφ + imθ) without any of the elements."""
    drift = ("v", "-0.2*v - (1 + mu*cos(nu*t) + 0.3*sin(2*nu*t + 0.4) + xi)*x")
    problem = Problem(replace(MATHIEU, drift=drift), White(s=0.3))
    high, many, p = 30, 16, 1e-4
    of_phase, of_time = (np.diag(np.ones(2 * each, complex), -1) for each in (high, many))
    twice = np.diag(2j * np.arange(-high, high + 1))

    def moved(a):
        (a, b), (c, d) = np.asarray(a, dtype=complex)
        one, cosine, sine = np.eye(len(twice)), (of_phase + of_phase.T) / 2, (of_phase - of_phase.T) / 2j
        q = (a + d) / 2 * one + (a - d) / 2 * cosine + (b + c) / 2 * sine
        return ((c - b) / 2 * one + (c + b) / 2 * cosine + (d - a) / 2 * sine) @ twice + p * q

    free, load, two = moved([[0, 1], [-1, -0.2]]), moved([[0, 0], [-1, 0]]), np.exp(0.4j) * of_time @ of_time
    waves = 0.5 * (of_time + of_time.T) / 2 + 0.3 * (two - two.conj().T) / 2j
    whole = np.kron(free + 0.045 * load @ load, np.eye(len(waves))) + np.kron(load, waves)
    whole = csc_array(whole + np.kron(np.eye(len(free)), np.diag(2j * np.arange(-many, many + 1))))
    value = eigs(whole, k=1, sigma=0.02 * p, return_eigenvectors=False)[0].real / p
    rate, slope = lyapunov_exponent(problem).value, moment_lyapunov(problem, p).value[0] / p
    assert slope == pytest.approx(value, rel=1e-6)
    assert rate == pytest.approx(value, rel=1e-3)


@pytest.mark.parametrize(
    ("term", "why"),
    [
        ("cos(t)*x + cos(2**0.5*t)*x", "the frequencies 1, 1.414213562; must be multiples of one number"),
        ("cos(t)*xi*x", "not affine in"),
        ("cos(0*t)*x", "nu not 0"),
        ("sin(t*t)*x", "write sin"),
        ("cos(xi*t)*x", "write cos"),
    ],
)
def test_times_that_are_no_angle(term, why):
    with pytest.raises(TableError, match=re.escape(why)):
        replace(MATHIEU, drift=("v", f"-x - xi*x + {term}"))


@pytest.mark.slow
def test_paths_agree():
    """Waves of one clock belong together, so that both change with their phases."""
    drift = ("v", "-0.2*v - (1 + mu*cos(nu*t) + 0.3*sin(2*nu*t + 0.4) + xi)*x")
    problem = Problem(replace(MATHIEU, drift=drift), White(s=0.5))
    found = simulate(problem, (), paths=320, time=130.0, seed=3)
    assert abs(found.lyapunov_exponent - lyapunov_exponent(problem).value) < 4 * found.lyapunov_exponent_error
