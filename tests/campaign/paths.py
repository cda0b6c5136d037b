"""Random systems whose second method is paths: simulations, stationary responses, fits of records and spectra."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.linalg import expm

from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    simulate,
    stability_index,
    stationary_response,
)
from fpsolve.measured import Record, Spectrum, fit_noise, non_gaussian_from_record
from fpsolve.model import Bounded, Filter, Jump, Noise
from fpsolve.simulation import simulated_response
from tests.campaign.numbers import UNKNOWN, Number, Solved, beside, between, elements, limits, paths_of, together
from tests.campaign.planar import PAIRS, SINGLE, noise_of
from tests.kit import matrices, rates

# Systems in the plane under every kind of noise, with and without a wall

KINDS = (*((kind,) for kind in SINGLE), *PAIRS, ("white", "harmonic"))


def simulated(seed: int) -> Problem:
    """Noises in turn; half of the A₀ turn, half of the systems have a wall, over which noise moves no phase."""
    rng, kinds = np.random.default_rng([2027, seed]), KINDS[seed % len(KINDS)]
    steady, jumps = rng.standard_normal((2, 2)), list[Jump]()
    if rng.random() < 0.5:
        steady = 0.3 * steady + rng.uniform(0.5, 3.0) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    driven = [
        each * (rng.uniform(0.1, 1.0) / np.linalg.norm(each, 2)) for each in rng.standard_normal((len(kinds), 2, 2))
    ]
    if rng.random() < 0.5:
        phase = rng.uniform(0, math.pi)
        jumps = [Jump(phase, math.log(rng.uniform(0.6, 1.0)))]
        along, across = np.array([math.cos(phase), -math.sin(phase)]), np.array([-math.sin(phase), -math.cos(phase)])
        driven = [each - np.outer(across, along) * (across @ each @ along) for each in driven]
    harmonic = Bounded(mu=math.sqrt(2.0), nu=between(0.3, 5.0, rng), sigma=0.0)
    noises = [
        harmonic if kind == "harmonic" else noise_of(kind, 1.0, between(0.3, 5.0, rng), 1.0, rng)[0] for kind in kinds
    ]
    one = len(kinds) == 1
    return matrices(steady, driven[0] if one else driven, noises[0] if one else noises, jumps=jumps)


def numbers_of_simulations(seed: int, paths: int = 16384, lengths: float = 2.0) -> Iterator[Number]:
    """Λ(2) and λ of a system in the plane beside the simulation."""
    problem, orders = simulated(seed), (2.0, 0.0)
    yield from beside(orders, elements(problem, orders, 1e-6), paths_of(problem, orders, paths=paths, lengths=lengths))


AGREEMENT = (*product((0.1, 0.5, 1.0), (0.6, 0.8, 1.0), (False, True)),)
"""ε, r, and whether the noise is exact."""


def numbers_of_agreement(seed: int, paths: int = 32_768, transients: int = 16) -> Iterator[Number]:
    """Λ(p) of an oscillator by elements beside both estimators of the simulation; with too few paths there is none."""
    epsilon, restitution, is_exact = AGREEMENT[seed]
    system = VibroImpactOscillator(omega=1.0, restitution=restitution, c1=0.1, epsilon=epsilon, impact="restitution")
    noise, orders = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9), (-1.0, 0.5, 1.0, 2.0, 4.0)
    problem = Problem(system, noise if is_exact else noise.ou_reduction())
    found, (least, _) = together(problem, orders, 1e-7), limits(problem)
    for estimator in ("direct", "population"):
        how = {"paths": paths, "time": 0.5 * transients * least, "seed": 2 * seed + (estimator == "direct")}
        made = simulate(problem, orders, estimator=estimator, **how)
        for each in beside(orders, found, [(one.value, one.standard_error) for one in made.estimates]):
            if each.known[0] is not None:
                yield replace(each, name=f"{each.name}, {estimator}")


# Stationary responses

CUBIC = 20
"""From this seed on they are equations with terms of degree 3."""


def oscillators(seed: int) -> Iterator[Problem]:
    """Those of λ > 0, and −20 < δ_p < 0."""
    rng = np.random.default_rng(seed)
    while True:
        law, restitution = rng.choice(["delta", "restitution"]), rng.choice([1.0, rng.uniform(0.75, 1)])
        epsilon, omega, c1 = rng.uniform(0.3, 1.0), rng.uniform(0.7, 2.0), rng.uniform(-0.1, 0.8)
        c2, c3 = rng.choice([0.0, rng.uniform(0.1, 0.6)]), rng.uniform(0.05, 0.5)
        tau0, deviation = 10 ** rng.uniform(-1.3, 0.3), 10 ** rng.uniform(-0.7, 0.3)
        r0 = rng.choice([rng.uniform(0.6, 0.95), 1.0])
        oscillator = VibroImpactOscillator(
            omega=omega, restitution=restitution, c1=c1, epsilon=epsilon, c2=c2, c3=c3, impact=law
        )
        problem = Problem(oscillator, NonGaussianNoise(D0=deviation**2 * tau0, tau0=tau0, r0=r0))
        if lyapunov_exponent(problem).value > 0.01 * epsilon**2 and stability_index(problem):
            yield problem


def cubic(seed: int) -> Iterator[Problem]:
    """Equations: with a wall at either variable, or without one and with cubes and noise in both rates."""
    rng, kind = np.random.default_rng(seed), seed % 3
    while True:
        known = {"omega": rng.uniform(0.7, 2.0), "zeta": rng.uniform(-0.05, 0.15)}
        known |= {each: rng.uniform(0.05, 0.5) for each in "kcd"} | {"b": rng.normal() / (1 + (kind == 2))}
        walls = [{"at": "x = 0", "restitution": rng.uniform(0.8, 1.0)}] if kind < 2 else []
        first, second = "v", "-omega**2*x + 2*zeta*omega*v - k*x**3 - c*x**2*v - d*v**3 + xi*(b*v - x)"
        if kind == 2:
            first, second = "v + a*x - m*x**3 - e*x*v**2 + b*xi*x", second.replace("b*v", "0.5*v")
            known |= {"a": rng.normal() / 10, "m": rng.uniform(0, 0.3), "e": rng.normal() / 10}
        lines = [f"x' = {first}", f"v' = {second}"]
        tau0, deviation = 10 ** rng.uniform(-1.0, 0.3), 10 ** rng.uniform(-0.5, 0.0)
        noise = NonGaussianNoise(D0=deviation**2 * tau0, tau0=tau0, r0=rng.choice([0.8, 1.0]))
        problem = rates("; ".join(lines if kind != 1 else lines[::-1]), noise, walls, **known)
        if lyapunov_exponent(problem).value > 0.02 and stability_index(problem):
            yield problem


def numbers_of_responses(
    seed: int, rtol: float = 1e-4, paths: int = 16384, duration: float = 400.0
) -> Iterator[Number]:
    """The means of the first stationary response that there is beside the simulation."""
    for problem in (oscillators if seed < CUBIC else cubic)(seed):
        try:
            found = stationary_response(problem, rtol=rtol if seed < CUBIC else max(rtol, 1e-3))
        except NotConverged as failure:
            yield Number("means", Solved(*UNKNOWN, 0.0, str(failure)), UNKNOWN, "simulation")
            return
        except FpsolveError:  # it does not settle
            continue
        break
    rate, spread = lyapunov_exponent(problem).value, ExponentSolver(problem).variance_rate().value
    response, noise = problem.linear.response, problem.valued
    step = 0.05 * min(1 / problem.values[f"{problem.system.section}.omega"], 1.0, 2 * noise.tau0)
    made = simulated_response(problem, rate, spread, paths=paths, time=duration, step=step, seed=seed)
    of_wall = [int(each == "x") for each in (response.first.name, response.second.name)]
    means = dict(found.means) | {"x": found.moment(*of_wall)}
    for name, known in made.means.items():
        yield Number(name, Solved(means[name].value, means[name].error_estimate), known, "simulation")


# Fits

FITTED = (
    OrnsteinUhlenbeck(alpha=1.5, sigma=0.4),
    Filter(omega=3.0, zeta=0.2, s=0.5),
    Filter(omega=3.0, zeta=0.2, s=0.5, c0=0.0, c1=1.0),
    Bounded(mu=0.4, nu=3.0, sigma=0.8),
    NonGaussianNoise(D0=0.5, tau0=1.0, r0=0.7),
    NonGaussianNoise(D0=0.5, tau0=1.0, r0=0.95),
)
EQUATION_7 = 4
"""From this place on."""


def spectrum_of(noise: Noise, rng: np.random.Generator, averages: int = 16, omega=None) -> Spectrum:
    """Values that are means of independent periodograms, each exponential."""
    omega = np.linspace(0.05, 20, 400) if omega is None else omega
    density = np.array([noise.spectral_density(each) for each in omega])
    return Spectrum(omega, density * rng.gamma(averages, 1 / averages, omega.size), np.full(omega.size, averages**-0.5))


def record_of(noise: Noise, rng: np.random.Generator, n: int = 20_000, step: float = 0.1) -> Record:
    """Exact transitions of a path; those of Eq. (7) by implicit Euler steps, 20 for one."""
    if isinstance(noise, Bounded):
        kicks = noise.sigma * math.sqrt(step) * rng.standard_normal(n)
        return Record(noise.mu * np.cos(rng.uniform(0, 2 * math.pi) + np.cumsum(noise.nu * step + kicks)), step)
    if isinstance(noise, NonGaussianNoise):
        return of_eq_7(noise, n, step, int(rng.integers(2**31)))
    if isinstance(noise, OrnsteinUhlenbeck):
        matrix, unit, output = np.array([[-noise.alpha]]), np.array([noise.standard_deviation]), np.ones(1)
    else:
        matrix = np.array([[0, 1], [-(noise.omega**2), -2 * noise.zeta * noise.omega]])
        size = noise.s / math.sqrt(4 * noise.zeta * noise.omega)
        unit, output = np.array([size / noise.omega, size]), np.array([noise.c0, noise.c1])
    flow, stationary = expm(matrix * step), np.diag(unit**2)
    kicks = rng.standard_normal((n, unit.size)) @ np.linalg.cholesky(stationary - flow @ stationary @ flow.T).T
    state, values = unit * rng.standard_normal(unit.size), np.empty(n)
    for i in range(n):
        state = flow @ state + kicks[i]
        values[i] = state @ output
    return Record(values, step)


def of_eq_7(noise: NonGaussianNoise, n: int, step: float, seed: int) -> Record:
    """A record by implicit Euler steps of −ξ/(τ₀(1 − bξ²)), 20 for one."""
    b, h = (1 - noise.r0) * noise.tau0 / (2 * noise.D0), step / 20
    kick = math.sqrt(2 * noise.D0 * h) / noise.tau0
    return Record(_path_of_eq_7()(n, 20, h, b, noise.tau0, kick, seed), step)


@functools.cache
def _path_of_eq_7() -> Callable:
    """A single path in a compiled loop."""
    from numba import njit

    @njit
    def path(n, parts, h, b, tau, kick, seed):
        np.random.seed(seed)  # noqa: NPY002
        xi, values = 0.0, np.empty(n)
        for i in range(n):
            for _ in range(parts):
                xi += kick * np.random.standard_normal()  # noqa: NPY002
                # backwards for the drift −ξ/(τ(1 − bξ²)), which holds ξ inside
                low, high = -1 / math.sqrt(b), 1 / math.sqrt(b)
                for _ in range(50):
                    middle = 0.5 * (low + high)
                    if middle + h / tau * middle / (1 - b * middle**2) < xi:
                        low = middle
                    else:
                        high = middle
                xi = 0.5 * (low + high)
            values[i] = xi
        return values

    return path


def numbers_of_fits(seed: int) -> Iterator[Number]:
    """Parameters of a known noise from a spectrum and a record: 95 ± 5 % are within the interval of 95 %."""
    noise, turn = FITTED[seed % len(FITTED)], seed // len(FITTED)
    rng = np.random.default_rng(turn)
    if seed % len(FITTED) >= EQUATION_7:
        fits = [("record", non_gaussian_from_record(record_of(noise, rng, 100_000, 0.04)))]
    else:
        fits = [
            (
                make.__name__.removesuffix("_of"),
                fit_noise(make(noise, np.random.default_rng(turn)), noise.kind, frequency=2.0),
            )
            for make in (spectrum_of, record_of)
        ]
    for method, fit in fits:
        known, given = noise.values, fit.noise.values
        if given.keys() == known.keys() and all(given[each] == known[each] for each in known if each not in fit.errors):
            for each, error in fit.errors.items():  # else another output of the filter is fitted
                yield Number(each, Solved(known[each], 0.0), (fit.parameters[each], error), method)
