"""Quadrilaterals of high order with NGSolve on the strip π/2 < φ < 3π/2, |y| < half_width.

With u(φ, y) and the coefficients of `problem`, for the test w and the weight P_s(y) = exp(−y²/2):

    ⟨w, L̃(p) u⟩ = ∫ P_s [(v₀ + p v₁) w ∂φu − α ∂yw ∂yu + (p r₁ + p² r₂) w u],      ⟨w, M u⟩ = ∫ P_s w u.

u is periodic in φ. At y = ± half_width the condition is natural: P_s ∂yu = 0, no flux of probability.
"""

from __future__ import annotations

import importlib.util
import math
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from tests.benchmarks.pencil import Pencil
from tests.benchmarks.problem import FloatArray, Peer, Problem

UNAVAILABLE = None if importlib.util.find_spec("ngsolve") else "ngsolve is not installed: pip install ngsolve"


class NGSolveCode(Peer):
    """Args: problem; size (cells_phi, cells_y, order, half_width)."""

    name = "quadrilaterals (NGSolve)"
    sizes: ClassVar = {
        "weak": ((4, 2, 6, 6.0), (3, 3, 6, 6.0), (5, 3, 5, 6.0), (4, 3, 6, 6.0), (3, 3, 7, 7.0), (6, 3, 5, 6.0)),
        "strong": (
            (16, 4, 6, 7.0),
            (24, 4, 6, 7.0),
            (24, 5, 6, 7.0),
            (32, 5, 6, 7.0),
            (20, 4, 8, 7.0),
            (24, 4, 8, 7.0),
        ),
    }
    tuned: ClassVar = {"weak": (5, 3, 5, 6.0), "strong": (32, 5, 6, 7.0)}

    def __init__(self, problem: Problem, size: tuple[int, int, int, float]) -> None:
        import ngsolve as ng

        cells_phi, cells_y, order, half_width = size
        mesh = _mesh(cells_phi, cells_y, half_width)
        space = ng.Periodic(ng.H1(mesh, order=order))
        u, w = space.TnT()
        v, r = problem.terms(ng.y, ng.sin(2 * ng.x), ng.cos(2 * ng.x), problem.tilt)
        du = ng.grad(u)
        densities = (
            v[0] * du[0] * w - problem.alpha * du[1] * ng.grad(w)[1],
            v[1] * du[0] * w + r[0] * u * w,
            r[1] * u * w,
            u * w,
        )

        free = np.flatnonzero(list(space.FreeDofs()))  # the others repeat them one period on
        weight = ng.exp(-ng.y * ng.y / 2)
        *A, M = (_assembled(space, weight * density, free) for density in densities)
        constant = (free < mesh.nv).astype(float)  # the vertex functions add up to 1
        self.pencil = Pencil(A, M, constant, problem.bound, 1e-11)


def _mesh(cells_phi: int, cells_y: int, half_width: float, grading: float = 1.5) -> Any:
    """Lines equidistant in φ, and in y at half_width · sinh(grading t)/sinh(grading), |t| ≤ 1: finer in the middle."""
    from ngsolve.meshes import MakeStructured2DMesh

    def position(s: float, t: float) -> tuple[float, float]:
        return math.pi * (s + 0.5), half_width * math.sinh(grading * (2 * t - 1)) / math.sinh(grading)

    return MakeStructured2DMesh(quads=True, nx=cells_phi, ny=cells_y, periodic_x=True, mapping=position)


def _assembled(space: Any, density: Any, free: FloatArray) -> sp.csc_array:
    """The matrix of the bilinear form with this density."""
    import ngsolve as ng

    form = ng.BilinearForm(space)
    form += density * ng.dx(bonus_intorder=6)
    form.Assemble()
    entries, columns, starts = (np.array(part) for part in form.mat.CSR())
    return sp.csr_array((entries, columns, starts), shape=(space.ndof, space.ndof))[free][:, free].tocsc()
