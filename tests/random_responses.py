"""Twenty random nonlinear oscillators: the stationary response by elements against the simulation.

`python -m tests.random_responses [seeds]` prints, for each, how many standard errors the means of the simulation are
away from those of the elements, and how long both took. From 20 on they are equations with terms of degree 3: with a
wall at either variable, or without one and with such terms and noise in both rates.
"""

import math
import sys
import time

import numpy as np

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    stability_index,
)
from fpsolve.model.settling import comes_down
from fpsolve.nonlinear import stationary_response
from fpsolve.simulation import simulated_response

COUNT, RTOL = 20, 1e-4


def drawn(seed):
    """A problem with a stationary response: λ > 0, and −20 < δ_p < 0."""
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
            return problem


def written(seed):
    """A problem of equations with a stationary response."""
    rng = np.random.default_rng(seed)
    while True:
        names = dict.fromkeys("abkcdem", 0.0) | {"omega": rng.uniform(0.7, 2.0), "zeta": rng.uniform(-0.05, 0.15)}
        names |= {name: rng.uniform(0.05, 0.5) for name in "kcd"} | {"r": rng.uniform(0.8, 1.0)}
        rates = "v", "-omega**2*x + 2*zeta*omega*v - k*x**3 - c*x**2*v - d*v**3 + xi*(b*v - x)"
        kind = seed % 3
        if kind < 2:
            walls = [{"at": "x = 0", "restitution": "r"}]
            names["b"] = rng.normal()
        else:
            rates, walls = ("v + a*x - m*x**3 - e*x*v**2 + b*xi*x", rates[1].replace("b*v", "0.5*v")), []
            names |= {"a": rng.normal() / 10, "b": rng.normal() / 2, "m": rng.uniform(0, 0.3), "e": rng.normal() / 10}
        used = {name: value for name, value in names.items() if kind == 2 or name not in "aem"}
        if kind == 2:
            used.pop("r")
        variables, drift = (("x", "v"), rates) if kind != 1 else (("v", "x"), rates[::-1])
        system = PlaneSystem.of_equations(variables, drift, used, walls=walls)
        tau0, deviation = 10 ** rng.uniform(-1.0, 0.3), 10 ** rng.uniform(-0.5, 0.0)
        problem = Problem(system, NonGaussianNoise(D0=deviation**2 * tau0, tau0=tau0, r0=rng.choice([0.8, 1.0])))
        if lyapunov_exponent(problem).value > 0.02 and stability_index(problem) and comes_down(problem):
            return problem


def distances(problem, seed, rtol=RTOL, paths=16384, duration=400.0):
    """Of the means of the simulation from those of the elements, in standard errors."""
    found = stationary_response(problem, rtol=rtol)
    rate, spread = lyapunov_exponent(problem).value, ExponentSolver(problem).variance_rate().value
    noise = problem.coloured
    step = 0.05 * min(1 / problem.values[f"{problem.system.section}.omega"], 1.0, 2 * noise.tau0)
    simulated = simulated_response(problem, rate, spread, paths=paths, time=duration, step=step, seed=seed)
    of_wall = [int(name == "x") for name in (problem.system.response.first.name, problem.system.response.second.name)]
    elements = dict(found.means) | {"x": found.moment(*of_wall)}
    return {
        name: (value - elements[name].value) / math.hypot(deviation, elements[name].error_estimate)
        for name, (value, deviation) in simulated.means.items()
    }


def main():
    for seed in map(int, sys.argv[1:]) if sys.argv[1:] else range(COUNT):
        problem, started = (drawn if seed < COUNT else written)(seed), time.process_time()
        try:
            far = distances(problem, seed, rtol=RTOL if seed < COUNT else 1e-3)
            said = ", ".join(f"{name} {each:+.1f}" for name, each in far.items())
        except Exception as failure:
            said = str(failure)
        print(f"{seed}: {said}; {time.process_time() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
