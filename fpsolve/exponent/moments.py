"""Λ(p) for even p without directions: the moments of order p of the state obey a closed set of linear equations.

Without walls the functions √(p!/α!) x^α, |α| = p, are moved by ẋ = Ax with a matrix K(A), the symmetric power of A,
linear in A and skew-symmetric for a rotation. For functions f_k of noise, g f_k = Σ Ξ_lk f_l, L_ξ f_k = Σ G_lk f_l,

    H = Σ K(A) ⊗ Ξᵀ + (½ ΣK(B)² + Σ ν (exp K(C) − 1)) ⊗ 1 + 1 ⊗ Gᵀ

moves E[x^α f_k], for terms g(ξ)A, white noises Bx ∘ dW and impulses exp(C) at the rates ν. Λ(p) is its rightmost
eigenvalue. The right vector is of moments, the left one of T, a polynomial of the degree p in x. As moments stay
moments, no eigenvalue is nearer to a real σ > Λ than Λ: the search begins at a bound by norms, from the right.
The functions of the noise end somewhere; what the next ones change, with the last two of these to all orders and the
others to the first, is added, and is the error, with what it is by the last one alone.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, reduce
from itertools import combinations_with_replacement
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyfit
from scipy import sparse
from scipy.linalg import solve_triangular
from scipy.sparse.linalg import norm

from fpsolve.arrays import ROUNDED, Coefficient, FloatArray, one
from fpsolve.budget import unless_over_budget
from fpsolve.data import brief
from fpsolve.errors import NoHierarchy, NoSuchExponent
from fpsolve.exponent.delays import DelayRates
from fpsolve.exponent.matrices import MatrixRates
from fpsolve.exponent.method import BUDGET, Budget, Search, Stage
from fpsolve.exponent.powers import Moving, PowerRates, moment_form, moves, multi_indices, multinomials, of_signs
from fpsolve.exponent.rightmost import REMEDY, ROUNDING
from fpsolve.fem.space import BASES
from fpsolve.messages import Remedy
from fpsolve.model.coordinates import framed, mean_matrix
from fpsolve.model.noise import Noise
from fpsolve.model.problem import Problem
from fpsolve.theory.perturbation import Scale

MOST_AS_POWERS = 1000
"""Largest number of second moments that are one vector, times the first functions of the noises."""
MOST = 20_000
"""Largest number of equations."""
MOST_NUMBERS = 500_000
"""Largest number of second moments that are matrices."""
MOST_MOMENTS = 1000
"""Largest number of moments for each function of the noise."""
FIRST = 4
"""Degree of the functions of each noise to begin with."""
NEXT = 2
"""Number of degrees more that tell the error."""
GROWTH = 1.4
"""Factor from one degree to the next."""
TOLERANCE = 1e-13
"""Error that is wanted where none is named, over the terms that Λ is the sum of."""
LOOSEST = 1e-4
"""Largest error that ends the search, over these terms: with fewer functions the effects may be small by chance."""
LARGEST_ERROR = 1e-3
"""Error over these terms that leaves nothing of a value."""
STEP = 1e-4
"""Share of a parameter by which it is varied to differentiate H."""
STEEPNESS = 5.0
"""Relative change of what the next functions add, with a parameter, over their degree: 3.5 to 4 was measured."""
NEGATIVE = 1e-6
"""Share of the largest number by which one may be negative that should not be."""
CLEAN = 1e-14
"""Share of the largest entry of a matrix of a noise that is rounding."""
MOST_DEGREES = 160
"""Highest degree of functions of one noise: with twice as many points the weights of a rule underflow."""


class Functions(NamedTuple):
    """Orthonormal functions f_k of a noise in its law, nested by their degree.

    Attributes:
        degrees: of each, shape (n,).
        generator: G, L_ξ f_k = Σ G_lk f_l, shape (n, n).
        mass: Ξ of a coefficient g, g f_k = Σ Ξ_lk f_l.
        unit: the coefficients of 1, which are E f_k, shape (n,).
    """

    degrees: Any
    generator: FloatArray
    mass: Callable[[Coefficient], FloatArray]
    unit: Any


@lru_cache(64)  # derivatives by parameters of the system have the same
def functions_of(noise: Noise, count: int) -> Functions:
    """Those of degrees below a count: the functions of elements, by a Cholesky factor C of their products ∫ f_k f_l."""
    axis = BASES[noise.basis](noise, count)
    at = np.flatnonzero(axis.modes < count)
    factor = np.linalg.cholesky(axis.matrix(one)[np.ix_(at, at)])

    def of_own(matrix: Any) -> FloatArray:
        """C⁻¹ M C⁻ᵀ, without what rounding leaves of zeros."""
        half = solve_triangular(factor, matrix[np.ix_(at, at)], lower=True)
        found = solve_triangular(factor, half.T, lower=True).T
        return np.where(np.abs(found) > CLEAN * np.max(np.abs(found)), found, 0.0)

    return Functions(
        axis.modes[at], of_own(axis.generator()), lambda g: of_own(axis.mass(g)), factor.T @ axis.constant[at]
    )


def even_moment(
    problem: Problem,
    p: float,
    tolerance: float | None = None,
    most: int = MOST,
    *,
    rtol: float = TOLERANCE,
    budget: Budget = BUDGET,
) -> EvenMoment:
    """Λ(p) of an even p.

    Args:
        problem: a motion and its noise.
        p: even.
        tolerance: its largest error; None for the smallest that there is, down to rtol.
        most: number of equations, of moments that are no matrices.
        rtol: error over the terms that Λ is the sum of.
        budget: of the number of equations, if it states one.

    Raises:
        NoHierarchy: the equations do not close for this problem and this p, or are too many.
    """
    refuse_open_hierarchy(problem, p)
    equations = Equations(problem, int(p))

    def allowed(found: EvenMoment) -> float:
        loosest = rtol if tolerance is None else LOOSEST
        return max(min(loosest * found.scale, math.inf if tolerance is None else tolerance), 2 * found.rounding)

    search = Search(p, allowed, budget, Remedy.BUDGET)
    with unless_over_budget():
        return search.settle(Level(equations, (FIRST,) * len(equations.noises), most))
    if (last := search.judged) and last.error <= (LARGEST_ERROR * last.scale if tolerance is None else tolerance):
        return last
    if search.failure:
        raise NoHierarchy(str(search.failure))
    raise NoHierarchy(
        f"got p = {p:g}; {most} equations, or {MOST_DEGREES} functions of each noise, are too few for moments "
        f"under noise so strong or slow; use a smaller p, or {REMEDY}"
    )


def constant_scale(problem: Problem) -> Scale:
    """The scale of Λ(p) where even p alone are computed: constant terms, with the mean of the noise."""
    now = problem.dimension - len(problem.linear.pasts)
    mean = mean_matrix(problem, problem.noise.motion(problem.linear))[:now, :now]
    abscissa = abs(float(np.max(np.linalg.eigvals(mean).real)))
    is_moved = abscissa > ROUNDED * np.linalg.norm(mean)
    return Scale(abscissa if is_moved else framed(problem).unit_rate, 0.0)


def refuse_open_hierarchy(problem: Problem, p: float) -> None:
    """Refuse a problem whose moments of order p do not close, or are too many. Raises `NoHierarchy`."""
    if not (p > 0 and p % 2 == 0):
        raise NoHierarchy(f"got p = {p:g}; the equations of the moments close for even p > 0 only; choose p = 2, 4, …")
    for noise in problem.valued.parts.values():
        if noise.basis not in BASES:
            raise NoHierarchy(
                f"moments of even order are infinite under {noise.kind} noise with algebraic tails; take r0 <= 1"
            )
    if any(wall.changes_state for wall in problem.linear.barriers):
        raise NoHierarchy(
            "the equations of the moments do not close where a wall changes the state, as that happens at one phase; "
            f"{REMEDY}, or remove the wall"
        )
    if problem.linear.pasts and p != 2:
        raise NoHierarchy(f"got p = {p:g}; with a delay the equations of the moments are for p = 2; {REMEDY}")
    moments = math.comb(int(p) + problem.dimension - 1, problem.dimension - 1)
    count = moments * math.prod(BASES[noise.basis](noise, FIRST).size for noise in problem.valued.parts.values())
    limits = (MOST_MOMENTS, MOST) if p > 2 else (math.inf, MOST_NUMBERS)
    for number, what, limit in zip((moments, count), ("moments", "equations"), limits, strict=True):
        if number > limit:
            raise NoHierarchy(f"got p = {p:g}; its {number:.12g} {what} are more than {limit}; use a smaller p")


@dataclass(frozen=True, eq=False, repr=False)
class EvenMoment:
    """Λ(p) of an even p, the rightmost eigenvalue with some functions of the noises.

    Attributes:
        equations: what it is the eigenvalue of.
        counts: the degrees of the functions of each noise are below these.
        eigenvalue: without the next functions.
        effects: what the next functions of each noise change in it.
        scale: of the terms that it is the sum of.
        x, y: the right and the left vector, yᵀx = 1.
        moments: of √(p!/α!) x^α, |α| = p, the right vector in the mean over the noise.
        polynomial: the coefficients of T at the same, in the mean over the noise.
        change: by the last step, from `effects` where only the last functions move with the next ones, and from fewer
            functions, where that is beyond the errors of both: then `effects` are no errors.
        finer: how many times polynomials of the time were made finer, where there are delays.
        derivative: Λ′(p), which leads to other degrees and is not known.
    """

    equations: Equations
    counts: Sequence[int]
    eigenvalue: float
    effects: Sequence[float]
    scale: float
    x: FloatArray
    y: FloatArray
    moments: FloatArray
    polynomial: FloatArray
    change: float
    finer: int
    derivative: ClassVar[float] = math.nan

    def __repr__(self) -> str:
        return brief(self, f"Λ({self.equations.p}) = {self.value:.10g} ± {self.error:.0e}, {self.x.size} equations")

    @property
    def value(self) -> float:
        """Λ(p), per unit time."""
        return self.eigenvalue + sum(self.effects)

    @property
    def rounding(self) -> float:
        """A bound of what rounding changes, also in what moves the state: by its size, and the condition of Λ."""
        condition = float(np.linalg.norm(self.x) * np.linalg.norm(self.y))
        return ROUNDING * self.scale + sys.float_info.epsilon * self.equations.largest * condition

    @property
    def told(self) -> float:
        """What its own functions tell of the error."""
        return sum(map(abs, self.effects)) + self.rounding

    @property
    def error(self) -> float:
        """Estimate of |error of `value`|; infinite where moments, or T, are not positive."""
        return self.told + self.change if self.is_positive else math.inf

    def slope(self, key: str) -> tuple[float, float]:
        """∂Λ(p)/∂θ of a parameter such as "noise.alpha", and its error: ⟨y, ∂H/∂θ x⟩ by differences of H.

        The slope is that of a polynomial through values next to each other. The error is what fewer of them tell,
        rounding in the differences, and how fast what Λ(p) lacks may change.

        Raises:
            ValueError: there is no such parameter.
            NoSuchExponent: there are no such problems on one side of it.
        """
        problem = self.equations.problem
        at = float(problem.values[key])
        step = STEP * (abs(at) or 1.0)
        for offsets in (0, 1, -1, 2, -2), (0, -1, -2, -4), (0, 1, 2, 4):
            with suppress(ValueError, NoHierarchy):
                values = [self._with(problem.at({key: at + step * offset})) for offset in offsets]
                coarse, slope = (polyfit(offsets[:k], values[:k], k - 1)[1] for k in (3, len(offsets)))
                lacking = STEEPNESS * max(self.counts) * abs(step / at if at else 1.0) * self.error
                return slope / step, (abs(slope - coarse) + self.rounding + self.change + lacking) / step
        raise NoSuchExponent(f"got {key}; Λ(p) has no slope by it")

    def _with(self, problem: Problem) -> float:
        """⟨y, Hx⟩ of a problem next to it."""
        refuse_open_hierarchy(problem, self.equations.p)
        near = Equations(problem, self.equations.p, self.equations.units)
        rates = near.rates(*near.over_noise(self.counts), self.finer)
        return float(self.y @ (rates.at(self.eigenvalue) @ self.x))

    @cached_property
    def is_positive(self) -> bool:
        """Whether E x^α are moments, and T is positive, as far as it is seen: both but for a common sign."""
        form = moment_form(self.moments, self.equations.dimension, self.equations.p)
        return _has_one_sign(np.linalg.eigvalsh(form)) and _has_one_sign(self._polynomial_values())

    def _polynomial_values(self) -> Any:
        """T at some directions; of p = 2 the eigenvalues of its matrix."""
        n, p = self.equations.dimension, self.equations.p
        if p == 2:
            return np.linalg.eigvalsh(moment_form(self.polynomial, n, 2))
        x = np.random.default_rng(0).standard_normal((200, n))
        x /= np.linalg.norm(x, axis=1)[:, None]
        alphas = multi_indices(n, p)
        return np.prod(x[:, None] ** alphas, axis=2) @ (self.polynomial * np.sqrt(multinomials(alphas)))


def _has_one_sign(values: Any) -> bool:
    values = values * np.sign(values[np.argmax(np.abs(values))])
    return bool(values.min() >= -NEGATIVE * values.max())


@dataclass(frozen=True)
class Level(Stage):
    """The functions of each noise of degrees below some counts; where these do not settle, more do not.

    Attributes:
        equations: of the moments.
        counts: of each noise.
        most: number of equations, of moments that are no matrices.
        before: with fewer functions.
    """

    equations: Equations
    counts: tuple[int, ...]
    most: int
    before: EvenMoment | None = None

    @property
    def size(self) -> int:
        if max(self.counts) > MOST_DEGREES:
            return sys.maxsize
        return self.equations.scales.size * math.prod(int(each.sum()) for each in self.equations.are_old(self.counts))

    @property
    def most_unknowns(self) -> int:
        return MOST_NUMBERS if self.equations.is_large else self.most

    def solved(self, p: float, near: EvenMoment | None) -> EvenMoment:
        return self.equations.moment(self.counts)

    def judged(self, found: EvenMoment, allowed: float) -> EvenMoment:
        """With what the last step changed, where that is beyond the errors of both."""
        if not any(found.effects):
            return found
        if self.before is None:  # effects may be small by chance
            return replace(found, change=math.inf)
        step = abs(self.before.value - found.value)
        return replace(found, change=found.change + step * (step > found.told + found.change + self.before.told))

    def refined(self, found: EvenMoment, goal: float, most: int) -> Level | None:
        """More functions of the noises of which the next ones change most; None where there are no others."""
        if not (worst := max(map(abs, found.effects), default=0.0)):
            return None
        more = [
            math.ceil(GROWTH * count) if abs(effect) >= 0.1 * worst else count
            for count, effect in zip(self.counts, found.effects, strict=True)
        ]
        return replace(self, counts=tuple(more), before=found)


class Equations:
    """H of a problem and an even p, with any number of functions of each noise.

    Args:
        problem: the problem.
        p: even.
        units: of the variables; None for those in which what moves them is balanced.

    Attributes:
        dimension: the number of variables that are no past values of others.
        is_large: whether their second moments are matrices.
        scales: of the functions of the state, by these units.
        largest: what about no number in H exceeds.

    Raises:
        NoHierarchy: numbers in it are beyond floating-point numbers.
    """

    def __init__(self, problem: Problem, p: int, units: FloatArray | None = None) -> None:
        self.problem, self.p, self.pasts = problem, p, problem.linear.pasts
        self.dimension = problem.dimension - len(self.pasts)
        named = problem.valued.parts
        self.noises, names = list(named.values()), list(named)
        moved = problem.noise.motion(problem.linear)
        steady, self._loads = np.zeros(2 * (problem.dimension,)), list[tuple[Any, int]]()
        loads = []
        for term in moved.terms:
            matrix = moved.epsilon**term.order * np.array(term.matrix)
            if term.g == one:
                steady += matrix
                continue
            self._loads.append((term.g, names.index(term.noise) if term.noise in named else 0))
            loads.append(matrix)
        squares = [moved.epsilon**each.order * np.array(each.matrix) for each in moved.diffusions]
        jolts = [(each.rate, np.array(each.exponent)) for each in moved.impulses]
        moving, sizes = Moving(steady, loads, squares, jolts), _sizes(self.over_noise([2] * len(self.noises))[1])
        self.units = moving.balance(sizes, [variable for variable, _ in self.pasts]) if units is None else units
        self.moving = moving.over(self.units)
        own = combinations_with_replacement(self.units[: self.dimension].tolist(), p)
        self.scales = np.array([math.prod(each) for each in own])
        first = self.scales.size * self.means([FIRST] * len(self.noises)).size
        self.is_large = p == 2 and not self.pasts and first > MOST_AS_POWERS
        with np.errstate(over="ignore"):
            _, self.largest = self.moving.bounds(p, sizes)
        if not math.isfinite(self.largest):
            raise NoHierarchy("the equations of the moments are beyond floating-point numbers; use a smaller p")

    def are_old(self, counts: Sequence[int]) -> list[Any]:
        """Which functions of each noise, with the next ones, are of degrees below these."""
        axes = self._axes([count + NEXT for count in counts])
        return [each.degrees < count for each, count in zip(axes, counts, strict=True)]

    def moment(self, counts: Sequence[int]) -> EvenMoment:
        """Λ(p) with functions of degrees below these. Raises `NoHierarchy`: it does not settle."""
        more = [count + NEXT for count in counts]
        axes, is_old = self._axes(more), self.are_old(counts)
        generator, masses = self.over_noise(more)
        h, old, mean = self.rates(generator, masses), reduce(np.kron, is_old), self.means(counts)
        start = np.kron(mean, of_signs(self.dimension, self.p))
        bound, _ = self.moving.bounds(self.p, _sizes(masses))
        value, x, y, change, scale, finer = h.on(old).rightmost(start, bound)
        h = h.at(value)
        whole = np.zeros((2, old.size, self.scales.size))
        whole[:, old] = x.reshape(mean.size, -1), y.reshape(mean.size, -1)
        images = [each.reshape(old.size, -1) for each in (h @ whole[0].ravel(), h.T @ whole[1].ravel())]
        effects = []
        for k, (axis, count) in enumerate(zip(axes, counts, strict=True)):
            new = reduce(np.kron, [~each if k == j else each for j, each in enumerate(is_old)])
            told = [0.0, 0.0]
            for last in (1, 2) if new.any() else ():
                moved = reduce(
                    np.kron, [axis.degrees >= count - last if k == j else each for j, each in enumerate(is_old)]
                )
                right, left = ((each * new[:, None])[moved].ravel() for each in images)
                told[last - 1] = float(left @ h.on(moved).inverse(value, right.size)(right))
            effects.append(told[1])
            change += abs(told[1] - told[0])
        moments, polynomial = (mean @ each.reshape(mean.size, -1) for each in (x, y))
        moments, polynomial = moments * self.scales, polynomial / self.scales
        return EvenMoment(self, tuple(counts), value, effects, scale, x, y, moments, polynomial, change, finer)

    def rates(self, generator: Any, masses: Sequence[Any], finer: int = 0) -> Any:
        """H from Gᵀ and the Ξᵀ of each load, and polynomials of the time as fine as that."""
        if self.pasts:
            return DelayRates.of(self.moving, self.pasts, generator, masses, finer)
        if self.is_large:
            return MatrixRates.of(self.moving, generator, masses)
        return PowerRates.of(self._moves, generator, masses)

    @cached_property
    def _moves(self) -> list[Any]:
        return moves(self.moving, self.p)

    def _axes(self, counts: Sequence[int]) -> list[Functions]:
        return [functions_of(noise, count) for noise, count in zip(self.noises, counts, strict=True)]

    def means(self, counts: Sequence[int]) -> FloatArray:
        """The coefficients of 1 in functions of degrees below these, which are the means of these, too."""
        return reduce(np.kron, [axis.unit for axis in self._axes(counts)])

    def over_noise(self, counts: Sequence[int]) -> tuple[Any, list[Any]]:
        """Gᵀ, and Ξᵀ of each load, with functions of degrees below these."""
        axes = self._axes(counts)
        ones = [sparse.eye_array(each.degrees.size) for each in axes]

        def over(of_noise: Any, at: int) -> Any:
            """The transpose of a matrix of one noise, for functions of all."""
            factors = [sparse.csr_array(of_noise.T) if k == at else each for k, each in enumerate(ones)]
            return sparse.csr_array(reduce(sparse.kron, factors))

        generator = sum(over(axis.generator, k) for k, axis in enumerate(axes))
        return generator, [over(axes[at].mass(g), at) for g, at in self._loads]


def _sizes(masses: Sequence[Any]) -> list[float]:
    """What no Ξ exceeds."""
    return [math.sqrt(norm(xi, 1) * norm(xi, np.inf)) for xi in masses]
