"""∂Λ(p)/∂θ of random parameter sets against central differences of Λ(p).

`python -m tests.random_sensitivities [first last]` prints for each set how far the two are apart, with the stated error
and the doubt of the difference: derivatives at the default tolerance, differences at a tighter one.
"""

import sys

import numpy as np

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator, sensitivities
from fpsolve.errors import NumericalFailure

RTOL = 1e-11
STEPS = 1e-4, 5e-4, 2.5e-3, 1.25e-2
"""Of differences, in shares of a parameter."""


def problem_of(theta, law, is_exact):
    """A problem and the noise of Eq. (7), from parameters by their keys."""
    own = {key.partition(".")[2]: value for key, value in theta.items()}
    noise = NonGaussianNoise(**{name: own.pop(name) for name in ("D0", "tau0", "r0")})
    return Problem(VibroImpactOscillator(**own, impact=law), noise if is_exact else noise.ou_reduction()), noise


def drawn(seed):
    """A random problem and a p: weak or strong, reduced or exact noise, both laws of impact."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    epsilon, restitution = between(0.05, 1.5), rng.uniform(0.6, 0.95)
    theta = {
        "oscillator.omega": between(0.3, 5),
        "oscillator.restitution": restitution,
        "oscillator.c1": rng.uniform(-0.4, 0.4),
        "oscillator.epsilon": epsilon,
        "noise.D0": between(0.05, 2),
        "noise.tau0": between(0.05, 5),
        "noise.r0": rng.uniform(-1, 1.4),
    }
    is_exact = theta["noise.r0"] < 0.98 and rng.random() < 0.7
    law = "restitution" if epsilon**2 * (1 - restitution) < 0.8 and rng.random() < 0.5 else "delta"
    return theta, law, bool(is_exact), float(rng.choice([-1, 1]) * rng.uniform(0.3, 5))


def central(theta, key, value_at, step=STEPS[0]):
    """A central difference of fourth order."""
    h = step * max(abs(theta[key]), 0.1)
    values = [value_at(theta | {key: theta[key] + k * h}) for k in (-2, -1, 1, 2)]
    return (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)


def best_difference(theta, key, value_at, steps):
    """The finer of two neighbouring steps which differ least, and by how much these and the errors of the values do.

    `value_at` returns a value and its error.
    """
    errors = []

    def value(at):
        value, error = value_at(at)
        errors.append(error)
        return value

    found = [central(theta, key, value, step) for step in steps]
    lost = 1.5 * max(errors) / (np.array(steps) * max(abs(theta[key]), 0.1))
    doubts = np.abs(np.diff(found)) + lost[:-1]
    k = int(np.argmin(doubts))
    return found[k], float(doubts[k])


def main(first: int = 1, last: int = 100) -> None:
    """Print of each set the derivative that is farthest from its difference."""
    beyond = 0
    for seed in range(first, last + 1):
        theta, law, is_exact, p = drawn(seed)
        treatment = "exact" if is_exact else "reduced"
        try:
            problem, _ = problem_of(theta, law, is_exact)
            [found] = sensitivities(problem, p).moments
            rows = []
            for key, estimate in found.items():

                def value_at(at, law=law, is_exact=is_exact, p=p):
                    solution = ExponentSolver(problem_of(at, law, is_exact)[0], rtol=RTOL).solution(p)
                    return solution.pair.value, solution.pair.rounding

                expected, doubt = best_difference(theta, key, value_at, STEPS)
                off = abs(estimate.value - expected)
                rows.append((off / (estimate.error_estimate + doubt), off, estimate.error_estimate, doubt, key))
        except NumericalFailure as failure:
            print(f"{seed:4d} p = {p:6.3f} {treatment:7s} refused: {failure}", flush=True)
            continue
        if not rows:
            print(f"{seed:4d} p = {p:6.3f} {treatment:7s} no derivatives: {found}", flush=True)
            continue
        share, off, error, doubt, key = max(rows)
        beyond += share > 1
        print(
            f"{seed:4d} p = {p:6.3f} {treatment:7s} {share:6.3f}: "
            f"off {off:.1e}, error {error:.1e}, doubt {doubt:.1e}, {key}",
            flush=True,
        )
    print(f"{beyond} of {last - first + 1} sets have a derivative that is off by more than both")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
