"""Bounds of P(sup ‖x‖ ≥ A), and mean numbers of upcrossings: closed forms, and T by integrating over the phase."""

import math
from functools import cache

import numpy as np
from scipy.stats import norm

from fpsolve import OrnsteinUhlenbeck, VibroImpactOscillator
from fpsolve.analysis import excursion
from fpsolve.model import Poisson, Problem, Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.values import Quantity, Row
from tests.oracles.two_state_function import root_and_function

A, S, K = -0.3, 0.5, 0.7
"""Growth, telegraph and its rate where ‖x‖ grows whatever the phase."""
ALPHA, SIGMA = 1.3, 0.8
ONE = np.eye(2)
solved = cache(excursion)


def of(name, **start):
    """A prefactor, or δ_p, of an excursion from some start."""

    def found(problem):
        estimate = getattr(solved(problem, **start), name)
        return estimate.value, estimate.error_estimate

    return Quantity(f"{name} from {start or 'the usual start'}", found)


def decoupled(noise, rate, count=1):
    """d ln ‖x‖/dt = rate + ξ whatever the phase, ξ of one noise or of several."""
    turn = [[rate, 1.0], [-1.0, rate]]
    return matrices(turn, ONE, noise) if count == 1 else matrices(turn, [ONE] * count, noise)


def spring(zeta=0.08, noise=None):
    return rates("x' = v; v' = -x - 2*zeta*v - xi*x", noise or Telegraph(a=0.8, k=1.0), zeta=zeta)


def states(problem, a):
    """A(ξ) at ξ = ∓a."""
    terms = [(each.g, problem.linear.epsilon**each.order * np.array(each.matrix)) for each in problem.linear.terms]
    return [sum(g(xi) * matrix for g, matrix in terms) for xi in (-a, a)]


@cache
def integrated(problem, k, a, low, high, place, state):
    """δ_p, and T₀/max T and T₀/min T where ‖x‖ grows."""
    both = states(problem, a)
    p, phi, function = root_and_function(both, k, low, high, sum(jump.log_factor for jump in problem.system.jumps[:1]))
    e = np.stack([np.cos(phi), -np.sin(phi)])
    growth = np.stack([np.einsum("in,ij,jn->n", e, each, e) for each in both], axis=1)
    at = np.array([np.interp(place, phi, each) for each in function.T])
    start, values = at.mean() if state is None else at[state], function[growth >= 0]
    return p, start / values.max(), start / values.min()


SPRING = spring()
BOUNCING = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-0.5, epsilon=0.5), Telegraph(a=0.9, k=0.6))


def telegraph(part):
    return integrated(SPRING, 1.0, 0.8, 1.2, 1.4, 0.0, None)[part]


def bounced(part):
    near = solved(BOUNCING, phi=0.3, xi=0.9).stability_index.value
    return integrated(BOUNCING, 0.6, 0.9, 0.8 * near, 1.2 * near, 0.3, 1)[part]


DELTA = 2 * K * A / (A**2 - S**2)
RATIO = (K - DELTA * (A + S)) / K
"""T₋/T₊ of the two states."""


def gaussian():
    """δ_p and C with T = e^(pξ/α), Λ = pa + p²S/2: all means are those of normal laws."""
    square, p = SIGMA**2 / (2 * ALPHA), 0.4 / (SIGMA / ALPHA) ** 2
    center, width = -0.2 + p * square / ALPHA, math.sqrt(square)
    upwards = center * norm.cdf(center / width) + width * norm.pdf(center / width)
    size = math.exp(0.5 * p**2 * square / ALPHA**2)
    return p, size * size * upwards / (0.2 * size**4)


WHITE = decoupled(White(s=0.3), -0.2)
CHAIN = decoupled(Telegraph(a=S, k=K), A)
NORMAL = decoupled(OrnsteinUhlenbeck(alpha=ALPHA, sigma=SIGMA), -0.2)
STRUCK = decoupled(Poisson(rate=1.0, sizes=(-0.5, 0.4)), -0.1)
TWO = decoupled([Telegraph(a=0.4, k=0.7), Telegraph(a=0.3, k=0.5)], -0.3, 2)


def of_two(part):
    """T of two telegraphs: the positive vector of Q + p·growth; ‖x‖ grows where both or the larger one push."""
    flip = np.array([[-1.0, 1.0], [1.0, -1.0]])
    growth = np.array([s + t for s in (-0.4, 0.4) for t in (-0.3, 0.3)]) - 0.3
    p = solved(TWO).stability_index.value
    values, vectors = np.linalg.eig(np.kron(0.7 * flip, ONE) + np.kron(ONE, 0.5 * flip) + p * np.diag(growth))
    assert abs(max(values.real)) < 1e-8
    function = np.abs(vectors[:, np.argmax(values.real)].real)
    return function.mean() / (max, min)[part](function[growth >= 0])


ROWS = [
    Row(WHITE, of("stability_index"), 0.4 / 0.09, 1e-9, 1e-6, "ln ‖x‖ = -γt + sW"),
    *(Row(WHITE, of(name), 1.0, 1e-9, 1e-6, "ln ‖x‖ = -γt + sW") for name in ("lower", "upper")),
    *(
        Row(CHAIN, of(name, xi=xi, phi=0.7), value, 1e-7, 1e-5, "telegraph noise moves the length alone")
        for xi, value in (("stationary", (1 + RATIO) / 2), (S, 1.0), (-S, RATIO))
        for name in ("lower", "upper")
    ),
    Row(CHAIN, of("stability_index"), DELTA, 1e-8, 1e-6, "telegraph noise moves the length alone"),
    Row(NORMAL, of("stability_index"), lambda: gaussian()[0], 1e-8, 1e-6, "normal laws"),
    Row(NORMAL, of("upcrossings"), lambda: gaussian()[1], 1e-5, 1e-3, "normal laws"),
    Row(STRUCK, of("upper"), 1.0, 1e-9, 1e-6, "impulses with T = 1"),
    Row(
        STRUCK,
        of("lower"),
        lambda: math.exp(-0.4 * solved(STRUCK).stability_index.value),
        1e-8,
        1e-6,
        "the largest impulse overshoots",
    ),
    Row(TWO, of("lower"), lambda: of_two(0), 1e-6, 1e-4, "two telegraphs move the length alone"),
    Row(TWO, of("upper"), lambda: of_two(1), 1e-6, 1e-4, "two telegraphs move the length alone"),
    *(
        Row(problem, of(name, **start), lambda by=by, i=i: by(i), 5e-5, 1e-3, source, True)
        for problem, start, by, source in (
            (SPRING, {}, telegraph, "T of a spring by integration"),
            (BOUNCING, {"phi": 0.3, "xi": 0.9}, bounced, "T with a wall by integration"),
        )
        for i, name in enumerate(("stability_index", "lower", "upper"))
    ),
]
