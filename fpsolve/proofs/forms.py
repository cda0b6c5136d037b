"""Bounds on Λ(2) of any number of variables under white noise, from a quadratic form (L. Collatz, H. Wielandt).

ẋ = A x + Σ B_k x ∘ dW_k moves the mean of xᵀHx to that of xᵀ(L*H)x,

    L*H = CᵀH + HC + Σ B_kᵀHB_k,      C = A + ½ Σ B_k².

With H > 0 and μ₋H ≤ L*H ≤ μ₊H, as symmetric matrices, E xᵀHx grows between e^(μ₋t) and e^(μ₊t) from every start, by
Grönwall's inequality, so that μ₋ ≤ Λ(2) ≤ μ₊. H = GᵀG is 1 in the coordinates Gx, where both are decided: a symmetric
matrix is positive where all of its pivots are, in balls.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.linalg import cholesky

from fpsolve.exponent.moments import even_moment
from fpsolve.exponent.powers import moment_form
from fpsolve.proofs.balls import Balls, ball, balls, inverse, matrix_product, precision, rounded
from fpsolve.proofs.statement import LinearRecord, Record, SquareMatrix

SEARCHES, RIDGE = 3, 1e-10
"""How often the form is sought, first in the variables and then where it is about 1, but for a share of its size."""
WIDENED, MOST_WIDENINGS = 4.0, 8
"""Factor of a distance that is not proven, and how often it is taken."""
LEAST = 1e-20
"""Smallest distance of a bound from μ, over the size of the motion."""


class FormDistance(Record):
    """How far a bound is from μ."""

    delta: Annotated[float, Field(ge=0)]


class FormCertificate(Record):
    """That mu − lower.delta ≤ Λ(2) ≤ mu + upper.delta.

    Attributes:
        stated: of what.
        factor: G of H = GᵀG.
    """

    p: ClassVar[float] = 2.0
    stated: LinearRecord
    mu: float
    factor: SquareMatrix
    upper: FormDistance | None
    lower: FormDistance | None

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if np.shape(self.factor) != np.shape(self.stated.drift):
            raise ValueError("factor must be a matrix of the size of the motion")
        return self

    @property
    def rest(self) -> Balls:
        """L*H − μH in the coordinates Gx, in which H is 1. Raises `ZeroDivisionError` where G may be singular."""
        factor = balls(self.factor)
        back, rest = inverse(factor), -ball(self.mu) * np.eye(len(factor), dtype=int)
        for k, each in enumerate((self.stated.drift, *self.stated.diffusions)):
            turned = matrix_product(matrix_product(factor, balls(each)), back)
            drift = matrix_product(turned, turned) / 2 if k else turned
            rest = rest + drift + drift.T + (matrix_product(turned.T, turned) if k else 0)
        return rest

    @precision()
    def objection(self) -> str:
        """Why the bounds need not hold; empty where they are proven."""
        try:
            rest = self.rest
        except ZeroDivisionError:
            return "G need not have an inverse"
        one = np.eye(len(rest), dtype=int)
        bounds = ("upper bound: μ₊H − L*H", self.upper, -1), ("lower bound: L*H − μ₋H", self.lower, 1)
        doubts = [
            what for what, side, sign in bounds if side and not _is_positive(ball(side.delta) * one + sign * rest)
        ]
        return "; ".join(f"{what} > 0 is not certain" for what in doubts)


def _is_positive(matrix: Balls) -> bool:
    """Whether all pivots of a symmetric matrix are positive."""
    left = matrix.copy()
    for k in range(len(left)):
        if not left[k, k] > 0:
            return False
        share = left[k + 1 :, k] / left[k, k]
        left[k + 1 :, k + 1 :] -= np.outer(share, left[k, k + 1 :])
    return True


@precision()
def form_certificate(stated: LinearRecord) -> FormCertificate | None:
    """The certificate with the least distances; None where no form is found to be positive. Raises `NoHierarchy`."""
    factor, mu = np.eye(len(stated.drift)), 0.0
    for _ in range(SEARCHES):
        even = even_moment(stated.problem(factor), 2)
        form = moment_form(even.polynomial, len(factor), 2)
        form *= np.sign(np.trace(form))
        least, *_, most = np.linalg.eigvalsh(form)
        mu, factor = even.value, cholesky(form + max(RIDGE * most - least, 0.0) * np.eye(len(form))) @ factor
    found = FormCertificate(stated=stated, mu=mu, factor=factor.tolist(), upper=None, lower=None)
    sides = dict[str, FormDistance]()
    distances, least = np.linalg.eigvalsh(rounded(found.rest)[0]), LEAST * float(np.linalg.norm(stated.drift))
    for name, distance in (("upper", distances[-1]), ("lower", -distances[0])):
        for delta in max(1.001 * float(distance), least) * WIDENED ** np.arange(MOST_WIDENINGS):
            side = {name: FormDistance(delta=float(delta))}
            if not found.model_copy(update=side).objection():
                sides |= side
                break
    return found.model_copy(update=sides) if sides else None
