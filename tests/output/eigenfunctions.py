"""Eigenfunctions that are written for ParaView and read back, of a problem whose impacts are hard."""

import numpy as np
import pyvista
from vtkmodules.vtkCommonDataModel import vtkLagrangeQuadrilateral

from fpsolve.fem.mesh import CylinderMesh, make_mesh
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.parts.eigenfunctions import write_eigenfunctions

HARD = VibroImpactOscillator(omega=1.0, restitution=0.3, c1=0.1, epsilon=0.2)
FINE = {"phi_degree": 14, "xi_cells": 8}
MOMENTS = (-1.0, 0.0, 2.0)
QUARTERS = np.pi * np.array([-0.3, 0.1, 0.5, 0.8, 1.2, 1.5, 1.7])
MESHES = {
    "half circle": make_mesh(phi_cells=4, **FINE),
    "full circle, seam at -0.3 pi": CylinderMesh(QUARTERS, np.linspace(-8, 8, 9), 14, 9),
    "half circle, cells across 0 and pi": make_mesh(phi_cells=3, **FINE),
    "full circle": make_mesh(phi_cells=4, full_circle=True, **FINE),
    "half circle, seam at 7.2 pi": CylinderMesh(np.pi * np.array([7.2, 7.5, 7.9, 8.2]), np.linspace(-8, 8, 9), 14, 9),
}
COARSE = make_mesh(phi_cells=4, phi_degree=6, xi_cells=8)
"""For pictures, which ParaView draws sooner."""


def written(folder, solver, moments=MOMENTS, **options):
    """Write eigenfunctions of a solver at some p, and read them back: {p: grid}."""
    pairs = [solver.pair(p) for p in moments]
    _, *files = write_eigenfunctions(folder, pairs, solver.pair(0.0), **options)
    return {float(grid.field_data["p"][0]): grid for grid in map(pyvista.read, files)}


def integral(grid, name):
    """∫ of the Lagrange polynomials of an array, or of given values, their nodes numbered by VTK's own function."""
    values = grid[name] if isinstance(name, str) else name
    k = round(np.sqrt(grid.cell_connectivity.size / grid.n_cells)) - 1
    order = [vtkLagrangeQuadrilateral.PointIndexFromIJK(i, j, [k, k]) for i in range(k + 1) for j in range(k + 1)]
    nodes = grid.cell_connectivity.reshape(grid.n_cells, -1)[:, order]
    t = np.arange(k + 1) / k
    rule = np.linalg.solve(np.vander(t, increasing=True).T, 1 / np.arange(1, k + 2))
    areas = np.prod(np.ptp(grid.points[nodes], axis=1)[:, :2], axis=1)
    return areas @ values[nodes] @ np.outer(rule, rule).ravel()
