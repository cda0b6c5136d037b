"""Saddles and nodes, where other pairs have T ≥ 0 too: noise that hardly moves the phase, and of two dimensions."""

from functools import partial

import numpy as np

from fpsolve import OrnsteinUhlenbeck
from fpsolve.model import Filter, MarkovChain, SineWiener
from tests.kit import matrices
from tests.numbers.by_problem import by_moments
from tests.numbers.rows import even
from tests.numbers.values import Row, moment

SADDLE, SKEW = [[1.0, 0.0], [0.0, -1.0]], [[0.5, 1.0], [0.3, -0.3]]
TURN = [[0.0, -1.0], [1.0, 0.0]]
UNDER_TWO, UNDER_FILTER = (
    matrices(even.SADDLE, even.ACROSS, even.FAST),
    matrices(even.NODE, even.NODE_NOISE, Filter(*even.NODE_FILTER)),
)


def chain(seed: int):
    rng = np.random.default_rng(seed)
    rate = 10 ** rng.uniform(-2, 1, (2, 2)) * (1 - np.eye(2))
    drift, driven = np.array([[0, 1], [-1, 0]]) + rng.normal(0, 0.3, (2, 2)), rng.normal(0, 0.6, (2, 2))
    return matrices(drift, driven, MarkovChain(tuple(np.sort(rng.normal(size=2))), rate))


def turned(steady, rate: float, deviation: float):
    return matrices(steady, TURN, OrnsteinUhlenbeck(alpha=rate, sigma=deviation * (2 * rate) ** 0.5))


ROWS = [
    *(
        Row(
            problem,
            moment(4.0),
            partial(by_moments, problem, 4, 24),
            *(1e-8, 1e-7, f"moment equations of a saddle {rate:g} {deviation:g}"),
        )
        for steady, rate, deviation in (
            (SADDLE, 0.1, 0.01),
            (SADDLE, 0.01, 0.1),
            (SKEW, 0.01, 0.01),
            (SKEW, 0.01, 0.03),
        )
        for problem in [turned(steady, rate, deviation)]
    ),
    *(
        Row(
            problem,
            moment(4.0),
            partial(by_moments, problem, 4),
            *(1e-10, 1e-7, "moment equations of a saddle under bounded noise"),
        )
        for steady in (SADDLE, SKEW)
        for problem in [matrices(steady, TURN, SineWiener(0.03, 0.02**0.5))]
    ),
    *(
        Row(
            UNDER_TWO,
            moment(float(p), rtol=1e-8),
            partial(by_moments, UNDER_TWO, p, 12),
            *(1e-10, 1e-7, "moment equations of a node under two noises"),
            slow=p != 4,
        )
        for p in (2, 4, 6)
    ),
    *(
        Row(
            UNDER_FILTER,
            moment(float(p)),
            partial(by_moments, UNDER_FILTER, p, 10),
            *(1e-9, 1e-7, "moment equations of a saddle under a filter"),
            slow=p == 6,
        )
        for p in (2, 4, 6)
    ),
    *(
        Row(chain(seed), moment(2.0), partial(by_moments, chain(seed), 2), 1e-12, 1e-8, f"chain with T > 0, {seed}")
        for seed in range(6)
    ),
]
