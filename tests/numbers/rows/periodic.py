"""Coefficients cos νt and sin νt: multipliers of moment equations over a period, Fourier series, published numbers."""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigs

from fpsolve.model import Bounded, MarkovChain, White
from tests.kit import rates
from tests.numbers.values import Row, closed, exponent, moment
from tests.oracles import kronecker
from tests.oracles.segments import written

MATHIEU = "x' = v; v' = -0.2*v - (1 + mu*cos(nu*t){} + xi)*x"
SECOND = " + 0.3*sin(2*nu*t + 0.4)"


def mathieu(more="", mu=0.5, nu=2.0, s=0.3):
    return rates(MATHIEU.format(more), White(s=s), mu=mu, nu=nu)


def multipliers(free, first, second, shake, noise, nu, k, phase):
    """Λ(2) of (A + cos(νt)C + sin(kνt + φ)D)x under Bx ∘ dW or a chain."""
    moved = kronecker.power(shake, 2)
    size = len(moved)
    if isinstance(noise, MarkovChain):
        steady = np.kron(np.array(noise.rates).T, np.eye(size)) + np.kron(np.diag(noise.states), moved)
    else:
        steady = 0.5 * noise.s**2 * moved @ moved
    many, period = len(steady), 2 * math.pi / nu
    fixed, one, two = (np.kron(np.eye(many // size), kronecker.power(each, 2)) for each in (free, first, second))

    def rate(t, x):
        now = steady + fixed + math.cos(nu * t) * one + math.sin(k * nu * t + phase) * two
        return (now @ x.reshape(many, many)).ravel()

    flow = solve_ivp(rate, (0.0, period), np.eye(many).ravel(), method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return math.log(np.max(np.abs(np.linalg.eigvals(flow.reshape(many, many))))) / period


def drawn(case):
    rng = np.random.default_rng([75, case])
    n, k, nu, strength, phase = (
        2 + case // 4,
        1 + case % 4,
        rng.uniform(0.5, 4),
        rng.uniform(0.1, 0.6),
        rng.uniform(-3, 3),
    )
    free, first, second, shake = rng.standard_normal((4, n, n)) / math.sqrt(n)
    free -= np.eye(n)
    noise = MarkovChain((strength, -0.5 * strength), ((-1.0, 1.0), (0.5, -0.5))) if case % 2 else White(s=strength)
    names = "xyzu"[:n]
    factors = "", "cos(nu*t)*", f"sin({k}*nu*t + {phase!r})*", "xi*"
    parts = [(of, [(0.0, each)]) for of, each in zip(factors, (free, first, second, shake), strict=True)]
    text = "; ".join(f"{name}' = {each}" for name, each in zip(names, written(parts, names), strict=True))
    return Row(
        lambda: rates(text, noise, nu=nu),
        closed(2),
        lambda: multipliers(free, first, second, shake, noise, nu, k, phase),
        1e-10,
        1e-8,
        f"multipliers of {n} variables, {case}",
        case not in (2, 5),
    )


def by_series():
    """λ under cos νt and sin(2νt + φ) with white noise, by e^(2ikφ + imθ)."""
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
    return eigs(whole, k=1, sigma=0.02 * p, return_eigenvectors=False)[0].real / p


def by_load():
    """λ of the same load, as bounded noise without a diffusion."""
    load = rates("x' = v; v' = -0.2*v - (1 + xi1 + xi2)*x", [Bounded(0.5, 2.0, 0.0), White(s=0.3)])
    return exponent().solved(load)[0]


ROWS = [
    *map(drawn, range(12)),
    Row(mathieu(), closed(2), 0.06202216, 5e-9, 1e-10, "Mathieu's equation under white noise"),
    Row(mathieu(), moment(2), 0.06202216, 5e-9, 1e-8, "Mathieu's equation under white noise", True),
    Row(mathieu(), exponent(), by_load, 1e-9, 1e-8, "a harmonic load", True),
    Row(mathieu(SECOND), exponent(), by_series, 1e-4, 1e-8, "Fourier series of two waves", True),
]
