"""Three and four variables that are solved by blocks: equations of the moments, the plane, and other coordinates."""

from functools import partial

from fpsolve import OrnsteinUhlenbeck, Problem, lyapunov_exponent, moment_lyapunov, stability_index
from fpsolve.model import Telegraph, White
from tests.kit import rates
from tests.numbers.by_problem import elements, even_rows
from tests.numbers.values import Row, exponent, index, moment, moments, variance_rate

OSCILLATOR = "x' = v; v' = -x - 0.3*v - 0.8*xi*x"
TEXTS = {
    "pairs": "x' = v; v' = -x - 0.1*v - 0.5*xi*x; y' = w; w' = -2.56*y - 0.16*w - 0.5*xi*y",
    "oscillator drives": OSCILLATOR + "; z' = 0.5*x - 0.4*z + xi*(0.3*x + 0.5*z)",
    "filter drives": "y' = -0.2*y + 0.4*xi*y; x' = v; v' = 0.7*y - x - 0.3*v + xi*(0.3*y - 0.8*x)",
    "cascade": (
        "x' = v; v' = -x - 0.1*v - 0.5*xi*x; y' = w; w' = 0.6*x + 0.2*v - 2.56*y - 0.16*w + xi*(0.4*x - 0.8*y)"
    ),
}
NOISES = White(s=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5**0.5), Telegraph(a=0.7, k=0.6)
PLANE = rates(OSCILLATOR, White(s=1.0))
PAIRS = rates(TEXTS["pairs"], White(s=1.0))
KINK = rates(OSCILLATOR + "; z' = x - 0.05*z", White(s=1.0))
"""λ and Λ(p) of small p are those of ż = −0.05z, of larger p those of the oscillator."""


TIGHT = {"rtol": 1e-8}


def of_plane(p: float) -> float:
    return float(moment_lyapunov(PLANE, p, rtol=1e-10).value[0])


ROWS = [
    *(
        row
        for name, text in TEXTS.items()
        for noise in NOISES
        for problem in [rates(text, noise)]
        for row in even_rows(
            *(problem, f"{name} {noise.kind}", 1e-8, (2, 4), 1e-11, 44 // problem.dimension, elements),
            **TIGHT,
        )
    ),
    Row(PAIRS, moment(1.0, **TIGHT), -0.003473874, 5e-10, 1e-9, "elements on the sphere of two uncoupled modes"),
    *moments(KINK, {0.25: -0.0125, 1: partial(of_plane, 1.0), 3: partial(of_plane, 3.0)}, 1e-10, 1e-8, "kink", **TIGHT),
    Row(KINK, exponent(**TIGHT), -0.05, 1e-12, 1e-9, "slower of two blocks"),
    Row(KINK, variance_rate(**TIGHT), 0.0, 1e-12, 1e-9, "block without noise"),
    Row(KINK, index(**TIGHT), lambda: stability_index(PLANE).value, 1e-8, 1e-7, "faster of two blocks"),
    *(
        Row(PAIRS, quantity, value, 1e-9, 1e-8, "uncoupled modes, each by itself")
        for quantity, value in (
            (exponent(**TIGHT), lambda: max(lyapunov_exponent(each).value for each in APART)),
            (moment(1.0, **TIGHT), lambda: max(float(moment_lyapunov(each, 1.0).value[0]) for each in APART)),
            (variance_rate(**TIGHT), lambda: variance_rate().solved(APART[0])[0]),
        )
    ),
]
APART: tuple[Problem, ...] = tuple(
    rates(text, White(s=1.0))
    for text in ("x' = v; v' = -x - 0.1*v - 0.5*xi*x", "y' = w; w' = -2.56*y - 0.16*w - 0.5*xi*y")
)
