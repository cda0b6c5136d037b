"""Reference values of Λ(p): discontinuous Galerkin on an unstructured triangle mesh of the (φ, z) strip.

The operator is L(p) of Eq. (19) with the Ornstein-Uhlenbeck noise of Eq. (15), in z = ξ/std, std² = σ²/2α:

    L(p) T = α (∂zz − z ∂z) T + v ∂φT + p q T,     v = ω + ε h₁ ξ + ε² h₂,     q = ε q₁ ξ + ε² q₂,
    h₁ = ½ sin 2φ,   q₁ = ½ (1 − cos 2φ),   h₂ = c₁ h₁,   q₂ = c₁ q₁,

on π/2 < φ < 3π/2, |z| < half_width.  The ends φ = π/2 and 3π/2 are one line, the seam: there the impact makes
T(φ⁻) = Rᵖ T(φ⁺), and v = ω.  At z = ± half_width the flux P ∂zT is zero.  Nothing here is a tensor product.

With the weight P(z) = exp(−z²/2)/√2π, Λ is the rightmost eigenvalue of A T = Λ M T, where

    w·M T = ∫ P T w,
    w·A T = ∫ P (v ∂φT + p q T) w − α ∫ P ∂zT ∂zw                          over the triangles
          + ∫ P (v n_φ)⁺ (T_out − T_in) w_in                               over the edges, from either side
          + α ∫ P ({∂zT} n_z [w] + {∂zw} n_z [T] − η n_z² [T] [w])         over the edges
          + ∫ P ω (Rᵖ T(φ⁺) − T(φ⁻)) w(φ⁻)                                 over the seam.

The normal n points outward from the triangle of w_in, and L is a backward operator: T is carried against the
flow, so a triangle takes its data from the side its trajectories go to.

P varies by orders of magnitude over a triangle that is much taller than one unit of z.  Under strong noise
such triangles give spurious eigenvalues on the right.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.spatial import Delaunay
from skfem import (
    Basis,
    BilinearForm,
    ElementDG,
    ElementTriP2,
    ElementTriP3,
    ElementTriP4,
    FacetBasis,
    InteriorFacetBasis,
    MeshTri,
    asm,
)

_ELEMENTS = {2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}


def moment_lyapunov(
    *,
    alpha: float,
    sigma: float,
    omega: float,
    epsilon: float,
    c1: float,
    log_R: float,
    p: float,
    cells_phi: int,
    cells_z: int,
    degree: int,
    half_width: float = 6.0,
    seed: int = 0,
) -> float:
    """Λ(p) on about 2 · `cells_phi` · `cells_z` triangles, with polynomials of `degree` 2, 3 or 4.

    `log_R` is ln R, the jump of the log-amplitude at each impact.
    """
    A, M, basis = matrices(
        alpha=alpha,
        sigma=sigma,
        omega=omega,
        epsilon=epsilon,
        c1=c1,
        log_R=log_R,
        p=p,
        cells_phi=cells_phi,
        cells_z=cells_z,
        degree=degree,
        half_width=half_width,
        seed=seed,
    )
    # Λ ≤ max L T/T for any positive T.  Take R^(p s), the sawtooth s rising from 0 to 1 between two impacts.
    phi, z = basis.doflocs
    v, q = _coefficients(phi, sigma / np.sqrt(2 * alpha) * z, omega, epsilon, c1)
    bound = np.max(p * (log_R / np.pi * v + q))
    return _rightmost(A, M, shift=bound + alpha)


def matrices(
    *,
    alpha: float,
    sigma: float,
    omega: float,
    epsilon: float,
    c1: float,
    log_R: float,
    p: float,
    cells_phi: int,
    cells_z: int,
    degree: int,
    half_width: float = 6.0,
    seed: int = 0,
) -> tuple[sp.csr_matrix, sp.csr_matrix, Basis]:
    """The matrices A and M above and their basis, neither scaled nor inverted.

    The nodal interpolant of f(φ, z) is u = f(*basis.doflocs); w·A u is the bilinear form of L(p).
    """
    mesh, (seam_left, seam_right) = _strip(cells_phi, cells_z, half_width, seed)
    element = ElementDG(_ELEMENTS[degree]())
    order = 2 * degree + 6
    basis = Basis(mesh, element, intorder=order)
    sides = [InteriorFacetBasis(mesh, element, side=side, intorder=order) for side in (0, 1)]
    after = FacetBasis(mesh, element, facets=seam_left, intorder=order)  # φ⁺ = π/2
    before = FacetBasis(mesh, element, facets=seam_right, intorder=order)  # φ⁻ = 3π/2
    if not np.allclose(after.global_coordinates()[1], before.global_coordinates()[1], rtol=0, atol=1e-12):
        raise ValueError("the quadrature points of the two ends of the strip differ")

    std = sigma / np.sqrt(2 * alpha)
    # The inverse trace inequality of polynomials holds |edge|/|triangle|; take the larger of both sides.
    area = 0.5 * np.abs(basis.mapping.detA)
    length = np.linalg.norm(mesh.p[:, mesh.facets[1]] - mesh.p[:, mesh.facets[0]], axis=0)
    eta = 2 * degree * (degree + 1) * (length / area[mesh.f2t].min(axis=0))[sides[0].find][:, None]

    @BilinearForm
    def mass(T, w, x):
        return _weight(x.x[1]) * T * w

    @BilinearForm
    def volume(T, w, x):
        phi, z = x.x
        v, q = _coefficients(phi, std * z, omega, epsilon, c1)
        return _weight(z) * ((v * T.grad[0] + p * q * T) * w - alpha * T.grad[1] * w.grad[1])

    @BilinearForm
    def transport(T, w, x):
        trial, test = x.idx  # the sides; x.n points from side 0 to side 1
        v, _ = _coefficients(x.x[0], std * x.x[1], omega, epsilon, c1)
        outflow = np.maximum((-1) ** test * v * x.n[0], 0)
        return _weight(x.x[1]) * outflow * (T if trial != test else -T) * w

    @BilinearForm
    def diffusion(T, w, x):
        trial, test = x.idx
        jump_T, jump_w = (-1) ** trial * T, (-1) ** test * w
        consistent = 0.5 * x.n[1] * (T.grad[1] * jump_w + w.grad[1] * jump_T)
        return _weight(x.x[1]) * alpha * (consistent - eta * x.n[1] ** 2 * jump_T * jump_w)

    @BilinearForm
    def seam(T, w, x):
        return _weight(x.x[1]) * omega * T * w

    A = asm(volume, basis) + asm(transport, sides, sides) + asm(diffusion, sides, sides)
    A = A + np.exp(p * log_R) * seam.assemble(after, before) - seam.assemble(before, before)
    return A.tocsr(), asm(mass, basis).tocsr(), basis


def _coefficients(
    phi: np.ndarray, xi: np.ndarray, omega: float, epsilon: float, c1: float
) -> tuple[np.ndarray, np.ndarray]:
    """The speed v = ω + ε h₁ ξ + ε² h₂ and the growth q = ε q₁ ξ + ε² q₂ of Eq. (18), the impact left out."""
    strength = epsilon * xi + epsilon**2 * c1
    return omega + strength * np.sin(2 * phi) / 2, strength * (1 - np.cos(2 * phi)) / 2


def _weight(z: np.ndarray) -> np.ndarray:
    """P(z) = exp(−z²/2)/√2π."""
    return np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)


def _strip(cells_phi: int, cells_z: int, half_width: float, seed: int) -> tuple[MeshTri, list[np.ndarray]]:
    """Delaunay mesh of a jittered lattice, and the edges at φ = π/2 and at φ = 3π/2, in the order of z.

    The nodes on the boundary stay in place, and are numbered in the order of z at both ends.  So the
    quadrature points of paired edges match.
    """
    i, j = (index.ravel() for index in np.mgrid[: cells_phi + 1, : cells_z + 1])
    inside = (i > 0) & (i < cells_phi) & (j > 0) & (j < cells_z)
    lattice = np.array([i, j], dtype=float)
    lattice[:, inside] += np.random.default_rng(seed).uniform(-0.3, 0.3, (2, inside.sum()))

    triangles = Delaunay(lattice.T).simplices.T
    x = np.pi / 2 + np.pi * lattice[0] / cells_phi
    z = half_width * (2 * lattice[1] / cells_z - 1)
    mesh = MeshTri(np.array([x, z]), triangles)

    ends = []
    for end in (0, cells_phi):
        edges = np.nonzero((lattice[0][mesh.facets] == end).all(axis=0))[0]
        ends.append(edges[np.argsort(lattice[1][mesh.facets[:, edges]].sum(axis=0))])
    return mesh, ends


def _rightmost(A: sp.csr_matrix, M: sp.csr_matrix, shift: float) -> float:
    """The rightmost Λ of A T = Λ M T, which must be real, from a real shift to its right.

    Then 1/(shift − Λ) is the largest eigenvalue of (shift·M − A)⁻¹ M.  The unknowns are scaled by
    diag(M)^(−½), as P spans many orders of magnitude.
    """
    scale = sp.diags(M.diagonal() ** -0.5)
    A, M = (scale @ matrix @ scale for matrix in (A, M))
    symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
    factors = spla.splu((shift * M - A).tocsc(), **symmetric)
    resolvent = spla.LinearOperator(A.shape, lambda u: factors.solve(M @ u), dtype=float)
    start = 1 / scale.diagonal()
    value = spla.eigs(resolvent, 1, which="LM", v0=start, return_eigenvectors=False)[0]
    if abs(value.imag) > 1e-8 * abs(value) or value.real < 0:
        raise ValueError(f"no real eigenvalue is rightmost: {shift - 1 / value}")
    return float(shift - 1 / value.real)
