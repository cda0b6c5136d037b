"""The computational domain: a cylinder, φ around it and the noise ξ along it, cut into φ-lines × ξ-lines.

Lengths along ξ are in noise units, z = ξ/std, so that one mesh serves many cases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import MeshError
from fpsolve.messages import Code, Message

MAX_DEGREE = 20
MAX_CELLS = 1000
TOLERANCE = 1e-9
NO_ZERO = "the noise interval [{:g}, {:g}] must contain 0 inside, where the noise lives; choose xi_min < 0 < xi_max"


@dataclass(frozen=True, eq=False)
class CylinderMesh:
    """Tensor grid on the circle φ and the truncated noise axis z = ξ/std, with the degrees of its elements.

    Attributes:
        phi_lines: increasing φ, shape (m + 1,); they span π (a half circle, as everything in Eq. (19) is
            π-periodic) or 2π, the first and the last being one line, the seam. Generators need a line at every
            impact.
        z_lines: increasing z, shape (n + 1,); none for noise with states.
        phi_degree: degree of the discontinuous elements in φ.
        xi_degree: degree of the continuous elements in ξ.

    Raises:
        MeshError: the lines or degrees are not as stated.
    """

    phi_lines: FloatArray
    z_lines: FloatArray
    phi_degree: int
    xi_degree: int

    def __post_init__(self) -> None:
        for name in ("phi_lines", "z_lines"):
            lines = np.array(getattr(self, name), dtype=float)
            lines.flags.writeable = False
            object.__setattr__(self, name, lines)
            if name == "z_lines" and lines.size == 0:
                continue
            if lines.ndim != 1 or lines.size < 2 or not np.all(np.isfinite(lines)):
                raise MeshError(f"{name} must be at least two finite numbers")
            if not np.all(np.diff(lines) > TOLERANCE * np.ptp(lines)):
                raise MeshError(f"{name} must increase, and no cell may be thinner than 1e-9 of the whole")
        for name in ("phi_degree", "xi_degree"):
            degree = getattr(self, name)
            if not isinstance(degree, int | np.integer) or not 1 <= degree <= MAX_DEGREE:
                raise MeshError(f"{name} is {degree!r}; it must be a whole number from 1 to {MAX_DEGREE}")
        turns = self.span / math.pi
        if not (abs(turns - 1) < TOLERANCE or abs(turns - 2) < TOLERANCE):
            raise MeshError(f"the phase spans {self.span:.9g}; it must span the half circle, pi, or the circle, 2 pi")

    @property
    def span(self) -> float:
        """π or 2π."""
        return float(self.phi_lines[-1] - self.phi_lines[0])

    def within(self, half_width: float) -> CylinderMesh:
        """This mesh cut off at |z| = half_width, the end of the noise's support, where it reaches beyond."""
        if not self.z_lines.size:
            return self
        lower, upper = max(self.z_lines[0], -half_width), min(self.z_lines[-1], half_width)
        if lower == self.z_lines[0] and upper == self.z_lines[-1]:
            return self
        sliver = 0.05 * (upper - lower) / (self.z_lines.size - 1)
        inside = self.z_lines[(self.z_lines > lower + sliver) & (self.z_lines < upper - sliver)]
        return replace(self, z_lines=np.concatenate([[lower], inside, [upper]]))


def vertices_at(lines: FloatArray, phase: float) -> Any:
    """The indices of the φ-lines lines[:-1] at φ and φ + π. Raises `MeshError` where one is missing."""
    found = np.flatnonzero(np.abs(np.sin(lines[:-1] - phase)) < TOLERANCE)
    turns = round((lines[-1] - lines[0]) / math.pi)
    if found.size != turns:
        name = "pi/2" if phase == math.pi / 2 else f"{phase:.6g}"
        raise MeshError(Message(Code.NO_IMPACT_LINE, wanted=turns, place=name, found=found.size))
    return found


def halved(lines: FloatArray) -> FloatArray:
    """The lines, and one in the middle between any two."""
    return np.sort(np.concatenate([lines, 0.5 * (lines[:-1] + lines[1:])]))


def make_mesh(
    *,
    phi_cells: int = 2,
    phi_degree: int = 10,
    xi_cells: int = 4,
    xi_degree: int = 9,
    xi_min: float = -8.0,
    xi_max: float = 8.0,
    grading: float = 1.0,
    full_circle: bool = False,
) -> CylinderMesh:
    """A mesh with equal φ-cells between impacts, and ξ-cells uniform or graded.

    Args:
        phi_cells: cells on the half circle from one impact to the next.
        phi_degree, xi_degree: degrees of the elements.
        xi_cells: cells along the noise axis.
        xi_min, xi_max: the noise interval in noise units, z = ξ/std; −8 and 8 leave 1e-15 of a Gaussian outside.
        grading: ratio of the outermost ξ-cells to the innermost ones; 1 is uniform.
        full_circle: mesh [0, 2π] with its seam at φ = 0, otherwise [π/2, 3π/2] with its seam at the impact.

    Raises:
        MeshError: a number is out of its range.
    """
    for name, count in (("phi_cells", phi_cells), ("xi_cells", xi_cells)):
        if not isinstance(count, int | np.integer) or not 1 <= count <= MAX_CELLS:
            raise MeshError(f"{name} is {count!r}; it must be a whole number from 1 to {MAX_CELLS}")
    if not 0.01 <= grading <= 100:
        raise MeshError(f"grading is {grading!r}; it must be a number from 0.01 to 100, and 1 is uniform")
    if full_circle:
        quarter = np.linspace(0, np.pi / 2, -(-phi_cells // 2) + 1)[:-1]
        half = np.linspace(np.pi / 2, 3 * np.pi / 2, phi_cells + 1)
        phi = np.concatenate([quarter, half, 2 * np.pi - quarter[::-1]])
    else:
        phi = np.linspace(np.pi / 2, 3 * np.pi / 2, phi_cells + 1)
    if not xi_min < 0 < xi_max:
        raise MeshError(NO_ZERO.format(xi_min, xi_max))
    middle = np.abs(np.linspace(-1, 1, 2 * xi_cells + 1)[1::2])
    sizes = grading ** ((middle - middle.min()) / max(np.ptp(middle), 1e-300))
    z = xi_min + (xi_max - xi_min) * np.concatenate([[0], np.cumsum(sizes)]) / np.sum(sizes)
    return CylinderMesh(phi, z, phi_degree, xi_degree)
