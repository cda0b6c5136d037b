"""Pictures of the eigenfunctions that were written, and of the densities of directions."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from subprocess import DEVNULL, TimeoutExpired
from subprocess import run as run_child

from fpsolve.case.case import Case, Curve
from fpsolve.errors import FpsolveError
from fpsolve.output.directions import directions_file, draw_densities
from fpsolve.page.page import Drawing
from fpsolve.study.results import CurveResult

PATIENCE = 120.0
"""Seconds that pictures of eigenfunctions may take."""


def eigenfunctions_of(case: Case, curves: Sequence[Curve], folder: Path) -> dict[int, Drawing]:
    """The pictures at one p, by the numbers of the curves of which they were written."""
    shown = curves if case.shown.size and case.problem.dimension == 2 else ()
    name, place = f"p{case.usual_p + 0.0:+}.vtu", folder.resolve()
    files = [(each, place / f"eigenfunctions{each.suffix}" / name) for each in shown]
    there = [(curve, path) for curve, path in files if path.is_file()]
    rendered = lru_cache(1)(partial(_rendered, [path for _, path in there]))

    def draw(path: Path, into: Path) -> None:
        pictures, reason = rendered()
        if path not in pictures:
            raise FpsolveError(f"{reason}; show.py draws it in ParaView")
        into.write_bytes(pictures[path])

    title = f"Eigenfunction T(φ, ξ) of p = {case.usual_p:g}"
    return {each.number: Drawing(f"{title}{each.of}", partial(draw, path), "png") for each, path in there}


def _rendered(files: Sequence[Path]) -> tuple[dict[Path, bytes], str]:
    """All pictures by a process of its own, which may crash; and why some are missing."""
    reason = "nothing was drawn"
    with tempfile.TemporaryDirectory() as place:
        pictures = {path: Path(place) / f"{number}.png" for number, path in enumerate(files)}
        # with -P no file of the working folder is taken for a module
        command = [sys.executable or "python", "-P", "-m", "fpsolve.output.pictures"]
        command += [str(each) for pair in pictures.items() for each in pair]
        try:
            done = run_child(command, stdin=DEVNULL, capture_output=True, timeout=PATIENCE, check=False)
            reason = f"the process that draws it ended with {done.returncode}" if done.returncode else reason
        except (OSError, TimeoutExpired) as failure:
            reason = str(failure)
        return {path: picture.read_bytes() for path, picture in pictures.items() if picture.is_file()}, reason


def directions_of(case: Case, result: CurveResult, folder: Path) -> Iterator[Drawing]:
    """The densities of directions of a curve, where they were written."""
    if directions_file(result.curve, folder).is_file():
        what = "energy share and phase difference" if case.problem.dimension == 4 else "directions"
        yield Drawing(f"Densities of {what}{result.curve.of}", partial(draw_densities, case, [result], folder))
