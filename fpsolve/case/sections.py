"""The sections of a case file, each with the rules that it can check by itself.

What keys of the system, the noise and the budget mean stands where these do; the others stand here.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_left
from collections.abc import Container, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from fpsolve.arrays import FloatArray
from fpsolve.case.messages import LIST, TABLE, Refusal, refuse
from fpsolve.errors import MeshError
from fpsolve.exponent.quantities import QuantityName
from fpsolve.fem.mesh import MAX_CELLS, MAX_DEGREE, CylinderMesh, make_mesh, read_mesh, vertices_at
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.simulation.setup import BATCHES, MAX_PATHS, PATHS, Estimator

MAX_MOMENTS = 100_000
_DIGITS = 12
_SAME = 10.0**-_DIGITS
"""p that differ by no more are one p; values of a varied key, relative to their size."""

Values = tuple[float, ...]
Value = float | str
Varied = Mapping[str, Value]
"""The values of the varied keys on one curve."""
NonEmpty = Annotated[Values, Field(strict=False, min_length=1, max_length=MAX_MOMENTS)]
Text = Annotated[str, Field(min_length=1)]
Cells = Annotated[int | None, Field(ge=1, le=MAX_CELLS)]
Degree = Annotated[int | None, Field(ge=1, le=MAX_DEGREE)]


def flat(value: Any, whole: Container[str] = ()) -> Any:
    """Nested tables as one: noise.D0 = 1.0 means the same as "noise.D0" = 1.0.

    Args:
        value: a table; anything else is left.
        whole: the keys whose tables are values, not sections.
    """
    if not isinstance(value, dict):
        return value
    result: dict[str, Any] = {}
    for key, item in _entries(value, "", whole):
        if key in result:
            raise ValueError(f"{key} stands twice, once with quotes and once without; remove one of them")
        result[key] = item
    return result


def _entries(table: Mapping[str, Any], section: str, whole: Container[str]) -> Iterator[tuple[str, Any]]:
    """The dotted keys of a table and of those in it; a range is a value."""
    for name, item in table.items():
        key = section + name
        is_section = isinstance(item, dict) and item and key not in whole and not item.keys() & RANGE
        yield from _entries(item, f"{key}.", whole) if is_section else [(key, item)]


class Section(BaseModel):
    """A table of a case file: immutable, no unknown keys, no conversions, finite numbers only."""

    model_config = STRICT | ConfigDict(frozen=True)


class Sweep(Section):
    """{ start, stop, num, scale }: numbers a constant step or a constant factor apart, both ends included."""

    start: Annotated[float, parameter("the first value", "start = 1.0")]
    stop: Annotated[float, parameter("the last value", "stop = 6.0")]
    num: Annotated[int, parameter("how many values", "num = 33", ge=2, le=MAX_MOMENTS)]
    scale: Annotated[Literal["linear", "log"], parameter("how they are spread", 'scale = "log"')] = "linear"

    @model_validator(mode="after")
    def _increases(self) -> Self:
        if not 0 < self.stop - self.start < math.inf:
            raise ValueError(
                f"got start = {self.start}, stop = {self.stop}; must be start < stop, a finite way apart; "
                "exchange the two, or list a single value as in [2.0]"
            )
        if self.scale == "log" and self.start <= 0:
            text = f'got {self.start}; must be > 0 where scale = "log"; use a positive start, or scale = "linear"'
            refuse([(("start",), self.start, text)])
        return self

    @property
    def values(self) -> FloatArray:
        """The numbers, those between the ends without the rounding errors of the division, and 0 without a sign."""
        if self.scale == "log":
            inner = [float(f"{value:.{_DIGITS}g}") for value in np.geomspace(self.start, self.stop, self.num)[1:-1]]
        else:
            size = max(abs(self.start), abs(self.stop))
            decimals = max(_DIGITS, _DIGITS - 1 - math.floor(math.log10(size)))
            inner = [round(value, decimals) for value in np.linspace(self.start, self.stop, self.num)[1:-1].tolist()]
        return np.array([self.start, *inner, self.stop]) + 0.0


RANGE = frozenset(Sweep.__pydantic_fields__)
"""The keys that tell a range from a section."""


def _list_or_table(value: Any) -> str | None:
    return LIST if isinstance(value, list | tuple) else TABLE if isinstance(value, dict | Sweep) else None


class Moments(Section):
    """[moments]: the orders p, and the relative error wanted of Λ(p)."""

    p: Annotated[
        Annotated[NonEmpty, Tag(LIST)] | Annotated[Sweep, Tag(TABLE)],
        Discriminator(_list_or_table),
        parameter(
            "orders of the moments",
            "p = [1.0, 2.0] or p = { start = -2.0, stop = 6.0, num = 33 }",
            "$p$",
            name="order of the moment",
        ),
    ]
    rtol: Annotated[float, parameter("wanted relative error", "rtol = 1e-8", gt=1e-13, lt=1)] = 1e-8

    @property
    def values(self) -> FloatArray:
        """All p, in the file's order."""
        if isinstance(self.p, Sweep):
            return self.p.values
        return np.array(self.p)

    @cached_property
    def increasing(self) -> tuple[float, ...]:
        """All p, sorted."""
        return tuple(np.sort(self.values).tolist())

    def has(self, p: float) -> bool:
        """Whether p is one of them."""
        at = bisect_left(self.increasing, p)
        return any(abs(each - p) <= _SAME for each in self.increasing[max(at - 1, 0) : at + 1])

    @model_validator(mode="after")
    def _distinct(self) -> Self:
        values = np.array(self.increasing)
        with np.errstate(over="ignore"):
            close = values[1:][np.diff(values) <= _SAME]
        if close.size:
            text = f"{close[0]} stands twice; p must differ by more than {_SAME:g}; remove one of them"
            refuse([(("p",), self.p, text)])
        return self


class MeshSection(Section):
    """[mesh]: a mesh file, or some of the numbers that make one; ξ in noise units."""

    file: Annotated[
        str | None,
        parameter("a mesh file, by its path from the case file", 'file = "../meshes/default.vtu"', min_length=1),
    ] = None
    phi_cells: Annotated[Cells, parameter("cells around the phase", "phi_cells = 2")] = None
    phi_degree: Annotated[Degree, parameter("degree of the elements in the phase", "phi_degree = 10")] = None
    xi_cells: Annotated[Cells, parameter("cells along the noise", "xi_cells = 4")] = None
    xi_degree: Annotated[Degree, parameter("degree of the elements along the noise", "xi_degree = 9")] = None
    xi_min: Annotated[
        float | None, parameter("lower end of the noise, in standard deviations", "xi_min = -8.0", lt=0)
    ] = None
    xi_max: Annotated[
        float | None, parameter("upper end of the noise, in standard deviations", "xi_max = 8.0", gt=0)
    ] = None

    def mesh(self, folder: Path) -> CylinderMesh | None:
        """The mesh, its file sought from `folder`; None where nothing is stated."""
        if self.file is None:
            stated = self.model_dump(exclude_none=True)
            return make_mesh(**stated) if stated else None
        path = folder / self.file
        mesh = read_mesh(path)
        try:
            vertices_at(mesh.phi_lines, math.pi / 2)
        except MeshError as failure:
            raise MeshError(f"{path}: {failure}") from failure
        return mesh

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        numbers = ", ".join(self.model_dump(exclude_none=True, exclude={"file"}))
        if self.file is not None and numbers:
            text = f"a mesh must be either a file or made from numbers; remove file, or remove {numbers}"
            refuse([(("file",), self.file, text)])
        return self


class MonteCarloSection(Section):
    """[monte_carlo]: how the system is simulated; time and step are chosen where they are not stated."""

    paths: Annotated[int, parameter("how many paths", "paths = 32768", ge=BATCHES, le=MAX_PATHS)] = PATHS
    time: Annotated[float | None, parameter("length of the paths, in the units of 1/omega", "time = 400.0", gt=0)] = (
        None
    )
    step: Annotated[float | None, parameter("time step", "step = 0.05", gt=0)] = None
    seed: Annotated[int, parameter("seed of the random numbers", "seed = 0", ge=0)] = 0
    estimator: Annotated[Estimator, parameter("how moments are estimated", 'estimator = "population"')] = "direct"
    p: Annotated[NonEmpty | None, parameter("orders of the moments that are simulated", "p = [1.0, 2.0]")] = None


def _where(value: Any) -> Any:
    """The flat table of a `where`, every entry a finite number or a text."""
    table = flat(value)
    if isinstance(table, dict):
        refuse(((key,), item, "") for key, item in table.items() if not is_number(item) and not isinstance(item, str))
    return table


def is_number(value: Any) -> bool:
    """Whether a value of TOML is a finite number."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


class Expectation(Section):
    """[[expect]]: a value that the result must have, on the curves that `where` selects."""

    quantity: Annotated[QuantityName, parameter("what is checked", 'quantity = "moment"')]
    p: Annotated[float | None, parameter("order of the moment", "p = 2.0")] = None
    value: Annotated[float, parameter("the expected value", "value = 0.01416")]
    rtol: Annotated[float | None, parameter("relative tolerance", "rtol = 1e-3", gt=0)] = None
    atol: Annotated[float | None, parameter("absolute tolerance", "atol = 1e-6", gt=0)] = None
    source: Annotated[Text, parameter("where the value comes from", 'source = "Eq. (37), second order"')]
    where: Annotated[
        dict[str, Value],
        BeforeValidator(_where),
        parameter("which curves: some of the varied keys", 'where = { "noise.D0" = 1.0 }'),
    ] = Field(default_factory=dict)

    def selects(self, varied: Varied) -> bool:
        """Whether this is about the curve with these varied values; without `where`, about all curves."""
        return all(same(varied[key], value) for key, value in self.where.items())

    @model_validator(mode="after")
    def _complete(self) -> Self:
        refusals: list[Refusal] = []
        if self.quantity == "moment" and self.p is None:
            refusals.append((("p",), None, "missing; a moment needs its order; add, for example, p = 2.0"))
        if self.quantity != "moment" and self.p is not None:
            text = f"got {self.p}; {self.quantity} does not depend on p; remove p, or check the moment"
            refusals.append((("p",), self.p, text))
        if self.rtol is None and self.atol is None:
            refusals.append((("rtol",), None, "missing, and so is atol; add, for example, rtol = 1e-3"))
        refuse(refusals)
        return self


def same(value: Value, other: Value) -> bool:
    """Whether two values of a varied key are one."""
    if isinstance(value, str) or isinstance(other, str):
        return value == other
    return math.isclose(value, other, rel_tol=_SAME)
