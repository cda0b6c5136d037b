"""All parts, in the order of work: what needs another part stands after it."""

from __future__ import annotations

from fpsolve.parts import (
    directions,
    discretisation,
    eigenfunctions,
    excursions,
    indices,
    intervals,
    moments,
    rate_function,
    response,
    sensitivities,
)
from fpsolve.parts.part import Part

PARTS: tuple[Part, ...] = (
    moments.PART,
    rate_function.PART,
    *indices.PARTS,
    indices.THEORY,
    moments.CLASSES,
    excursions.PART,
    response.PART,
    sensitivities.PART,
    intervals.PART,
    eigenfunctions.PART,
    directions.PART,
    discretisation.PART,
)
"""Each is solved, said and written in this order."""
BY_NAME = {part.name: part for part in PARTS}
"""All parts by their names."""
