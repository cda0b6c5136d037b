"""Four variables with a stop: simulations, systems without one that are alike in law, the oscillator with a wall."""

from functools import partial

from fpsolve import ExponentSolver
from fpsolve.model import Telegraph, White
from tests.kit import rates
from tests.numbers.values import Row, exponent, moment

ELASTIC = ({"at": "q1 = 0", "restitution": 1.0},)


def coupled(unit: float = 1.0, tenth: float = 1.0):
    """Time and q₂ in other units."""
    k, c = unit**2, 0.3 * unit**2
    text = f"q1' = v1; v1' = -{0.1 * unit}*v1 - {k}*(1 + xi)*q1 - {c * tenth}*(1 + xi)*q2; "
    text += f"q2' = v2; v2' = -{0.16 * unit}*v2 - {k}*(2.56 + xi)*q2 - {c / tenth}*(1 + xi)*q1"
    return rates(text, Telegraph(a=0.5, k=0.7 * unit), walls=[{"at": "q1 = 0", "restitution": 0.8}])


def by_coupling(walls=()):
    text = "q1' = v1; v1' = -0.1*v1 - q1 + 0.8*xi*q2; q2' = v2; v2' = -0.16*v2 - 2.56*q2 + 0.8*xi*q1"
    return rates(text, White(0.7), walls=walls)


FIRST, SECOND = "q1' = v1; v1' = -q1 - 0.1*v1 - 0.8*xi*q1", "q2' = v2; v2' = -3.4*q2 - 0.9*v2 - 0.5*xi*q2 + 0.2*q1"


def driving(text: str, noise):
    """A mode with a wall, which may drive another one."""
    return rates(text, noise, walls=[{"at": "q1 = 0", "restitution": 0.63}])


def pair(problem, p: float, rtol: float = 1e-8) -> float:
    return ExponentSolver(problem, rtol=rtol).pair(p).value


ROWS = [
    Row(
        by_coupling(ELASTIC),
        moment(-1.0, rtol=1e-3),
        partial(pair, by_coupling(), -1.0, 1e-3),
        *(2e-5, 1e-4, "|q₁| without an elastic stop, as white noise in the coupling may turn its sign"),
        slow=True,
    ),
    *(
        Row(
            driving(f"{FIRST}{back}; {SECOND}", noise),
            moment(1.0, rtol=rtol),
            partial(pair, driving(FIRST, noise), 1.0),
            *(1e-8, most, f"mode that drives another under {noise.kind}, {words}"),
            slow=most > 1e-6,
        )
        for noise in (Telegraph(a=0.5, k=0.7), White(s=0.35))
        for back, rtol, most, words in (("", 1e-8, 1e-7, "by itself"), (" + 1e-9*q2", 1e-4, 5e-5, "by the half sphere"))
    ),
    *(
        Row(problem, quantity, value, 3 * doubt, most, source, slow=True)
        for problem, quantity, value, doubt, most, source in (
            (coupled(), moment(2.0, rtol=1e-3), -0.15844, 7e-5, 1e-3, "paths"),
            (coupled(), moment(1.0, rtol=1e-3), -0.08109, 4e-5, 4e-4, "paths and a transfer operator"),
            (coupled(), exponent(rtol=1e-3), -0.082631, 2e-5, 4e-4, "paths and a transfer operator"),
            (coupled(1000.0, 0.1), moment(2.0, rtol=1e-3), -158.44, 0.07, 1.0, "paths, in other units"),
        )
    ),
]
