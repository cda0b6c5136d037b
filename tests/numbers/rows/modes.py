"""Three and four variables that all drive each other: equations of the moments, and harmonics of the sphere."""

import numpy as np

from fpsolve import OrnsteinUhlenbeck
from fpsolve.model import Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.by_problem import by_moments, elements, even_rows
from tests.numbers.values import Row, exponent, index, moment

UNIT = White(s=1.0)
NOISES = UNIT, Telegraph(a=0.7, k=0.6), OrnsteinUhlenbeck(alpha=1.5, sigma=1.0)
OU = OrnsteinUhlenbeck(alpha=1.0, sigma=0.5**0.5)


def random_system(seed: int, n: int, noise=UNIT, less: float = 0.0):
    """Damped, of rates about 1, with noise of a third of them in all entries; with some damping less."""
    rng = np.random.default_rng([30, seed])
    turn = rng.standard_normal((n, n))
    steady = turn - turn.T - 0.3 * np.diag(rng.uniform(0.3, 1.0, n)) + less * np.eye(n)
    return matrices(steady, 0.4 * rng.standard_normal((n, n)), noise)


def two_modes(noise=UNIT, c: float = 1.0):
    """q̈₁ + 0.1 q̇₁ + q₁ and q̈₂ + 0.16 q̇₂ + 2.56 q₂, with noise in the stiffness of both, and between them."""
    text = "x' = v; v' = -x - 0.1*v - c*xi*(0.5*x + 0.3*y); y' = w; w' = -2.56*y - 0.16*w - c*xi*(0.3*x + 0.5*y)"
    return rates(text, noise, c=c)


SPHERE = "elements and harmonics of the sphere of another code"
STRONG, WEAK, COLOURED = two_modes(), two_modes(c=0.1), two_modes(OU)
MARGINAL = random_system(1, 3, less=-0.5 * by_moments(random_system(1, 3), 2))
"""Of which Λ(2) = 0."""
ROWS = [
    *(
        row
        for seed in range(12)
        for row in even_rows(
            random_system(100 + seed, 3 + seed % 2, NOISES[seed % 3]),
            *(f"random modes {seed}", 1e-9, (2, 4)[: 2 - seed % 2]),
            doubt=1e-12,
            rtol=1e-10,
        )
    ),
    *(row for problem in (STRONG, COLOURED) for row in even_rows(problem, "two modes", 1e-11, doubt=1e-12, rtol=1e-11)),
    *even_rows(random_system(0, 3), "elements of three variables", 1e-4, (2,), quantity=elements, rtol=1e-4),
    *(
        row
        for seed, n in ((0, 3), (2, 4))
        for row in even_rows(random_system(seed, n), "elements", 1e-3, quantity=elements, rtol=1e-5, slow=True)
    ),
    Row(MARGINAL, index(rtol=1e-3), 2.0, 0.0, 1e-2, "Λ(2) = 0 by moments"),
    *(
        Row(problem, moment(p, rtol=1e-4), value, unit, 1e-3 * abs(value) + 100 * unit, SPHERE, slow=True)
        for problem, unit, values in (
            (STRONG, 1e-7, {1: -0.00081016, 3: 0.1124463, -1: 0.0314237}),
            (WEAK, 1e-9, {0.5: -0.0248041093, 1: -0.0495297287, 3: -0.147647323}),
        )
        for p, value in values.items()
    ),
    Row(WEAK, moment(1.0), -0.0495297287, 1e-9, 5e-7, f"{SPHERE} at the usual rtol", slow=True),
    *(
        Row(problem, exponent(rtol=1e-4), value, unit, 1e-5, SPHERE, slow=True)
        for problem, value, unit in (
            (STRONG, -0.01687416, 1e-8),
            (COLOURED, -0.0484034, 1e-7),
            (WEAK, -0.0496867093, 1e-10),
        )
    ),
]
