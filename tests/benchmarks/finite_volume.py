"""First-order upwind finite volumes on the tensor grid of π/2 < φ < 3π/2, |z| < half_width.

The balance of probability m in cell (i, j), with the velocity v at the faces, and its adjoint, which acts on T̃:

    (L_φ T̃)_ij = [v⁺_(i+½,j) (T̃_(i+1,j) − T̃_ij) + v⁻_(i−½,j) (T̃_ij − T̃_(i−1,j))]/Δφ,         v± = max/min(v, 0),
    (L_z T̃)_ij = α/(P_j Δz²) [P_(j+½) (T̃_(i,j+1) − T̃_ij) − P_(j−½) (T̃_ij − T̃_(i,j−1))],      P = exp(−z²/2),

and L̃(p) = L_φ + L_z + p g. The grid is periodic in φ; at z = ± half_width the flux is zero.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from tests.benchmarks.pencil import Pencil
from tests.benchmarks.problem import FloatArray, Peer, Problem


class FiniteVolume(Peer):
    """Args: problem; size (cells_phi, cells_z, half_width)."""

    name = "upwind finite volumes"
    sizes: ClassVar = {
        "weak": ((512, 32, 6.0), (1024, 48, 6.0), (2048, 64, 6.0), (4096, 64, 6.0), (4096, 128, 6.0)),
        "strong": ((256, 128, 11.0), (256, 256, 11.0), (256, 512, 11.0), (512, 512, 11.0), (512, 1024, 11.0)),
    }
    tuned: ClassVar = {"weak": (4096, 128, 6.0), "strong": (512, 512, 11.0)}

    def __init__(self, problem: Problem, size: tuple[int, int, float]) -> None:
        cells_phi, cells_z, half_width = size
        dphi, dz = math.pi / cells_phi, 2 * half_width / cells_z
        phi = math.pi / 2 + dphi * (np.arange(cells_phi) + 0.5)
        z = -half_width + dz * (np.arange(cells_z) + 0.5)
        weight, face_weight = np.exp(-(z**2) / 2), np.exp(-((z[1:] - dz / 2) ** 2) / 2)
        mass = sp.diags_array(np.tile(weight, cells_phi)).tocsc()

        difference = sp.diags_array(
            [-np.ones(cells_z - 1), np.ones(cells_z - 1)], offsets=[0, 1], shape=(cells_z - 1, cells_z)
        )
        diffusion = -problem.alpha / dz**2 * difference.T @ sp.diags_array(face_weight) @ difference
        ahead = sp.csr_array(np.roll(np.eye(cells_phi), 1, axis=1))  # (ahead T)_i = T_(i+1)
        forward = sp.kron(ahead - sp.eye_array(cells_phi), sp.eye_array(cells_z)) / dphi
        backward = sp.kron(sp.eye_array(cells_phi) - ahead.T, sp.eye_array(cells_z)) / dphi
        right, left = (_terms(problem, phi + shift * dphi, z)[0] for shift in (0.5, -0.5))
        along = sp.diags_array(np.maximum(right, 0)) @ forward + sp.diags_array(np.minimum(left, 0)) @ backward

        A0 = mass @ along + sp.kron(sp.eye_array(cells_phi), diffusion)
        _, growth = _terms(problem, phi, z)
        A1 = mass @ sp.diags_array(growth)
        self.pencil = Pencil((A0, A1), mass, np.ones(growth.size), lambda p: np.max(p * growth) + 0.01, 1e-11)


def _terms(problem: Problem, phi: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """v and g at every pair of φ and z, φ slow."""
    angle = 2 * phi[:, None]
    (v, _), (g, _) = problem.terms(z, np.sin(angle), np.cos(angle), tilt=0.0)
    return v.ravel(), g.ravel()
