"""Λ(2) with delays: noise × delays × dimension beside discretised segments, closed forms and published numbers."""

import math

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import lambertw, wrightomega

from fpsolve.exponent import even_moment
from fpsolve.model import OrnsteinUhlenbeck, Telegraph, White
from tests.kit import rates
from tests.numbers.rows.even import CHAIN
from tests.numbers.second import slope_of, with_segment
from tests.numbers.values import Quantity, Row, by, closed, closed_by

ITO = White(s=1.0, interpretation="ito")
SCALAR = "x' = a*x + b*xi*x(t - tau)"
TURNING = "x' = v; v' = -(1 + w)*x - 0.1*v + w*x(t - 2*pi/speed) - w*xi*(x - x(t - 2*pi/speed))"
NOISES = {
    "white": (White(s=0.6, interpretation="ito"),),
    "Stratonovich's": (White(s=0.6),),
    "two white": (White(s=0.6, interpretation="ito"), White(s=0.5, interpretation="ito")),
    "OU": (OrnsteinUhlenbeck(alpha=1.2, sigma=0.7),),
    "chain": (CHAIN,),
    "telegraph and white": (Telegraph(a=0.8, k=0.7), White(s=0.6, interpretation="ito")),
}
MANY = {"OU": (1, 1), "chain": (2, 1, 1), "telegraph and white": (2, 2, 1)}
"""Variables under coloured noise, of which the equations are many."""
DELAYS = {"one delay": (1.3,), "two delays": (0.65, 1.3), "delays 2 : 3": (0.8, 1.2)}


LOOSE = closed(2, 1e-9)


def drawn(name, delays, n):
    """A system whose noises multiply the state and its past, and its segment as a function of the nodes."""
    rng = np.random.default_rng([75, n, len(delays)])

    def terms(size):
        parts = rng.standard_normal((1 + len(delays), n, n)) * size / math.sqrt(n)
        return list(zip((0.0, *delays), parts, strict=True))

    drift, driven = terms(1.0), [(terms(0.7), noise) for noise in NOISES[name]]
    drift[0] = 0.0, drift[0][1] - 1.5 * np.eye(n)
    return with_segment(drift, driven)


def beside(name, delay, n):
    """A segment under white noise is off by about 1/(nodes − 1.5), which two numbers of nodes take out."""
    problem, made = drawn(name, DELAYS[delay], n)
    is_rough = "white" in name or "Strat" in name

    def extrapolated():
        near = even_moment(problem, 2, 1e-6).value
        start = near + 0.5 * (1 + abs(near))
        fine = made(24 if is_rough else 14).exponent(start)
        return fine + (0.875 * (fine - made(12).exponent(start)) if is_rough else 0.0)

    doubt, is_slow = 3e-4 if is_rough else 1e-6, n > 1 and name in ("OU", "chain", "telegraph and white")
    return Row(problem, LOOSE, extrapolated, doubt, 1e-8, f"segment: {name}, {delay}, {n} variables", is_slow)


def of_scalar(a=-3.0, b=1.5, tau=0.7, s=1.0):
    """Λ = 2a + b² exp(−Λτ), by Wright's omega."""
    return float(2 * a + wrightomega(math.log(tau * (s * b) ** 2) - 2 * a * tau).real / tau)


def scalar(a=-3.0, b=1.5, tau=0.7):
    return rates(SCALAR, ITO, a=a, b=b, tau=tau)


def relaxing(tau, later):
    """dx = (−1 + ξ)x dt + (0.7x(t − τ₁) + 0.6x(t − τ₂))dW: E x² 1_i at three times is that at one, as dW is new."""
    noise, a, b, c = Telegraph(a=0.8, k=0.7), -1.0, 0.7, 0.6
    xi, own = np.diag(noise.states), np.array(noise.rates).T
    mean = expm((a * np.eye(2) + xi + own) * (later - tau))

    def left(sigma):
        first, second = (math.exp(-sigma * each) * expm(own * each) for each in (tau, later))
        both = math.exp(-sigma * later) * expm(own * tau) @ mean
        steady = 2 * a * np.eye(2) + 2 * xi + own
        return np.linalg.eigvals(steady + b**2 * first + c**2 * second + 2 * b * c * both).real.max() - sigma

    equation = f"x' = (-1 + xi1)*x + xi2*(0.7*x(t - {tau}) + 0.6*x(t - {later}))"
    value = brentq(left, -5, 5, xtol=1e-14)
    return Row(
        rates(equation, [noise, ITO]), closed(2), value, 1e-13, 1e-9, f"renewal under a telegraph, {tau}, {later}"
    )


def still(a, b, tau, noise, most):
    """Hardly any noise: twice the rightmost root of s = a + b exp(−sτ), and its slopes, by Lambert's W."""
    problem = rates(f"x' = a*x + b*x(t - tau) + {noise}", ITO, a=a, b=b, tau=tau)
    s = max((a + lambertw(b * tau * math.exp(-a * tau), k) / tau for k in (-1, 0)), key=lambda each: each.real)
    fall = np.exp(-s * tau)
    source = f"Lambert's W, {a}, {b}, {tau}, {noise}"
    by_name = (("a", 1.0), ("b", fall), ("tau", -b * s * fall))
    return [
        Row(problem, closed(2), 2 * s.real, 0.0, most, source),
        *(
            Row(problem, closed_by(f"system.{name}", 2), 2 * (each / (1 + b * tau * fall)).real, 0.0, 1.0, source)
            for name, each in by_name
        ),
    ]


def units(rate, unit):
    """A workpiece that turns, with times in 1/rate, and v in a unit."""
    turned = f"{rate * unit!r}*(-x - 0.1*(1 + xi)*(x - x(t - {2 * math.pi / rate!r})))"
    equations = f"x' = {rate / unit!r}*v; v' = {turned} - {0.1 * rate!r}*v"
    noise = White(s=1 / math.sqrt(rate), interpretation="ito")
    return Row(
        rates(equations, noise), closed(2), TURNED * rate, 2e-13 * rate, rate, f"rates of {rate}, units of {unit}"
    )


def turning(speed, w):
    return rates(TURNING, ITO, speed=speed, w=w)


def left(problem):
    """Λ(2) and what the digits of w leave of it."""
    found = even_moment(problem, 2)
    return found.value, found.error + 5e-11 * abs(found.slope("system.w")[0])


TURNED = -0.0856994783178
PERIOD = "x' = v; v' = -1.957*x - 0.178*v + 0.109*x(t - tau) - 0.29*v(t - tau)"
PERIOD += " - 0.711*xi*x + 0.769*xi*x(t - tau) + 0.23*xi*v(t - tau)"
PERIOD += " + 0.696*cos({0}*t + 2.416)*x - 0.348*cos({0}*t + 0.276)*x(t - tau)"
ROWS = [
    *(
        beside(name, delay, n)
        for i, name in enumerate(NOISES)
        for n, delay in zip(MANY.get(name, ((i + j) % 4 + 1 for j in range(3))), DELAYS, strict=False)
    ),
    beside("OU", "one delay", 2),
    *(relaxing(*each) for each in ((0.5, 1.0), (0.5, 1.5), (2.0, 2.0))),
    Row(scalar(-6.0, 2.0, 1.0), closed(2), -1.0106337404425, 1e-12, 1e-12, "published: one variable"),
    *(
        Row(
            scalar(a / tau, b / math.sqrt(tau), tau),
            closed(2),
            of_scalar(a, b, 1.0) / tau,
            1e-12 * (1 + abs(of_scalar(a, b, 1.0))) / tau,
            1e-9,
            f"Wright's omega, {a}, {b}, {tau}",
        )
        for a, b in ((-150.0, 1e-3), (-150.0, 30.0), (-20.0, 0.1), (0.5, 3.0), (50.0, 1.0))
        for tau in (1.0, 100.0)
    ),
    *(
        Row(
            scalar(),
            by(f"{key}.{name}", 2.0),
            slope_of(of_scalar, name, a=-3.0, b=1.5, tau=0.7, s=1.0),
            1e-9,
            1e-5,
            "Wright's omega",
        )
        for key, name in (("system", "a"), ("system", "b"), ("system", "tau"), ("noise", "s"))
    ),
    Row(
        rates("x' = -2*x + xi1*x(t - 1) + xi2*x(t - 1.5)", [ITO, ITO]),
        closed(2),
        brentq(lambda s: s + 4 - math.exp(-s) - math.exp(-1.5 * s), -4, 4, xtol=1e-14),
        1e-12,
        1e-9,
        "renewal of two noises and delays",
    ),
    *(
        row
        for each in ((0.0, -1.0, 1.0), (-1.0, 0.5, 1.0), (-0.2, -1.0, 1.0), (-0.5, 2.0, 3.0))
        for noise, most in (("xi", 1e-8), ("1e-20*xi*x", 1e-5))
        for row in still(*each, noise, most)
    ),
    *(
        units(rate, unit)
        for rate, unit in ((1e-6, 1e6), (1e-3, 1.0), (30.0, 1e-6), (100.0, 1.0), (1e6, 1e6), (1e6, 1e-6))
    ),
    Row(turning(1.0, 0.1), closed(2), TURNED, 1e-13, 1e-9, "published: a tool that turns"),
    Row(turning(1.0, 0.55), closed(2), 0.0179434662942, 1e-13, 1e-9, "published: a tool that turns"),
    *(
        Row(
            turning(speed, w),
            Quantity("Λ(2) where stability ends", left),
            0.0,
            0.0,
            1e-9,
            f"published: a tool at {speed}",
        )
        for speed, w in ((0.5, 0.2904437388), (1.0, 0.5257713774), (2.0, 0.1662835280))
    ),
    Row(
        rates("x' = v; v' = -x - 0.2*v + 0.1*x(t - 2*pi) + 0.1*xi*(x + x(t - 2*pi))", ITO),
        closed(2),
        math.log(0.50268959725324) / (2 * math.pi),
        1e-14,
        1e-10,
        "published: an oscillator",
    ),
    Row(
        rates("x' = v; v' = -(1 + 0.5*xi)*x - 0.2*v + 0.1*x(t - 2*pi)", OrnsteinUhlenbeck(alpha=1.0, sigma=0.8)),
        LOOSE,
        -0.1108973920228,
        1e-13,
        1e-7,
        "published: an oscillator under OU noise",
    ),
    Row(
        rates(PERIOD.format(repr(4 * math.pi / 1.848)), White(s=0.679), tau=1.848),
        closed(2),
        0.179280376748,
        5e-12,
        1e-8,
        "renewal of the fundamental solution: a delay of two periods of a load",
        True,
    ),
]
