"""The principal eigenvalue of L(p), Eq. (19), with both eigenfunctions; and the rightmost part of the spectrum.

For a real shift σ > Λ the resolvent (σ − L)⁻¹ is a positive operator whose largest eigenvalue is 1/(σ − Λ):
seen from the right, Λ is the nearest eigenvalue. From there, or quicker from the pair at a neighbouring p,
two-sided Rayleigh quotient iteration converges cubically; that it found the principal pair is checked by the one
property that no other pair has: T > 0 and T* > 0 (Perron-Frobenius; one of the two is enough).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse import bmat
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

from fpsolve.errors import NotConverged
from fpsolve.generator import TiltedGenerator
from fpsolve.noise import FloatArray

BACKWARD_ERROR_GOAL = 1e-14
BACKWARD_ERROR_LIMIT = 1e-11
POSITIVE = 1e-2
"""T, or T*, is taken for positive where no more than this share of it has the wrong sign: discretisation error."""
SURELY_POSITIVE = 1e-3
"""The same for a pair found from a neighbouring p, where T, T* and their product must all pass."""
MAX_ITERATIONS = 12
STEPS_PER_FACTOR = 3
MAX_DENSE_UNKNOWNS = 4000


@dataclass(frozen=True, eq=False)
class PrincipalPair:
    """Λ(p) with its eigenfunctions on a mesh.

    Attributes:
        p: the moment.
        value: Λ(p), per unit time.
        right: coefficients of T, shape (size,); the mean of T over P_s(ξ)/2π is 1.
        left: coefficients of T*/P_s, shape (size,); ∫T T* dφ dξ over the full circle is 1.
        derivative: Λ′(p) = ⟨T*, L′(p) T⟩ (Hellmann-Feynman).
        residual: the larger of the two backward errors ‖(L − Λ)T‖/(‖L‖‖T‖), also for T*.
        rounding: bound on the effect of rounding on `value`.
        sign_defects: shares of ∫|T|P_s where T ≤ 0, of ∫|T*| where T* ≤ 0, of ∫|T T*| where either is.
        generator: what was solved.
    """

    p: float
    value: float
    right: FloatArray = field(repr=False)
    left: FloatArray = field(repr=False)
    derivative: float
    residual: float
    rounding: float
    sign_defects: tuple[float, float, float]
    generator: TiltedGenerator = field(repr=False)


def principal_pair(generator: TiltedGenerator, p: float, *, start: PrincipalPair | None = None) -> PrincipalPair:
    """The principal eigenvalue Λ(p) of Eq. (19) with T and T*.

    Args:
        generator: the discrete tilted generator.
        p: the moment.
        start: the pair of a neighbouring p on the same mesh; saves time, changes nothing beyond rounding.

    Raises:
        NotConverged: the iteration stalls, or both T and T* change sign: the mesh does not resolve the problem.
            `partial` is the pair that was reached.
    """
    one = generator.space.constant()  # T₀ and T₀*/P_s of weak noise, Eqs. (26) and (28)
    pair = _rayleigh_iteration(generator, p, *((one, one) if start is None else (start.right, start.left)))
    if pair.residual <= BACKWARD_ERROR_LIMIT and max(pair.sign_defects) <= SURELY_POSITIVE:
        return pair
    pair = _rayleigh_iteration(generator, p, *_from_the_right(generator, p))
    if not (pair.residual <= BACKWARD_ERROR_LIMIT and min(pair.sign_defects[:2]) <= POSITIVE):
        raise NotConverged(
            f"the principal eigenvalue at p = {p:g} was not found on this mesh: backward error {pair.residual:.1e} "
            f"(at most {BACKWARD_ERROR_LIMIT:g}), and {min(pair.sign_defects[:2]):.1e} of the more positive of T and "
            f"T* has the wrong sign (at most {POSITIVE:g}); use more cells, in the phase and in the noise",
            pair,
        )
    return pair


def second_derivative(pair: PrincipalPair) -> float:
    """Λ″(p) = ⟨T*, L″T⟩ + 2⟨T*, (L′ − Λ′)T′⟩, T′ from the bordered system (L − Λ)T′ = −(L′ − Λ′)T, ⟨T*, T′⟩ = 0."""
    generator, x, y = pair.generator, pair.right, pair.left
    mass, slope = generator.mass, generator.derivative(pair.p)
    norm = y @ (mass @ x)
    tilt = slope @ x - pair.derivative * (mass @ x)
    singular = generator.at(pair.p) - pair.value * mass
    system = bmat([[singular, (mass @ x)[:, None]], [(y @ mass)[None], None]], format="csc")
    change = _factor(system).solve(np.append(-tilt, 0.0))[:-1]
    mixed = y @ (slope @ change) - pair.derivative * (y @ (mass @ change))
    return float((y @ (generator.second_derivative(pair.p) @ x) + 2 * mixed) / norm)


def spectrum(generator: TiltedGenerator, p: float, k: int = 10) -> Any:
    """The k rightmost eigenvalues of L(p), by decreasing real part: complex, shape (k,).

    All eigenvalues of the dense matrix are computed (QR algorithm), so that none can be missed; use a
    full-circle mesh for the whole spectrum, a half-circle one has the π-periodic part of it only.

    Raises:
        ValueError: k is not from 1 to the number of unknowns, or these exceed `MAX_DENSE_UNKNOWNS`.
    """
    size = generator.space.size
    if size > MAX_DENSE_UNKNOWNS:
        raise ValueError(f"{size} unknowns; the whole spectrum takes at most {MAX_DENSE_UNKNOWNS}: use a coarser mesh")
    if not 1 <= k <= size:
        raise ValueError(f"k is {k}; it must be from 1 to the number of unknowns, {size}")
    root = scipy.linalg.cholesky(generator.mass.toarray(), lower=True)
    half = scipy.linalg.solve_triangular(root, generator.at(p).toarray(), lower=True)
    matrix = scipy.linalg.solve_triangular(root, half.T, lower=True).T
    values = scipy.linalg.eigvals(matrix, overwrite_a=True)
    return values[np.lexsort((values.imag, -values.real))][:k]


def _factor(matrix: Any) -> Any:
    """LU factors, ordered for a symmetric pattern and pivoting only where it must: half the time and the fill-in."""
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01)


def _from_the_right(generator: TiltedGenerator, p: float) -> tuple[FloatArray, FloatArray]:
    """Right and left vectors near the principal ones, from shifts that start at an upper bound of Λ(p)."""
    operator, mass = generator.at(p), generator.mass
    shift = generator.upper_bound(p) + 0.25 * generator.oscillator.omega
    right = left = generator.space.constant()
    for _ in range(2):
        factor = _factor(shift * mass - operator)
        right, inverse_distance = _dominant(lambda v, lu=factor: lu.solve(mass @ v), right, p)
        left, _unused = _dominant(lambda v, lu=factor: lu.solve(mass @ v, trans="T"), left, p)
        shift -= 0.95 / inverse_distance
    return right, left


def _dominant(apply: Any, start: FloatArray, p: float) -> tuple[FloatArray, float]:
    """The dominant eigenvector of a positive operator, and its eigenvalue, by Arnoldi iteration."""
    operator = LinearOperator((start.size, start.size), matvec=apply, dtype=float)
    try:
        values, vectors = eigs(operator, k=1, v0=start, tol=1e-4, maxiter=200)
    except ArpackNoConvergence as failure:
        raise NotConverged(
            f"the Arnoldi iteration for p = {p:g} did not settle; use more or higher-degree cells"
        ) from failure
    return vectors[:, 0].real, float(values[0].real)


def _rayleigh_iteration(generator: TiltedGenerator, p: float, x: FloatArray, y: FloatArray) -> PrincipalPair:
    """Two-sided Rayleigh quotient iteration (Ostrowski) until the backward error stops falling."""
    operator, mass = generator.at(p), generator.mass
    best = _pair(generator, p, operator, x, y)
    for _ in range(MAX_ITERATIONS):
        if best.residual <= BACKWARD_ERROR_GOAL:
            break
        try:
            factor = _factor(operator - best.value * mass)
        except RuntimeError:  # singular: the shift is the eigenvalue to the last bit
            factor = _factor(operator - (best.value + 1e-10 * generator.oscillator.omega) * mass)
        x, y = best.right, best.left
        for _ in range(STEPS_PER_FACTOR):
            x, y = factor.solve(mass @ x), factor.solve(mass @ y, trans="T")
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
            break
        pair = _pair(generator, p, operator, x, y)
        if pair.residual > 0.5 * best.residual and best.residual <= BACKWARD_ERROR_LIMIT:
            break
        best = pair
    return best


def _pair(generator: TiltedGenerator, p: float, operator: Any, x: FloatArray, y: FloatArray) -> PrincipalPair:
    """Normalise both vectors and measure the pair: two-sided Rayleigh quotient, backward errors, signs."""
    mass, one = generator.mass, generator.space.constant()
    x = x * (one @ (mass @ one)) / (one @ (mass @ x))
    y = y / (y @ (mass @ x) * 2 * np.pi / generator.space.mesh.span)
    norm = y @ (mass @ x)
    value = y @ (operator @ x) / norm
    size = abs(operator).sum(axis=0).max()
    residual = max(
        np.linalg.norm(matrix @ v - value * (weight @ v)) / (size * np.linalg.norm(v))
        for matrix, weight, v in ((operator, mass, x), (operator.T, mass.T, y))
    )
    return PrincipalPair(
        p=p,
        value=float(value),
        right=x,
        left=y,
        derivative=float(y @ (generator.derivative(p) @ x) / norm),
        residual=float(residual),
        rounding=float(np.finfo(float).eps * (abs(y) @ (abs(operator) @ abs(x))) / norm),
        sign_defects=_sign_defects(generator, x, y),
        generator=generator,
    )


def _sign_defects(generator: TiltedGenerator, x: FloatArray, y: FloatArray) -> tuple[float, float, float]:
    """Shares of T and of T* that are not positive, and of T T* where either is not, on seven points each way of a cell.

    The last one looks where the tilted density lives: a strong tilt hides the sign change of another pair from P_s.
    """
    space = generator.space
    local = np.linspace(0.05, 0.95, 7)
    right, left = space.values(x, local, local), space.values(y, local, local)
    weight = space.density(space.noise.evaluation(local)[0])

    def share(values: FloatArray, positive: Any) -> float:
        size = np.abs(values) * weight
        return float(np.sum(size[~positive]) / np.sum(size))

    return share(right, right > 0), share(left, left > 0), share(right * left, (right > 0) & (left > 0))
