"""Pictures of eigenfunctions from their files for ParaView: `python -m fpsolve.output.pictures A.vtu A.png …`.

It is run as a process of its own, as rendering where there is no OpenGL ends in a crash.
"""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path

import numpy as np

from fpsolve.model.quantity import NOISE, PHASE, UNNAMED
from fpsolve.output.surfaces import Surface, flat_picture, picture_in_space

FURTHEST = 4.0
"""Standard deviations of the noise up to which T is shown; beyond, where next to no path is, it only grows."""
COLOURS = "viridis"


def surface_from(path: Path) -> Surface:
    """T of a file, on the nodes of the elements."""
    import pyvista

    grid = pyvista.read(path)
    phi, xi = np.asarray(grid.points)[:, :2].T
    count = int(np.argmax(phi != phi[0])) or phi.size
    rows = (-1, count)
    z, facts = np.asarray(grid.point_data["z"]).reshape(rows)[0], grid.field_data
    along, y = bytes(facts["along_y"]).decode(), xi.reshape(rows)[0]
    is_lines = not along.startswith("noise xi")  # y is the number of a state, each a strip on which T is constant
    if is_lines:
        numbers, near = np.unique(np.round(y), return_index=True)
        stated = [float(each) for each in re.findall(r"xi = (\S+?)(?:;|$)", along)]
        y = y.copy()
        y[near] = stated if len(stated) == numbers.size else numbers
    else:
        near = np.flatnonzero(np.abs(z) <= FURTHEST)
        near = near if near.size > 1 else np.arange(z.size)
    impacts = [each for each in np.asarray(facts["impacts"]).tolist() if not math.isnan(each)]
    about = {"phi": PHASE.attributes, "xi": {**NOISE.attributes, "units": "1"}}
    about["values"] = {**UNNAMED.attributes, "long_name": "eigenfunction", "symbol": "$T$", "units": "1"}
    return Surface(
        phi=phi.reshape(rows)[:, :1].T,
        xi=y[near],
        values=np.asarray(grid.point_data["T"]).reshape(rows)[:, near],
        about=about,
        name="T",
        title=f"p = {float(facts['p'][0]):g}, Λ(p) = {float(facts['Lambda'][0]):.6g}",
        lines=bytes(facts["held"]).decode().splitlines() if "held" in facts else (),
        impacts=[each % (2 * math.pi) for each in impacts],
        is_lines=is_lines,
    )


def main(paths: list[str]) -> int:
    """Draw each file."""
    for source, target in zip(paths[::2], paths[1::2], strict=True):
        surface = surface_from(Path(source))
        if surface.is_lines:
            flat_picture(surface, COLOURS).save(target)
        else:
            picture_in_space(surface, COLOURS, cylinder=False).save(target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
