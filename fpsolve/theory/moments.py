"""Λ(p) for even p without directions: the moments of order p of the state obey a closed set of linear equations.

Without walls the functions √(p!/α!) x^α, |α| = p, are moved by ẋ = Ax with a matrix K(A), the symmetric power of A,
linear in A and skew-symmetric for a rotation. For functions f_k of noise, g f_k = Σ Ξ_lk f_l, L_ξ f_k = Σ G_lk f_l,

    H = Σ K(A) ⊗ Ξᵀ + (½ ΣK(B)² + Σ ν (exp K(C) − 1)) ⊗ 1 + 1 ⊗ Gᵀ

moves E[x^α f_k], for terms g(ξ)A, white noises Bx ∘ dW and impulses exp(C) at the rates ν. Λ(p) is its rightmost
eigenvalue. The right vector is of moments, the left one of T, a polynomial of the degree p in x. As moments stay
moments, no eigenvalue is nearer to a real σ > Λ than Λ: the search begins at a bound by the rows of H, from the right.
The functions of the noise end somewhere; what the next ones change, to first order, is added, and is the error.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import combinations_with_replacement
from typing import Any, NamedTuple, cast

import numpy as np
import scipy.linalg
from scipy import sparse
from scipy.linalg import eigh_tridiagonal
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

from fpsolve.arrays import Coefficient, FloatArray, dense, one
from fpsolve.budget import charge
from fpsolve.data import brief
from fpsolve.errors import NoHierarchy, SingularMatrix
from fpsolve.model.noise import Noise
from fpsolve.model.problem import Problem
from fpsolve.polynomials import gegenbauer, hermite
from fpsolve.superlu import sparse_lu

MOST = 20_000
"""Largest number of equations."""
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
ROUNDING = 10 * sys.float_info.epsilon
"""Error by rounding, over these terms."""
MEANINGLESS = 1e-3
"""Error over these terms that leaves nothing of a value."""
NEARER = 0.15
"""Share of σ − Λ that the next σ keeps."""
NEAREST = 1e-3
"""Share of σ − Λ that the last σ keeps."""
SETTLED = 1e-7
"""Change of Λ over σ − Λ with which it is settled."""
MOST_STEPS = 60
"""Largest number of σ."""
MOST_POLISHES = 5
"""Largest number of steps that polish Λ from there."""
PASSED = 10.0
"""Factor to the last σ − Λ by which the next Λ is lower where rounding has put σ on the left of it: it is another."""
KRYLOV = 16
"""Number of vectors of one search by Arnoldi's method."""
ROUGH = 1e-2
"""Tolerance of this search."""
MOST_RESTARTS = 200
"""Largest number of its restarts."""
STEP = 1e-5
"""Share of a parameter by which it is varied to differentiate H."""
NEGATIVE = 1e-6
"""Share of the largest number by which one may be negative that should not be."""
DENSE = 200
"""Number of equations up to which matrices are not sparse."""
MOST_DEGREES = 160
"""Highest degree of functions of one noise: with twice as many points the weights of a rule underflow."""
ENTRY_OPERATIONS = 8e4
"""Number of operations that take the time of a factorisation for an entry of a sparse matrix, 4 µs."""
ENTRY_BYTES = 250
"""Memory of its factors, in bytes for each of its entries."""
MANY_ENTRIES = 1e5
"""Number of entries from which on it is factorised where a signal can leave it."""
REMEDY = "compare with `fpsolve simulate`"
MORE_POINTS = 16
"""Number of points of a quadrature rule beyond two for each function."""
PURE = 1e-9
"""Difference of the logarithm of a density to that of Gauss or Gegenbauer that is rounding."""


class Functions(NamedTuple):
    """Functions f_k of a noise, nested by their degree.

    Attributes:
        degrees: of each, shape (n,).
        generator: G, shape (n, n).
        mass: Ξ of a coefficient g.
        unit: the coefficients of 1, shape (n,).
        law: E f_k, shape (n,).
    """

    degrees: Any
    generator: Any
    mass: Callable[[Coefficient], Any]
    unit: FloatArray
    law: FloatArray


def _polynomials(noise: Noise, count: int) -> Functions:
    """Those orthonormal in P_s, by a rule of Gauss for e^(−z²/2), or for (1 − z²)^a on a bounded support."""
    is_bounded = math.isfinite(noise.half_width)
    size, middle = (noise.half_width, 0.0) if is_bounded else (noise.standard_deviation, noise.mean)
    points = 2 * count + MORE_POINTS
    pure = gegenbauer(points, noise.end_exponent) if is_bounded else hermite(points)
    z, weights = pure.rule()
    values, slopes = (each[:, :count] for each in pure.at(z))
    xi = middle + size * z
    logs = noise.log_density(xi) - (noise.end_exponent * np.log1p(-(z**2)) if is_bounded else -0.5 * z**2)
    if np.ptp(logs) > PURE:
        weights = weights * np.exp(logs - logs.max())
        weights /= weights.sum()
        _, r = np.linalg.qr(np.sqrt(weights)[:, None] * values)
        values, slopes = (np.linalg.solve((np.sign(np.diag(r))[:, None] * r).T, each.T).T for each in (values, slopes))
    rates = 0.5 * weights * noise.squared_diffusion(xi) / size**2
    start = np.eye(1, count)[0]
    return Functions(
        np.arange(count),
        -slopes.T @ (rates[:, None] * slopes),
        lambda g: values.T @ ((weights * g(xi))[:, None] * values),
        start,
        start,
    )


def _states(noise: Any, count: int) -> Functions:
    """1 in one state each; of these there are never more."""
    states = np.array(noise.states)
    rates = np.array(noise.rates)
    return Functions(
        np.zeros(states.size), rates, lambda g: np.diag(g(states)), np.ones(states.size), noise.probabilities
    )


def _waves(noise: Any, count: int) -> Functions:
    """1, √2 cos kθ, √2 sin kθ of the angle dθ = ν dt + σ dW, k < count."""
    k = (np.arange(2 * count - 1) + 1) // 2
    theta = np.arange(4 * count + 4 * MORE_POINTS) * (2 * np.pi / (4 * count + 4 * MORE_POINTS))
    waves = np.exp(1j * np.outer(theta, k))
    values = np.sqrt(2 - (k == 0)) * np.where(np.arange(k.size) % 2, waves.real, waves.imag)
    values[:, 0] = 1.0
    turn = np.where(np.arange(k.size - 1) % 2, k[1:], 0)  # (sin kθ)′ = k cos kθ
    generator = np.diag(-0.5 * noise.sigma**2 * k**2) + noise.nu * (np.diag(turn, 1) - np.diag(turn, -1))
    xi, start = noise.of_angle(theta), np.eye(1, k.size)[0]
    return Functions(k, generator, lambda g: values.T @ (g(xi)[:, None] * values) / theta.size, start, start)


def _pairs(noise: Any, count: int) -> Functions:
    """He_i(u₁) He_j(u₂), i + j < count, with du = −Mu dt + N dW: L = −Σ M_ij a_j† a_i, a the lowering of degrees."""
    degrees, second = np.tril_indices(count)
    first = degrees - second
    lower = []
    for power, less in ((first, degrees), (second, degrees + 1)):
        at = np.flatnonzero(power)
        lower.append(sparse.csr_array((np.sqrt(power[at]), (at - less[at], at)), shape=2 * (degrees.size,)))
    generator = -sum(noise.drift_matrix[i, j] * (lower[j].T @ lower[i]) for i, j in np.ndindex(2, 2))
    start = np.eye(1, degrees.size)[0]

    def mass(g: Coefficient) -> Any:
        b = np.sqrt(np.arange(1.0, 2 * count + MORE_POINTS))
        u, vectors = eigh_tridiagonal(np.zeros(b.size + 1), b)
        table = vectors[:count] * np.sign(vectors[0])  # He_k at the points, times the roots of the weights
        matrix = (table * g(noise.standard_deviation * u)) @ table.T
        return np.where(np.equal.outer(second, second), matrix[np.ix_(first, first)], 0.0)

    return Functions(degrees, generator, mass, start, start)


FUNCTIONS = {"polynomials": _polynomials, "states": _states, "waves": _waves, "pairs": _pairs}


@lru_cache(maxsize=32)
def _ladder(n: int, p: int) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """All α, shape (N, n), and row, column, i, j and √(α_i(α_j + 1)) of what A_ij adds to K(A)."""
    alphas = np.array([np.bincount(each, minlength=n) for each in combinations_with_replacement(range(n), p)])
    places = {tuple(each): k for k, each in enumerate(alphas.tolist())}
    found = []
    for k, alpha in enumerate(alphas.tolist()):
        for i, j in np.ndindex(n, n):
            if alpha[i]:
                to = list(alpha)
                to[i] -= 1
                found.append((k, places[(*to[:j], to[j] + 1, *to[j + 1 :])], i, j, math.sqrt(alpha[i] * (to[j] + 1))))
    return alphas, tuple(np.array(each) for each in zip(*found, strict=True))


def moved(matrix: Any, p: int) -> Any:
    """K(A), sparse."""
    a = np.asarray(matrix, dtype=float)
    alphas, (rows, columns, i, j, sizes) = _ladder(len(a), p)
    return sparse.csr_array((sizes * a[i, j], (rows, columns)), shape=2 * (len(alphas),))


def hierarchy_exponent(problem: Problem, p: float) -> tuple[float, float]:
    """Λ(p) of an even p by the equations of the moments, and its error.

    Raises:
        NoHierarchy: the equations do not close for this problem and this p, or are too many.
    """
    found = even_moment(problem, p)
    return found.value, found.error


def even_moment(problem: Problem, p: float, tolerance: float | None = None, most: int = MOST) -> EvenMoment:
    """Λ(p) of an even p, its error within a tolerance if there is one, by so many equations at most.

    Raises:
        NoHierarchy: the equations do not close for this problem and this p, or are too many.
    """
    refuse_open_hierarchy(problem, p)
    equations = _Equations(problem, int(p))
    counts, before = [FIRST] * len(equations.noises), cast(EvenMoment | None, None)
    while True:
        level = equations.moment(counts, most)
        if level is None:
            break
        allowed = TOLERANCE * level.scale if tolerance is None else tolerance
        if any(level.effects):
            change = abs(before.value - level.value) if before else math.inf
            told = level.error + before.error - before.change if before else 0.0
            level = replace(level, change=change if change > told else 0.0)
        if level.is_positive and level.error <= max(allowed, 2 * level.rounding):
            return level
        before = level
        worst = max(map(abs, level.effects), default=0.0)
        counts = [
            math.ceil(GROWTH * count) if abs(effect) >= 0.1 * worst else count
            for count, effect in zip(counts, level.effects, strict=True)
        ]
        if not worst:
            break
    if before is None or tolerance is not None or not before.is_positive or before.error > MEANINGLESS * before.scale:
        raise NoHierarchy(
            f"got p = {p:g}; {most} equations, or {MOST_DEGREES} functions of each noise, are too few for moments "
            f"under noise so strong or slow; use a smaller p, or {REMEDY}"
        )
    return before


def refuse_open_hierarchy(problem: Problem, p: float) -> None:
    """Refuse a problem whose moments of order p do not close, or are too many. Raises `NoHierarchy`."""
    if not (p > 0 and p % 2 == 0):
        raise NoHierarchy(f"got p = {p:g}; the equations of the moments close for even p > 0 only; choose p = 2, 4, …")
    for noise in problem.coloured.parts.values():
        if noise.basis not in FUNCTIONS:
            raise NoHierarchy(
                f"moments of even order are infinite under {noise.kind} noise with algebraic tails; take r0 <= 1"
            )
    if any(jump.log_factor for jump in problem.system.jumps):
        raise NoHierarchy(
            "the equations of the moments do not close where a wall changes the state, as that happens at one phase; "
            f"{REMEDY}, or remove the wall"
        )
    moments = math.comb(int(p) + problem.dimension - 1, problem.dimension - 1)
    count = moments
    for noise in problem.coloured.parts.values():
        count *= len(noise.states) if noise.has_states else FIRST  # type: ignore[attr-defined]
    for number, what, limit in ((moments, "moments", MOST_MOMENTS), (count, "equations", MOST)):
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
        change: from fewer functions, where that is beyond the errors of both: then `effects` are no errors.
    """

    equations: _Equations
    counts: Sequence[int]
    eigenvalue: float
    effects: Sequence[float]
    scale: float
    x: FloatArray
    y: FloatArray
    moments: FloatArray
    polynomial: FloatArray
    change: float = 0.0

    def __repr__(self) -> str:
        return brief(self, f"Λ({self.equations.p}) = {self.value:.10g} ± {self.error:.0e}, {self.x.size} equations")

    @property
    def value(self) -> float:
        """Λ(p), per unit time."""
        return self.eigenvalue + sum(self.effects)

    @property
    def rounding(self) -> float:
        """A bound of what rounding changes."""
        return ROUNDING * self.scale

    @property
    def error(self) -> float:
        """Estimate of |error of `value`|."""
        return sum(map(abs, self.effects)) + self.rounding + self.change

    def slope(self, key: str) -> float:
        """∂Λ(p)/∂θ of a parameter such as "noise.alpha": ⟨y, ∂H/∂θ x⟩ by differences of H.

        Raises:
            ValueError: there is no such parameter.
        """
        problem = self.equations.problem
        at = float(problem.values[key])
        step = STEP * (abs(at) or 1.0)
        for offsets, weights in ((1, -1), (0.5, -0.5)), ((0, -1, -2), (1.5, -2.0, 0.5)), ((0, 1, 2), (-1.5, 2.0, -0.5)):
            with suppress(ValueError, NoHierarchy):
                near = [problem.at({key: at + step * offset}) for offset in offsets]
                for each in near:
                    refuse_open_hierarchy(each, self.equations.p)
                changed = [_Equations(each, self.equations.p, self.equations.units).at(self.counts) for each in near]
                return sum(w * float(self.y @ (h @ self.x)) for w, h in zip(weights, changed, strict=True)) / step
        raise ValueError(f"got {key}; Λ(p) has no slope by it")

    @cached_property
    def is_positive(self) -> bool:
        """Whether E x^α are moments, and T is positive, as far as it is seen: both but for a common sign."""
        form, t = (
            moment_form(self.moments, self.equations.problem.dimension, self.equations.p),
            self._polynomial_values(),
        )
        return _has_one_sign(np.asarray(np.linalg.eigvalsh(form))) and _has_one_sign(t)

    def _polynomial_values(self) -> FloatArray:
        """T at some directions; of p = 2 the eigenvalues of its matrix."""
        n, p = self.equations.problem.dimension, self.equations.p
        if p == 2:
            return np.asarray(np.linalg.eigvalsh(moment_form(self.polynomial, n, 2)))
        x = np.random.default_rng(0).standard_normal((200, n))
        x /= np.linalg.norm(x, axis=1)[:, None]
        alphas, _ = _ladder(n, p)
        return np.prod(x[:, None] ** alphas, axis=2) @ (self.polynomial * np.sqrt(_multinomials(alphas)))


def _has_one_sign(values: FloatArray) -> bool:
    values = values * np.sign(values[np.argmax(np.abs(values))])
    return bool(values.min() >= -NEGATIVE * values.max())


def _multinomials(alphas: Any) -> FloatArray:
    """p!/α!."""
    from scipy.special import gammaln

    return np.asarray(np.exp(gammaln(alphas.sum(axis=1) + 1) - gammaln(alphas + 1).sum(axis=1)))


def moment_form(moments: FloatArray, n: int, p: int) -> FloatArray:
    """E x^(α + β), |α| = |β| = p/2, in the units of the functions of order p/2."""
    alphas, _ = _ladder(n, p)
    halves, _ = _ladder(n, p // 2)
    places = {tuple(each): k for k, each in enumerate(alphas.tolist())}
    at = np.array([[places[tuple(each)] for each in (half + halves).tolist()] for half in halves])
    sizes = np.sqrt(_multinomials(halves))
    return np.asarray((moments / np.sqrt(_multinomials(alphas)))[at] * np.outer(sizes, sizes))


class _Equations:
    """H of a problem and an even p, with any number of functions of each noise.

    Args:
        problem: the problem.
        p: even.
        units: of the functions of the state; None for those in which H is balanced.

    Raises:
        NoHierarchy: numbers in it are beyond floating-point numbers.
    """

    def __init__(self, problem: Problem, p: int, units: FloatArray | None = None) -> None:
        self.problem, self.p = problem, p
        named = problem.coloured.parts
        self.noises, names = list(named.values()), list(named)
        drift, diffusions, impulses = problem.noise.motion(problem.system)
        terms = []
        for term in drift.terms:
            k = moved(drift.epsilon**term.order * np.array(term.matrix), p)
            terms.append((k, term.g, names.index(term.noise) if term.noise in named else 0))
        rest = 0.0 * moved(np.eye(problem.dimension), p)
        for each in diffusions:
            k = moved(drift.epsilon**each.order * np.array(each.matrix), p)
            rest = rest + 0.5 * k @ k
        for impulse in impulses:
            gain = scipy.linalg.expm(moved(np.array(impulse.exponent), p).toarray())
            rest = rest + sparse.csr_array(impulse.rate * (gain - np.eye(len(gain))))
        sizes = abs(rest).toarray()
        for k, g, at in terms:
            noise = self.noises[at]
            z = np.array([-1.0, 0.0, 1.0]) * (0.0 if noise.is_white else noise.standard_deviation)
            sizes += abs(k).toarray() * float(np.max(np.abs(g(noise.mean + z))))
        if not np.isfinite(sizes).all():
            raise NoHierarchy(f"got p = {p}; the equations of its moments are beyond floating-point numbers")
        if units is None:
            with np.errstate(invalid="ignore"):  # of units beyond an integer, which none are taken for here
                _, (units, _) = scipy.linalg.matrix_balance(sizes, permute=False, separate=True)
        self.units = units
        down, up = sparse.diags_array(1 / units), sparse.diags_array(units)
        self._terms, self._rest = [(down @ k @ up, g, at) for k, g, at in terms], down @ rest @ up

    def at(self, counts: Sequence[int]) -> Any:
        """H with functions of degrees below these."""
        return self._with(self._axes(counts))

    def moment(self, counts: Sequence[int], most: int) -> EvenMoment | None:
        """Λ(p) with functions of degrees below these; None where they are too many."""
        if max(counts) > MOST_DEGREES:
            return None
        axes, n = self._axes([count + NEXT for count in counts]), self.units.size
        is_old = [each.degrees < count for each, count in zip(axes, counts, strict=True)]
        if n * math.prod(int(each.sum()) for each in is_old) > most:
            return None
        h, state = self._with(axes), np.ones(n, dtype=bool)
        old = np.flatnonzero(_outer([state, *is_old]))
        own = h[old][:, old]
        mean, law = (
            _outer([np.ones(1), *(getattr(axis, name)[each] for axis, each in zip(axes, is_old, strict=True))])
            for name in ("unit", "law")
        )
        form = _start(self.problem.dimension, self.p)
        eigenvalue, x, y = _rightmost(own, np.kron(form / self.units, law), np.kron(form * self.units, mean))
        scale = float(np.abs(y) @ (abs(own) @ np.abs(x)))
        effects = []
        for k in range(len(axes)):
            new = np.flatnonzero(_outer([state, *(~each if k == j else each for j, each in enumerate(is_old))]))
            effect = 0.0
            if new.size:
                changed = _solver(h[new][:, new], eigenvalue)(h[new][:, old] @ x)
                effect = float(y @ (h[old][:, new] @ changed))
            effects.append(effect)
        moments, polynomial = x.reshape(n, -1) @ mean * self.units, y.reshape(n, -1) @ law / self.units
        return EvenMoment(self, tuple(counts), eigenvalue, effects, scale, x, y, moments, polynomial)

    def _axes(self, counts: Sequence[int]) -> list[Functions]:
        return [FUNCTIONS[noise.basis](noise, count) for noise, count in zip(self.noises, counts, strict=True)]

    def _with(self, axes: Sequence[Functions]) -> Any:
        """H; sparse where it is large."""
        shape = [self.units.size, *(each.degrees.size for each in axes)]
        is_small = math.prod(shape) <= DENSE
        kron, arrayed = (np.kron, dense) if is_small else (partial(sparse.kron, format="csr"), sparse.csr_array)
        ones = [arrayed(sparse.eye_array(size)) for size in shape]

        def product(of_state: Any, of_noise: Any = None, at: int = 0) -> Any:
            found = arrayed(of_state)
            for k, each in enumerate(ones[1:]):
                found = kron(found, each if of_noise is None or k != at else arrayed(_clean(of_noise).T))
            return found

        h = product(self._rest)
        for k, axis in enumerate(axes):
            h = h + product(ones[0], axis.generator, k)
        for k, g, at in self._terms:
            h = h + product(k, axes[at].mass(g) if g != one else None, at)
        return h


def _outer(factors: Sequence[Any]) -> Any:
    """The product of all combinations, in one row."""
    found = np.ones(1, dtype=factors[0].dtype)
    for each in factors:
        found = np.multiply.outer(found, each).ravel()
    return found


def _clean(matrix: Any) -> FloatArray:
    """Without what rounding leaves of zeros."""
    full = dense(matrix)
    return np.where(np.abs(full) > 1e-15 * np.max(np.abs(full), initial=0.0), full, 0.0)


def _solver(h: Any, sigma: float) -> Callable[..., FloatArray]:
    """(σ − h)⁻¹ of a vector, or its transpose for trans = 1. Raises `SingularMatrix`."""
    if isinstance(h, np.ndarray):
        lu, pivots, singular = dgetrf(sigma * np.eye(len(h)) - h)
        if singular:
            raise SingularMatrix("singular")
        return lambda x, trans=0: dgetrs(lu, pivots, x, trans=trans)[0]
    matrix = (sigma * sparse.eye_array(h.shape[0]) - h).tocsc()
    charge(ENTRY_OPERATIONS * matrix.nnz, 1e-9 * ENTRY_BYTES * matrix.nnz, h.shape[0])
    factors = sparse_lu(matrix, permc_spec="COLAMD", many=MANY_ENTRIES)
    return lambda x, trans=0: np.asarray(factors.solve(x, "T" if trans else "N"))


@lru_cache(maxsize=32)
def _start(n: int, p: int) -> FloatArray:
    """The moments of a vector of independent Gaussian numbers."""
    alphas, _ = _ladder(n, p)
    from scipy.special import gammaln

    logs = np.sum(gammaln(alphas + 1) - gammaln(alphas / 2 + 1) - 0.5 * alphas * math.log(2), axis=1)
    found = np.where(np.all(alphas % 2 == 0, axis=1), np.exp(logs) * np.sqrt(_multinomials(alphas)), 0.0)
    return np.asarray(found / np.linalg.norm(found))


def _rightmost(h: Any, *starts: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """The rightmost eigenvalue of a generator of positive forms, and its right and left vectors, from positive ones."""
    diagonal, sizes = h.diagonal(), abs(h)
    bound = min(float(np.max(diagonal - np.abs(diagonal) + sizes.sum(axis=axis))) for axis in (0, 1))
    sigma = bound + 0.1 * max(1e-3 * float(sizes.max()), abs(bound), sys.float_info.min)
    value, away, x = -math.inf, math.inf, starts[0]
    for _ in range(MOST_STEPS):
        last, (share, x) = value, _largest(_solver(h, sigma), x)
        value = sigma - 1 / share
        if last - value > PASSED * away:
            value, sigma = last, last + away
            break
        if abs(value - last) <= SETTLED * (sigma - value):
            break
        away = sigma - value
        sigma = value + NEARER * away
    x, y, sigma = *starts, value + NEAREST * (sigma - value)
    for _ in range(MOST_POLISHES):
        try:
            solve = _solver(h, sigma)
        except SingularMatrix:  # it is an eigenvalue to the last digit
            break
        for _ in range(2):
            x, y = (each / np.max(np.abs(each)) for each in (solve(x), solve(y, 1)))
        last, value = value, float(y @ (h @ x)) / float(y @ x)
        rounding = ROUNDING * float(np.abs(y) @ (sizes @ np.abs(x))) / abs(float(y @ x))
        if abs(value - last) <= 0.1 * rounding:
            break
        sigma = value + max(1e-3 * rounding, ROUNDING**2 * float(sizes.max()))
    return value, x, y / float(y @ x)


def _largest(solve: Callable[[FloatArray], FloatArray], x: FloatArray) -> tuple[float, FloatArray]:
    """The eigenvalue of the largest real part of a positive map, roughly, and its vector, from a positive one."""
    if x.size <= KRYLOV:
        values, vectors = np.linalg.eig(solve(np.eye(x.size)))
    else:
        shape = 2 * (x.size,)
        operator = LinearOperator(shape, matvec=solve, dtype=float)
        try:
            values, vectors = eigs(operator, 1, which="LR", v0=x, tol=ROUGH, ncv=KRYLOV, maxiter=MOST_RESTARTS)
        except ArpackNoConvergence as failure:
            raise NoHierarchy(
                f"no rightmost eigenvalue is found among those of {x.size} equations; {REMEDY}"
            ) from failure
    at = int(np.argmax(values.real))
    return float(values[at].real), vectors[:, at].real
