"""Quadratic triangles of scikit-fem on the strip π/2 < φ < 3π/2, |y| < half_width.

With u(φ, y) and the coefficients of `problem`, for the test w and the weight P_s(y) = exp(−y²/2):

    ⟨w, L̃(p) u⟩ = ∫ P_s [(v₀ + p v₁) w ∂φu − α ∂yw ∂yu + (p r₁ + p² r₂) w u],      ⟨w, M u⟩ = ∫ P_s w u.

u is periodic in φ. At y = ± half_width the condition is natural: P_s ∂yu = 0, no flux of probability.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTriP2, MeshTri, MeshTri1DG

from tests.benchmarks.pencil import Pencil
from tests.benchmarks.problem import FloatArray, Peer, Problem


class Triangles(Peer):
    """Args: problem; size (cells_phi, cells_y, half_width), two triangles a cell."""

    name = "triangles P2 (scikit-fem)"
    sizes: ClassVar = {
        "weak": ((64, 64, 6.5), (96, 96, 6.5), (112, 96, 6.5), (128, 112, 6.5), (160, 128, 6.5)),
        "strong": ((64, 96, 7.0), (96, 128, 7.0), (128, 192, 7.0), (160, 224, 7.0), (176, 240, 7.0)),
    }
    tuned: ClassVar = {"weak": (112, 96, 6.5), "strong": (176, 240, 7.0)}

    def __init__(self, problem: Problem, size: tuple[int, int, float]) -> None:
        basis = Basis(_mesh(*size), ElementTriP2(), intorder=6)

        def terms(x):
            phi, y = x.x
            return _weight(y), *problem.terms(y, np.sin(2 * phi), np.cos(2 * phi), problem.tilt)

        @BilinearForm
        def constant_part(u, w, x):
            weight, v, _ = terms(x)
            return weight * (v[0] * u.grad[0] * w - problem.alpha * u.grad[1] * w.grad[1])

        @BilinearForm
        def linear_part(u, w, x):
            weight, v, r = terms(x)
            return weight * (v[1] * u.grad[0] + r[0] * u) * w

        @BilinearForm
        def quadratic_part(u, w, x):
            weight, _, r = terms(x)
            return weight * r[1] * u * w

        @BilinearForm
        def mass(u, w, x):
            return _weight(x.x[1]) * u * w

        forms = (constant_part, linear_part, quadratic_part, mass)
        *A, M = (sp.csc_array(form.assemble(basis)) for form in forms)
        self.pencil = Pencil(A, M, np.ones(basis.N), problem.bound, 1e-11)


def _mesh(cells_phi: int, cells_y: int, half_width: float, grading: float = 1.5) -> MeshTri1DG:
    """Lines equidistant in φ, and in y at half_width · sinh(grading t)/sinh(grading), |t| ≤ 1: finer in the middle."""
    phi = np.linspace(math.pi / 2, 3 * math.pi / 2, cells_phi + 1)
    y = half_width * np.sinh(grading * np.linspace(-1, 1, cells_y + 1)) / math.sinh(grading)
    mesh = MeshTri.init_tensor(phi, y)
    ends = [np.flatnonzero(np.isclose(mesh.p[0], phi[end])) for end in (-1, 0)]
    return MeshTri1DG.periodic(mesh, *(end[np.argsort(mesh.p[1, end])] for end in ends))


def _weight(y: FloatArray) -> FloatArray:
    return np.exp(-(y**2) / 2)
