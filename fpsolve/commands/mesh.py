"""Write a mesh that a case can name."""

from __future__ import annotations

from pathlib import Path

from fpsolve.commands.options import Count
from fpsolve.fem.mesh import make_mesh, write_mesh
from fpsolve.messages import escaped


def mesh(
    output: Path,
    *,
    phi_cells: Count = 2,
    phi_degree: Count = 10,
    xi_cells: Count = 4,
    xi_degree: Count = 9,
    xi_min: float = -8.0,
    xi_max: float = 8.0,
    grading: float = 1.0,
    full_circle: bool = False,
) -> int:
    """Write a mesh that a case can name as [mesh] file.

    Example: fpsolve mesh meshes/graded.vtu --phi-cells 3 --xi-cells 8 --grading 2

    Args:
        output: The file to write: .vtu for ParaView, .msh for Gmsh.
        phi_cells: Cells in the phase, from one impact to the next.
        phi_degree: Degree of the elements in the phase.
        xi_cells: Cells in the noise.
        xi_degree: Degree of the elements in the noise.
        xi_min: Lower end of the noise, in standard deviations.
        xi_max: Upper end of the noise, in standard deviations.
        grading: Size of the outermost noise cells divided by that of the innermost; 1 is uniform.
        full_circle: Mesh the whole circle of phases instead of one half.
    """
    made = make_mesh(
        phi_cells=phi_cells,
        phi_degree=phi_degree,
        xi_cells=xi_cells,
        xi_degree=xi_degree,
        xi_min=xi_min,
        xi_max=xi_max,
        grading=grading,
        full_circle=full_circle,
    )
    write_mesh(made, output)
    cells = (made.phi_lines.size - 1) * (made.z_lines.size - 1)
    unknowns = (made.phi_lines.size - 1) * (phi_degree + 1) * ((made.z_lines.size - 1) * xi_degree + 1)
    print(f"written: {escaped(str(output))} ({cells} cells, {unknowns} unknowns)")
    return 0
