"""Even moments of any noise and any number of variables, by monomials times functions of the noises."""

import math

import numpy as np

from fpsolve import Problem, moment_lyapunov
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Filter,
    LinearSystem,
    MarkovChain,
    OrnsteinUhlenbeck,
    Poisson,
    SineWiener,
    Telegraph,
    White,
)
from tests.kit import chain_of_masses, matrices
from tests.numbers.second import LOAD, even, spring
from tests.numbers.values import Row, closed, moment

CHAIN = MarkovChain((-0.8, 0.1, 0.5), ((0, 1.3, 0.2), (0.1, 0, 2.0), (1.4, 0.3, 0)))
NOISES = {
    "white": White(s=0.7),
    "Ito's": White(s=0.7, interpretation="ito"),
    "impulses": Poisson(rate=1.0, sizes=(-0.5, 0.7), weights=(0.3, 0.7)),
    "OU": OrnsteinUhlenbeck(alpha=1.0, sigma=0.8),
    "telegraph": Telegraph(a=0.8, k=1.3),
    "chain": CHAIN,
    "sine-Wiener": SineWiener(amplitude=0.8, sigma=1.0),
    "bounded": Bounded(mu=0.4, nu=2.0, sigma=0.3),
    "filter": Filter(omega=1.5, zeta=0.2, s=0.4, c0=1.0, c1=0.3),
    "critical filter": Filter(omega=1.5, zeta=1.0, s=0.6, c0=0.7, c1=-0.4),
}
WALKS = ((0.0, 0.0), (-0.5, 0.3), (4.0, -0.2))
"""Stiffness and damping: of a free mass, a saddle, and what grows by itself."""
SADDLE = ((-1.0115024817178828, 0.027976596819670015), (3.2543543385618436, -2.1504180261123937))
NODE = ((-0.5727022764659979, 0.03844029130717129), (-0.38124973260501926, 0.4070870137016061))
NODE_NOISE = ((0.4281962803847412, -0.8337860010391915), (-0.25061621100201587, -0.24215772694411056))
NODE_FILTER = (1.4957362099052074, 0.3305436240665941, 0.05885385917131965, 2.237226809621595, 0.9888121349393983)
FAST = OrnsteinUhlenbeck(37.431388258716034, 32.74906196496099), OrnsteinUhlenbeck(32.63567554169098, 8.536346218849552)
ACROSS = ((0, 0), (1, 0)), ((0, 0), (0, 1))


def drawn(seed, n, loads=1):
    """A drift and loads of n variables; a sixth has two equal eigenvalues of one eigenvector."""
    rng = np.random.default_rng([75, seed, n])
    drift, *driven = rng.standard_normal((1 + loads, n, n)) / math.sqrt(n)
    if seed % 6 == 0:
        drift[:2], drift[:, 1] = 0.0, 0.0
        drift[0, :2], drift[1, 1] = (-0.3, 1.0), -0.3
    return drift - 0.5 * np.eye(n), *driven


def against(quantity, p, drift, loads, noises, what, doubt=1e-11, most=1e-7, count=24, near=0.0, slow=False):
    return Row(
        lambda: matrices(drift, list(loads), list(noises)) if len(noises) > 1 else matrices(drift, loads[0], noises[0]),
        quantity,
        lambda: even(p, drift, *zip(loads, noises, strict=True), count=count, near=near),
        doubt,
        most,
        f"monomials: {what}",
        slow,
    )


def beside(seed, noise, small, large):
    """Λ(2) of so many equal pairs, each with a damping of its own, in other coordinates: that of one alone."""
    (drift, load), rng = drawn(seed, 2), np.random.default_rng(seed)
    dampings = np.append(0.0, -rng.uniform(0.1, 1.0, large // 2 - 1))
    turned, _ = np.linalg.qr(rng.standard_normal((large, large)))
    one = np.eye(large // 2)
    whole = turned @ (np.kron(one, drift) + np.kron(np.diag(dampings), np.eye(2))) @ turned.T
    return Row(
        lambda: matrices(whole, turned @ np.kron(one, load) @ turned.T, noise),
        closed(2),
        lambda: even(2, drift, (load, noise)),
        1e-11,
        1e-9,
        f"monomials of one of {large // 2} pairs: {small}",
        large > 24,
    )


def masses(noise, value):
    """Two masses under noise in the first spring, by an independent program."""
    drift, load, _ = chain_of_masses(2)
    return Row(lambda: matrices(drift, load, noise), closed(2), value, 5e-11, 1e-10, f"chain of masses: {noise.kind}")


def patches(n, mu, delta, square):
    """Patches x_i′ = μx_i + δΣ(x_j − x_i) + σx_i ξ_i in Itô's sense: E x_i² and E x_i x_j obey two equations."""
    own, other = 2 * mu + square - 2 * (n - 1) * delta, 2 * mu - 2 * delta
    return Row(
        lambda: matrices(
            mu * np.eye(n) + delta * (np.ones((n, n)) - n * np.eye(n)),
            [np.diag(each) for each in np.eye(n)],
            [White(math.sqrt(square), interpretation="ito")] * n,
        ),
        closed(2),
        0.5 * (own + other) + math.hypot(0.5 * (own - other), 2 * delta * math.sqrt(n - 1)),
        0.0,
        1e-13,
        f"two equations of {n} patches",
    )


def filters(output, zeta, values):
    """A spring under a filter of standard deviation 0.3, by elements."""
    noise = Filter(2.0, zeta, 0.3 / Filter(2.0, zeta, 1.0, *output).standard_deviation, *output)
    return [
        Row(
            lambda: matrices(spring(), LOAD, noise),
            moment(p),
            value or (lambda p=p: even(p, spring(), (LOAD, noise), count=18 if zeta < 0.2 else 12, near=None)),
            2e-11,
            1e-7,
            f"moments under a filter {output}, ζ = {zeta}",
            p == 4 and (zeta < 0.2 or output == (0.0, 1.0)),
        )
        for p, value in zip((2, 4), values, strict=True)
    ]


def random(seed, n, *names, p=2, quantity=None, **more):
    """A random system of n variables under noises of these names."""
    drift, *loads = drawn(seed, n, len(names))
    noises, what = [NOISES[each] for each in names], f"{n} variables, {' and '.join(names)}"
    return against(quantity or closed(p), p, drift, loads, noises, what, **more)


ELEMENTS = (4, "white"), (2, "Ito's"), (2, "impulses"), (4, "OU"), (2, "chain"), (4, "bounded"), (2, "sine-Wiener")
WAVY = Problem(
    LinearSystem(
        [
            CoefficientMatrix(0, spring().tolist()),
            CoefficientMatrix(1, (0.5 * LOAD).tolist(), lambda xi: np.cos(4 * xi)),
        ]
    ),
    OrnsteinUhlenbeck(alpha=1.0, sigma=math.sqrt(2)),
)
"""Of cos 4ξ the first functions of ξ see little, and the next ones hardly change that."""
ROWS = [
    *(
        Row(
            WAVY,
            closed(2, tolerance),
            lambda: float(moment_lyapunov(WAVY, 2.0).value[0]),
            1e-9,
            most,
            "elements, cos 4ξ",
        )
        for tolerance, most in ((1e-4, 1e-4), (1e-3, 1e-3), (None, 1e-12))
    ),
    *(
        against(closed(p), p, spring(), [LOAD], [noise], f"spring, {what}")
        for p in (2, 4)
        for what, noise in NOISES.items()
    ),
    *(
        against(moment(p), p, spring(), [LOAD], [NOISES[what]], f"spring, {what}", 1e-10, 1e-8)
        for p, what in ((2, "white"), (4, "telegraph"), (2, "OU"), (2, "impulses"))
    ),
    *(
        against(moment(p), p, spring(*walk), [LOAD], [NOISES[what]], f"{walk}, {what}", 1e-8, 1e-6)
        for p, walk in ((2, WALKS[0]), (4, WALKS[1]), (2, WALKS[2]))
        for what in ("white", "telegraph", "OU")
    ),
    *(
        random(seed, 2, what, p=p, quantity=moment(p), doubt=1e-10, most=1e-6)
        for seed, (p, what) in enumerate([*ELEMENTS, (2, "filter"), (2, "critical filter")])
    ),
    *(random(seed, n, what) for n in (3, 4) for seed, what in enumerate(NOISES)),
    *(
        random(3, n, what, p=p)
        for n, what, p in ((3, "Ito's", 4), (6, "chain", 4), (3, "telegraph", 6), (2, "chain", 10))
    ),
    random(1, 3, "OU", "white"),
    random(2, 2, "chain", "Ito's", "telegraph"),
    random(6, 4, "chain", "white"),
    random(4, 2, "bounded", "telegraph", count=12),
    random(5, 3, "sine-Wiener", "OU", count=12, near=4.0, slow=True),
    beside(1, NOISES["white"], "white", 50),
    beside(2, NOISES["OU"], "OU", 24),
    beside(3, NOISES["chain"], "chain", 30),
    beside(4, Filter(omega=1.5, zeta=0.2, s=0.1, c0=1.0, c1=0.3), "filter", 16),
    masses(OrnsteinUhlenbeck(1.0, 0.1 * math.sqrt(2)), -0.0394544357),
    masses(White(math.sqrt(0.02 / 5)), -0.0389353938),
    patches(2, -0.8554694689402464, 9.993744373604739e-05, 1.7072315886796916),
    patches(4, -0.7269131714, 1.33646e-6, 1.4052498279),
    *filters((1.0, 0.0), 0.1, [0.0649417356782, None]),
    *filters((0.0, 1.0), 0.1, [0.0652619833015, None]),
    *filters((4.0, 0.4), 0.1, [0.0649108396287, None]),
    *filters((0.0, 1.0), 0.3, [-0.0302021587304, None]),
    *filters((4.0, 1.2), 0.3, [-0.0291082620432, None]),
]
