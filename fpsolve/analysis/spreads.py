"""What is uncertain of λ, δ_p and Λ(p) where parameters are: to first order by the derivatives; and samples of them.

Each parameter θᵢ has a normal law around its value, cut at the ends of its range, and is independent of the others.
With mᵢ the mean and sᵢ the standard deviation of that law, to first order

    Q ≈ Q₀ + Σ ∂Q/∂θᵢ (θᵢ − θᵢ⁰),   mean Q₀ + Σ ∂Q/∂θᵢ (mᵢ − θᵢ⁰),   variance Σ (∂Q/∂θᵢ sᵢ)²,

and the interval that holds Q with 95 % is that of a normal law.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from fpsolve.analysis.axis import bounds_of, check_key
from fpsolve.analysis.sensitivity import RECORDS, Sensitivities, solve_sensitivities
from fpsolve.arrays import FloatArray, is_whole, shown
from fpsolve.data import Result, dataset
from fpsolve.errors import NotConverged
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.method import Budget, checked_moments
from fpsolve.exponent.quantities import SUMMARY_NUMBERS
from fpsolve.exponent.solver import solver_of
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX, P

if TYPE_CHECKING:
    import xarray

LEVEL = 0.95
"""The probability that an interval holds."""
_SIZE = float(ndtri(0.5 + 0.5 * LEVEL))
UNCERTAIN = (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name)
"""The quantities besides Λ(p) of which intervals are given."""
MOST_SAMPLES = 100_000
"""Largest number of samples."""
Stated = float | Mapping[str, float]
"""How uncertain a parameter is: 0.05, a share of its value, or {"sd": 0.02}."""


def cube(sides: int, count: int, seed: int) -> FloatArray:
    """A Latin hypercube of points in the unit cube, shape (count, sides)."""
    from scipy.stats import qmc  # 280 ms, of which most commands have no need

    return np.asarray(qmc.LatinHypercube(sides, seed=seed).random(count))


def deviation_of(stated: Stated, value: float) -> float:
    """The standard deviation of a parameter with a value, before its law is cut. Raises `ValueError`.

    Args:
        stated: 0.05, a share of the value, or {"sd": 0.02}, a number.
        value: of the parameter.
    """
    size = stated["sd"] if isinstance(stated, Mapping) and stated.keys() == {"sd"} else stated
    if isinstance(size, bool) or not isinstance(size, int | float) or not 0 < size < math.inf:
        raise ValueError(
            f"got {shown(stated)}; must be a share of the value, such as 0.05, or a standard deviation such as "
            '{"sd": 0.02}, > 0 and finite'
        )
    return size * abs(value) if size is stated else float(size)


@dataclass(frozen=True)
class Law:
    """A normal law, cut.

    Attributes:
        value: of the parameter, the middle before the cut.
        sd: its standard deviation before that.
        low, high: where it is cut.
    """

    value: float
    sd: float
    low: float = -math.inf
    high: float = math.inf

    @property
    def _cut(self) -> Any:
        """The law that is cut."""
        from scipy.stats import truncnorm  # as above

        return truncnorm((self.low - self.value) / self.sd, (self.high - self.value) / self.sd, self.value, self.sd)

    @property
    def mean(self) -> float:
        """The mean of the law that is cut."""
        return float(self._cut.mean())

    @property
    def deviation(self) -> float:
        """The standard deviation of the law that is cut."""
        return float(self._cut.std())

    def quantile(self, share: FloatArray) -> FloatArray:
        """The values below which these shares of the law are."""
        return np.clip(self._cut.ppf(share), self.low, self.high)


@dataclass(frozen=True)
class Spread:
    """How far a quantity spreads where parameters are uncertain.

    Attributes:
        value: with the parameters as they are.
        mean, deviation: to first order.
        low, high: the ends of the interval that holds with a probability of `LEVEL`.
    """

    value: float
    mean: float
    deviation: float

    @property
    def low(self) -> float:
        return self.mean - _SIZE * self.deviation

    @property
    def high(self) -> float:
        return self.mean + _SIZE * self.deviation

    @property
    def below(self) -> float:
        """The probability that the quantity is negative."""
        if self.deviation == 0:
            return float(self.mean < 0)
        return float(ndtr(-self.mean / self.deviation))


def laws_of(problem: Problem, uncertain: Mapping[str, Stated]) -> dict[str, Law]:
    """The laws of some parameters by their keys.

    Args:
        problem: with their values and ranges.
        uncertain: a share of the value, or {"sd": number}, by the key.

    Raises:
        ValueError: a key is none of a parameter by which Λ can be differentiated, or a deviation is 0 or none.
    """
    found = {}
    for key, stated in uncertain.items():
        check_key(problem, key)
        value = float(problem.values[key])
        if not (deviation := deviation_of(stated, value)) > 0:
            raise ValueError(f'{key} is 0, and so is a share of it; state {{"sd": number}} for it')
        found[key] = Law(value, deviation, *bounds_of(problem, key))
    return found


def spread_of(value: float, slopes: Mapping[str, Estimate], laws: Mapping[str, Law]) -> Spread | None:
    """The spread of a quantity by its derivatives; None where some of these are missing."""
    if not laws.keys() <= slopes.keys():
        return None
    shift = sum(slopes[key].value * (law.mean - law.value) for key, law in laws.items())
    return Spread(value, value + shift, math.hypot(*(slopes[key].value * law.deviation for key, law in laws.items())))


def latin_hypercube(laws: Mapping[str, Law], count: int, seed: int = 0) -> dict[str, FloatArray]:
    """Values of parameters, as many of each as there are sets, so that each has one in each n-th part of its law.

    Args:
        laws: of the parameters, see `laws_of`.
        count: how many sets.
        seed: of the random numbers.

    Raises:
        ValueError: the count is none.
    """
    if not is_whole(count, 2, MOST_SAMPLES):
        raise ValueError(f"got count = {shown(count)}; must be a whole number from 2 to {MOST_SAMPLES}")
    shares = cube(len(laws), count, seed)
    return {key: law.quantile(shares[:, i]) for i, (key, law) in enumerate(laws.items())}


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(Result):
    """The spreads of λ, δ_p and Λ(p) to first order.

    Attributes:
        laws: of the uncertain parameters, by their keys.
        p: the moments, shape (n,).
        moments: the spread of each Λ(p); None where its derivatives were not solved.
        summary_numbers: the spreads of "lyapunov_exponent" and "stability_index", where these exist.
        sensitivities: the derivatives by which the spreads are found.
    """

    laws: Mapping[str, Law]
    p: FloatArray
    moments: tuple[Spread | None, ...]
    summary_numbers: Mapping[str, Spread]
    sensitivities: Sensitivities

    def to_xarray(self) -> xarray.Dataset:
        """The values, and the ends of their intervals."""
        numbers = {}
        rows = [(RECORDS[name], [spread]) for name, spread in self.summary_numbers.items()]
        for quantity, spreads in [(MOMENT, self.moments), *rows]:
            ends = {which: quantity.end(which, LEVEL) for which in ("low", "high")}
            for part, record in {"value": quantity, **ends}.items():
                column = np.array([math.nan if each is None else getattr(each, part) for each in spreads])
                numbers[record] = column if quantity.dims else column[0]
        fixed = self.sensitivities.theta
        return dataset("uncertainty to first order", "finite elements", numbers, {P: self.p}, fixed, level=LEVEL)

    def _said(self) -> str:
        parts = [
            f"{RECORDS[name].symbol} from {each.low:.4g} to {each.high:.4g}"
            for name, each in self.summary_numbers.items()
        ]
        return f"with {LEVEL:.0%}: {', '.join(parts) or f'{self.p.size} p'}"


def uncertainty(
    problem: Problem,
    uncertain: Mapping[str, Stated],
    p: ArrayLike = (),
    *,
    rtol: float | None = None,
    budget: Budget | None = None,
) -> Uncertainty:
    """How far λ, δ_p and Λ(p) spread, to first order, where parameters are uncertain.

    Args:
        problem: a motion and its noise.
        uncertain: the standard deviations of normal laws, cut at the ranges of the parameters, by their keys: a share
            of the value, such as 0.05, or {"sd": 0.02}.
        p: one moment, or an array of shape (n,); none by default.
        rtol, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: a key or a deviation is none, or a p is not finite.
        NoSuchExponent: Λ(p) is infinite for one of the p.
        NotConverged: Λ(p) was not solved for one of the p.
    """
    laws = laws_of(problem, uncertain)
    solver = solver_of(problem, rtol=rtol, budget=budget)
    points = checked_moments(p, solver.method, may_be_empty=True)
    summary_numbers = UNCERTAIN if solver.method.has_pairs else ()
    found = {name: each for name in summary_numbers if (each := SUMMARY_NUMBERS[name].solve(solver))}
    along = {key: problem.derivative(key) for key in laws}
    slopes = solve_sensitivities(solver, points, along, summary_numbers=[*found])
    solved = solver.moments(points)
    if solved.failures:
        raise NotConverged(solved.failures[0].reason)
    spreads = {name: spread_of(each.value, slopes.summary_numbers.get(name, {}), laws) for name, each in found.items()}
    return Uncertainty(
        laws=laws,
        p=points,
        moments=tuple(map(spread_of, solved.value.tolist(), slopes.moments, repeat(laws))),
        summary_numbers={name: each for name, each in spreads.items() if each is not None},
        sensitivities=slopes,
    )
