"""A system by its matrices: ẋ = (A + Σ ξ B) x."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import FloatArray, real_number
from fpsolve.model.expressions import Form, Monomial, OfTime, Series, evaluate
from fpsolve.model.faults import TableError, shown
from fpsolve.model.parameters import Table, stated_field
from fpsolve.model.plane import MOST_VARIABLES
from fpsolve.model.systems.equations import EquationSystem, Place, Read, Texts, placed, walls_of

Entry = float | str
Matrix = Sequence[Sequence[Entry]]
NoiseMatrix = Matrix | Mapping[str, Matrix]
Rows = tuple[tuple[Entry, ...], ...]
Driver = tuple[str, int]
"""A noise or a wave, "" for none, and a power of ε."""
_Row = Annotated[tuple[Entry, ...], Field(strict=False, min_length=1, max_length=MOST_VARIABLES)]
_Rows = Annotated[tuple[_Row, ...], Field(strict=False, min_length=1, max_length=MOST_VARIABLES)]
Stated = Annotated[_Rows, BeforeValidator(lambda rows: rows, json_schema_input_type=_Rows | str)]
"""Rows; a case file may have the name of a file in their place."""
OF_FILES = "numbers or expressions in the parameters; or a .npy, .mtx, .csv or .mat file"


@dataclass(frozen=True)
class MatrixSystem(EquationSystem):
    """Variables by the matrices of their rates, constant and with the noise. See `MatrixSystem.of`.

    Args:
        matrices: each with its place in a case file and the noise that multiplies it, "" for none.
    """

    drift: tuple[str, ...] = field(default=(), init=False, repr=False)
    matrices: tuple[tuple[Place, str, Rows], ...] = ()

    kind: ClassVar[str] = "linear"
    source: ClassVar[str] = "matrix"
    listed: ClassVar[str] = "variables"
    """The key of the names that rows of matrices have, which begin with x where none are given."""
    letter: ClassVar[str] = "x"
    most: ClassVar[int] = MOST_VARIABLES
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "matrix": stated_field(Stated, f"A, a row for each variable, {OF_FILES}", 'matrix = [[0, 1.0], ["-k", -0.2]]'),
        "noise_matrices": stated_field(
            Stated | dict[str, Stated],
            "B, which the noise multiplies; of several noises a table of matrices by their names",
            "noise_matrices = [[0, 0], [-1.0, 0]]",
            (),
        ),
        "variables": stated_field(Texts, "the names of the variables", 'variables = ["x", "v"]', ()),
        **{key: EquationSystem.stated[key] for key in ("parameters", "noises")},
    }
    with_noise: ClassVar[Sequence[str]] = ("noise_matrices",)
    """The keys of the matrices that a noise multiplies."""

    @classmethod
    def of(
        cls,
        matrix: Matrix,
        noise_matrices: NoiseMatrix = (),
        *,
        variables: Sequence[str] = (),
        parameters: Mapping[str, float] | None = None,
        noises: Mapping[str, str] | None = None,
    ) -> Self:
        """ẋ = (A + Σ ξ B) x, with exact derivatives by each of its parameters.

        >>> noise = [[0, 0], [-1, 0]]
        >>> MatrixSystem.of([[0, 1], ["-k", -0.2]], noise, parameters={"k": 4.0}).terms[0].matrix
        ((0.0, 1.0), (-4.0, -0.2))

        Args:
            matrix: A.
            noise_matrices: B; of several noises a mapping from their names in `noises`.
            variables: the names of x; ("x1", "x2", …) if empty.
            parameters: values by the names that entries of matrices may have, which are numbers, or arithmetic as in
                the rates of `PlaneSystem.of_equations`.
            noises: what noises are called, and which section of keys each has; {"xi": "noise"} if None.

        Raises:
            TableError: with the matrix, the place in it, and what it must be.
        """
        return cls._made({"matrix": matrix, "noise_matrices": noise_matrices}, variables, parameters, noises)

    @classmethod
    def _made(
        cls,
        given: Mapping[str, NoiseMatrix],
        listed: Sequence[str],
        parameters: Mapping[str, float] | None,
        noises: Mapping[str, str] | None,
        walls: Sequence[Mapping[str, float | str]] = (),
    ) -> Self:
        matrices, named, count = list[tuple[Place, str, Rows]](), noises or {"xi": "noise"}, 0
        for key, each in given.items():
            for place, noise, matrix in cls._by_noise(key, each, named):
                stated = np.array(matrix, dtype=object)
                count = count or (*stated.shape, 0)[0]
                if stated.shape != (count, count) or not 1 <= count <= cls.most:
                    rows = f"{count} rows, as {matrices[0][0][0]} has" if matrices else f"1 to {cls.most} rows"
                    must = f"must be a square matrix of {rows}, one for each of the {cls.listed}"
                    raise TableError(f"got {shown(matrix)}; {must}", *place)
                entries = [_entry(each, (*place, *at)) for at, each in np.ndenumerate(stated)]
                matrices.append((place, noise, tuple(zip(*count * [iter(entries)], strict=True))))
        listed = listed or [f"{cls.letter}{k + 1}" for k in range(count)]
        if len(listed) != count:
            raise TableError(f"got {len(listed)} names of {count} {cls.listed}; must be one for each", cls.listed)
        return cls(
            cls._variables(listed),
            tuple((parameters or {}).items()),
            tuple(named.items()),
            walls_of(walls),
            matrices=tuple(matrices),
        )

    @classmethod
    def from_table(cls, table: Table) -> Self:
        named, quantities = cls.named_of(table)
        given = {key: each for key, each in table.items() if key in cls.stated and key != "walls"}
        system = cls.of(**{**given, "parameters": dict(named)})
        return replace(system, walls=table.get("walls", ()), quantities=quantities)

    def __post_init__(self) -> None:
        self._refuse_faults()

    @classmethod
    def _variables(cls, listed: Sequence[str]) -> tuple[str, ...]:
        """The names of the variables from those of the rows."""
        return tuple(listed)

    def _texts(self) -> Iterator[tuple[str, Place]]:
        for place, _, rows in self.matrices:
            for (i, j), entry in np.ndenumerate(np.array(rows, dtype=object)):
                if isinstance(entry, str):
                    yield entry, (*place, i, j)

    def _unused(self, name: str, section: str) -> str:
        is_used = any(noise == name and any(map(any, rows)) for _, noise, rows in self.matrices)
        return "" if is_used else f"{name} is in no matrix; write {' or '.join(self.with_noise)}"

    def _read_by(self, by: str) -> Read:
        read, sums = Read(linear={*self._used}), zeros(*2 * (len(self.variables),))
        for _, driver, matrix in self._parts(by, read, self.matrices):
            sums[driver] += matrix
        read.rates = self._forms(sums)
        return read

    def _parts(
        self, by: str, read: Read, matrices: Iterable[tuple[Place, str, Rows]]
    ) -> Iterator[tuple[Place, Driver, FloatArray]]:
        """Matrices with their derivatives by a parameter, by what drives them. Raises `TableError`."""
        for place, noise, rows in matrices:
            found = series_of(place, rows, self._names(by), partial(self._of_time, read, by))
            for (wave, power), matrix in found.items():
                if noise and wave:
                    raise TableError(f"has {wave}t; a noise may only be multiplied by numbers and parameters", *place)
                yield place, (noise or wave, power), matrix

    def _forms(self, sums: Mapping[Driver, FloatArray]) -> list[Form]:
        """The rates of rows, and their derivatives, from matrices of these."""
        rows = defaultdict[int, dict[Monomial, Series]](dict)
        for (noise, power), pair in sums.items():
            for i, j in np.ndindex(pair.shape[1:]):
                rows[i][(self.variables[j],), noise, power] = tuple(pair[:, i, j].tolist())
        return [*map(Form, rows.values())]

    @classmethod
    def _by_noise(cls, key: str, given: object, noises: Mapping[str, str]) -> Iterator[tuple[Place, str, object]]:
        """The matrices of a key, each with its place and its noise, "" for none. Raises `TableError`."""
        is_given = np.array(given, dtype=object).size or cls.stated[key].is_required()
        if is_given and key not in cls.with_noise:
            yield (key,), "", given
        elif isinstance(given, Mapping):
            for name, matrix in given.items():
                if name not in noises:
                    raise TableError(f"is none of the noises, which are {', '.join(noises)}; rename it", key, name)
                yield (key, name), name, matrix
        elif is_given and len(noises) > 1:
            names = " and ".join(noises)
            raise TableError(f"is one matrix for the noises {names}; write a table with one for each", key)
        elif is_given:
            yield from (((key,), name, given) for name in noises)


def zeros(*shape: int) -> defaultdict[Driver, FloatArray]:
    """By what drives it a matrix and its derivative, at first 0."""
    return defaultdict(lambda: np.zeros((2, *shape)))


def series_of(
    place: Place, rows: Rows, names: Mapping[str, Form], of_time: OfTime | None = None
) -> Mapping[Driver, FloatArray]:
    """A matrix and its derivative by the waves and the powers of ε that multiply them. Raises `TableError`."""
    found = zeros(len(rows), len(rows))
    for (i, j), entry in np.ndenumerate(np.array(rows, dtype=object)):
        if isinstance(entry, str):
            with placed(*place, i, j):
                for (_, wave, power), series in evaluate(entry, names, "the entry", of_time).parts.items():
                    found[wave, power][:, i, j] = series
        elif entry:
            found["", 0][0, i, j] = entry
    return found


def _entry(given: object, place: Place) -> Entry:
    """An entry of a matrix. Raises `TableError`."""
    if isinstance(given, str):
        return given
    try:
        return real_number(given, "it")
    except ValueError:
        must = "must be a number, or an expression in the parameters"
        raise TableError(f"got {shown(given)}; {must}; write, for example, 1.0", *place) from None
