"""Do fits of known noises give their parameters back within the stated errors? Run with `python -m tests.random_fits`.

Of 100 seeds 95 ± 5 must have a parameter within 1.96 standard errors.
"""

import functools
import math
import sys

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.measured import Record, Spectrum, fit_noise, non_gaussian_from_record
from fpsolve.model import Bounded, Filter

FREQUENCY = 2.0
NOISES = (
    OrnsteinUhlenbeck(alpha=1.5, sigma=0.4),
    Filter(omega=3.0, zeta=0.2, s=0.5),
    Filter(omega=3.0, zeta=0.2, s=0.5, c0=0.0, c1=1.0),
    Bounded(mu=0.4, nu=3.0, sigma=0.8),
)


def spectrum_of(noise, rng, averages=16, omega=None):
    """Values that are means of independent periodograms, each exponential."""
    omega = np.linspace(0.05, 20, 400) if omega is None else omega
    density = np.array([noise.spectral_density(each) for each in omega])
    return Spectrum(omega, density * rng.gamma(averages, 1 / averages, omega.size), np.full(omega.size, averages**-0.5))


def record_of(noise, rng, n=20_000, step=0.1):
    """Exact transitions of a path; those of Eq. (7) by implicit Euler steps, 20 for one."""
    if isinstance(noise, OrnsteinUhlenbeck):
        matrix, unit, output = np.array([[-noise.alpha]]), np.array([noise.standard_deviation]), np.ones(1)
    elif isinstance(noise, Filter):
        matrix = np.array([[0, 1], [-(noise.omega**2), -2 * noise.zeta * noise.omega]])
        size = noise.s / math.sqrt(4 * noise.zeta * noise.omega)
        unit, output = np.array([size / noise.omega, size]), np.array([noise.c0, noise.c1])
    elif isinstance(noise, Bounded):
        kicks = noise.sigma * math.sqrt(step) * rng.standard_normal(n)
        return Record(noise.mu * np.cos(rng.uniform(0, 2 * math.pi) + np.cumsum(noise.nu * step + kicks)), step)
    else:
        return _of_eq_7(noise, rng, n, step)
    from scipy.linalg import expm

    flow, stationary = expm(matrix * step), np.diag(unit**2)
    root = np.linalg.cholesky(stationary - flow @ stationary @ flow.T)
    kicks = rng.standard_normal((n, unit.size)) @ root.T
    state, values = unit * rng.standard_normal(unit.size), np.empty(n)
    for i in range(n):
        state = flow @ state + kicks[i]
        values[i] = state @ output
    return Record(values, step)


@functools.cache
def _path_of_eq_7():
    """A single path in a compiled loop."""
    from numba import njit

    @njit
    def path(xi, n, parts, h, b, tau, kick, seed):
        np.random.seed(seed)  # noqa: NPY002
        values = np.empty(n)
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


def _of_eq_7(noise, rng, n, step, parts=20):
    b = (1 - noise.r0) * noise.tau0 / (2 * noise.D0)
    h = step / parts
    kick = math.sqrt(2 * noise.D0 * h) / noise.tau0
    return Record(_path_of_eq_7()(0.0, n, parts, h, b, noise.tau0, kick, int(rng.integers(2**31))), step)


def scores(noise, fit):
    """(fitted − true)/standard error of each parameter; nothing where another output of the filter was chosen."""
    if not set(fit.parameters) <= set(noise.values) or fit.noise.values.keys() != noise.values.keys():
        return None
    fixed = [name for name in noise.values if name not in fit.parameters]
    if any(fit.noise.values[name] != noise.values[name] for name in fixed):
        return None
    return np.array([(fit.parameters[name] - noise.values[name]) / fit.errors[name] for name in fit.parameters])


def coverage(noise, make, fit, seeds):
    """The share of seeds whose error is below 1.96 standard errors, for each parameter; and how many chose another."""
    found = [scores(noise, fit(make(noise, np.random.default_rng(seed)))) for seed in range(seeds)]
    known = np.array([each for each in found if each is not None])
    return np.mean(abs(known) < 1.96, axis=0), len(found) - len(known), known


def fitted(data, kind, **options):
    return fit_noise(data, kind, frequency=FREQUENCY, **options)


def main(seeds=100):
    """Prints a line for each noise, of spectra and of records."""
    for noise in NOISES:
        rows = {
            "spectrum": spectrum_of,
            "record": record_of,
        }
        for name, make in rows.items():
            shares, others, known = coverage(noise, make, functools.partial(fitted, kind=noise.kind), seeds)
            print(noise, name, shares, "std", known.std(axis=0).round(2), "others", others, flush=True)
    for r0 in (0.7, 0.95):
        noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=r0)
        shares, _, known = coverage(
            noise, lambda n, rng: record_of(n, rng, 100_000, 0.04), non_gaussian_from_record, seeds
        )
        print(noise, shares, known.mean(axis=0).round(2), known.std(axis=0).round(2), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
