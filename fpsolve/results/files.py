"""The files of what no record holds, by the names of questions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fpsolve.case.case import Curve
from fpsolve.case.sections import EIGENFUNCTIONS
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.results.directions import write_directions
from fpsolve.results.eigenfunctions import write_pictures

FILES: Mapping[str, Callable[[Any, Curve, Path], None]] = {
    EIGENFUNCTIONS: write_pictures,
    DIRECTIONS.part: write_directions,
}
"""Each writes what was found of a curve into a folder."""
