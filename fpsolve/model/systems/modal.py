"""Modes by their matrices: M q̈ + (C + G + ξ C_ξ) q̇ + (K + H + ξ K_ξ) q = 0."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import ROUNDED, FloatArray, real_number, shown
from fpsolve.model.expressions import Form, Monomial, OfTime, Series, evaluate, names_in, product
from fpsolve.model.faults import TableError
from fpsolve.model.parameters import Table, stated_field
from fpsolve.model.plane import MOST_VARIABLES
from fpsolve.model.systems.equations import EPSILON, EquationSystem, Place, Read, placed, walls_of

Entry = float | str
Matrix = Sequence[Sequence[Entry]]
NoiseMatrix = Matrix | Mapping[str, Matrix]
Rows = tuple[tuple[Entry, ...], ...]
MOST_MODES = MOST_VARIABLES // 2
"""Largest number of modes."""
_Row = Annotated[tuple[Entry, ...], Field(strict=False, min_length=1, max_length=MOST_MODES)]
_Rows = Annotated[tuple[_Row, ...], Field(strict=False, min_length=1, max_length=MOST_MODES)]
_Stated = Annotated[_Rows, BeforeValidator(lambda rows: rows, json_schema_input_type=_Rows | str)]
"""Rows; a case file may have the name of a file in their place."""
SINGULAR = 1e12
"""Condition of a mass matrix, its rows and columns of the size 1, from which on it counts as singular."""
SMALLEST = 1e-300
"""Size of the smallest mass that has an inverse."""
OF_SPEEDS = "damping", "gyroscopic", "damping_noise"
"""The matrices that multiply q̇."""
SKEW = {"gyroscopic": "damping", "circulatory": "stiffness"}
"""The matrices that are skew-symmetric, and where what is not belongs."""


@dataclass(frozen=True)
class ModalSystem(EquationSystem):
    """Modes by their mass, damping and stiffness; noise in stiffness and damping. See `ModalSystem.of`.

    It is an `EquationSystem` of the variables q and q̇ of each mode, whose rates follow from the matrices.

    Args:
        matrices: each with its place in a case file and the noise that multiplies it, "" for none; M is the first.
    """

    drift: tuple[str, ...] = field(default=(), init=False, repr=False)
    matrices: tuple[tuple[Place, str, Rows], ...] = ()

    kind: ClassVar[str] = "modes"
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "mass": stated_field(
            _Stated,
            "M, a row for each mode, numbers or expressions in the parameters; or a .npy, .mtx or .csv file",
            "mass = [[1.0]]",
        ),
        "stiffness": stated_field(_Stated, "K", 'stiffness = [["omega**2"]]'),
        "damping": stated_field(_Stated, "C", 'damping = [["2*zeta*omega"]]', ()),
        "gyroscopic": stated_field(_Stated, "G, skew-symmetric, added to C", "gyroscopic = [[0, -1.0], [1.0, 0]]", ()),
        "circulatory": stated_field(
            _Stated, "H, skew-symmetric, added to K", "circulatory = [[0, 0.2], [-0.2, 0]]", ()
        ),
        **{
            f"{part}_noise": stated_field(
                _Stated | dict[str, _Stated],
                f"what the noise multiplies in the {part}; of several noises a table of matrices by their names",
                f"{part}_noise = [[1.0]]",
                (),
            )
            for part in ("stiffness", "damping")
        },
        "modes": stated_field(
            Annotated[tuple[str, ...], Field(strict=False, min_length=1, max_length=MOST_MODES)],
            "the names of the modes",
            'modes = ["heave", "pitch"]',
            (),
        ),
        **{key: EquationSystem.stated[key] for key in ("parameters", "noises", "walls")},
    }

    @classmethod
    def of(
        cls,
        mass: Matrix,
        stiffness: Matrix,
        damping: Matrix = (),
        *,
        gyroscopic: Matrix = (),
        circulatory: Matrix = (),
        stiffness_noise: NoiseMatrix = (),
        damping_noise: NoiseMatrix = (),
        modes: Sequence[str] = (),
        parameters: Mapping[str, float] | None = None,
        noises: Mapping[str, str] | None = None,
        walls: Sequence[Mapping[str, float | str]] = (),
    ) -> ModalSystem:
        """M q̈ + (C + G + ξ C_ξ) q̇ + (K + H + ξ K_ξ) q = 0, with exact derivatives by each of its parameters.

        >>> damping, noise = [["4*zeta - 0.1*U"]], [["-0.1*U"]]  # a galloping mode: wind U takes from its damping
        >>> values = {"zeta": 0.05, "U": 1.0}
        >>> ModalSystem.of([[2.0]], [[2.0]], damping, damping_noise=noise, parameters=values).terms[0].matrix
        ((0.0, 1.0), (-1.0, -0.05))

        Args:
            mass: M, with an inverse.
            stiffness, damping: K and C.
            gyroscopic, circulatory: G and H, skew-symmetric.
            stiffness_noise, damping_noise: K_ξ and C_ξ; of several noises mappings from their names in `noises`.
            modes: the names of q; ("q1", "q2", …) if empty. The name of q̇ is that of q with _dot.
            parameters: values by the names that entries of matrices may have, which are numbers, or arithmetic as in
                the rates of `PlaneSystem.of_equations`.
            noises: what noises are called, and which section of keys each has; {"xi": "noise"} if None.
            walls: where a displacement, or a sum c·q of several, is stopped, one: v⁺ = v − (1 + R) M⁻¹c (c·v)/(c·M⁻¹c)
                at {"at": "q1 - q2 = 0", "restitution": R}.

        Raises:
            TableError: with the matrix, the place in it, and what it must be.
        """
        given: dict[str, NoiseMatrix] = {"mass": mass, "stiffness": stiffness, "damping": damping}
        given |= {"gyroscopic": gyroscopic, "circulatory": circulatory}
        given |= {"stiffness_noise": stiffness_noise, "damping_noise": damping_noise}
        matrices, named, count = list[tuple[Place, str, Rows]](), noises or {"xi": "noise"}, 0
        for key, each in given.items():
            for place, noise, matrix in _by_noise(key, _listed(each), named):
                count = count or _count(matrix)
                matrices.append((place, noise, _rows(matrix, count, place)))
        modes = modes or [f"q{k + 1}" for k in range(count)]
        if len(modes) != count:
            raise TableError(f"got {len(modes)} names of {count} modes; must be one for each", "modes")
        return cls(
            tuple(each for name in modes for each in (name, f"{name}_dot")),
            tuple((parameters or {}).items()),
            tuple(named.items()),
            walls_of(walls),
            matrices=tuple(matrices),
        )

    @classmethod
    def from_table(cls, table: Table) -> ModalSystem:
        named, quantities = cls.named_of(table, cls.stated)
        given = {key: each for key, each in table.items() if key in cls.stated and key != "walls"}
        system = cls.of(**{**given, "parameters": dict(named)})
        return replace(system, walls=table.get("walls", ()), quantities=quantities)

    def __post_init__(self) -> None:
        self._refuse_faults()

    def _given_names(self) -> Iterator[tuple[object, Place]]:
        yield from ((name, ("modes",) if path[0] == "variables" else path) for name, path in super()._given_names())

    def _texts(self) -> Iterator[tuple[str, Place]]:
        for place, _, rows in self.matrices:
            for (i, j), entry in np.ndenumerate(np.array(rows, dtype=object)):
                if isinstance(entry, str):
                    yield entry, (*place, i, j)

    def _unused(self, name: str, section: str) -> str:
        is_used = any(noise == name and any(map(any, rows)) for _, noise, rows in self.matrices)
        return "" if is_used else f"{name} is in no matrix; write stiffness_noise or damping_noise"

    def _read_by(self, by: str) -> Read:
        (mobility, change), n, read = self._mobility(by), len(self.variables) // 2, Read(linear={*self._used})
        forces, of_time = _zeros(n, 2 * n), partial(self._of_time, read, by)
        for place, noise, rows in self.matrices[1:]:
            for (wave, power), matrix in _series(place, rows, self._names(by), of_time).items():
                if noise and wave:
                    raise TableError(f"has {wave}t; a noise may only be multiplied by numbers and parameters", *place)
                off = np.abs(matrix[0] + matrix[0].T) > ROUNDED * np.max(np.abs(matrix[0]))
                if place[0] in SKEW and off.any():
                    must = "must be skew-symmetric, each entry minus the one across the diagonal"
                    raise TableError(
                        f"got {shown(matrix[0].tolist())}; {must}; write the rest into {SKEW[place[0]]}", *place
                    )
                forces[noise or wave, power][:, :, int(place[0] in OF_SPEEDS) :: 2] += matrix
        found = [dict[Monomial, Series]() for _ in range(n)]
        for (noise, power), (force, slope) in forces.items():
            rates, slopes = -mobility @ force, -(change @ force + mobility @ slope)
            for parts, *pairs in zip(found, rates.tolist(), slopes.tolist(), strict=True):
                for name, *pair in zip(self.variables, *pairs, strict=True):
                    parts[(name,), noise, power] = tuple(pair)
        speeds = map(product, self.variables[1::2])
        read.rates.extend(each for pair in zip(speeds, map(Form, found), strict=True) for each in pair)
        return read

    def _mobility(self, by: str = "") -> FloatArray:
        """M⁻¹, by which modes share an impact, and its derivative by a parameter. Raises `TableError`."""
        place, _, rows = self.matrices[0]
        names = self._values(by)
        names.pop(EPSILON, None)
        mass, slope = _series(place, rows, names)["", 0]
        scaled = mass / np.maximum(np.max(np.abs(mass), axis=1, keepdims=True), SMALLEST)
        scaled = scaled / np.maximum(np.max(np.abs(scaled), axis=0), SMALLEST)  # whatever the units of the modes
        if not (np.linalg.cond(scaled) < SINGULAR and np.all(np.max(np.abs(mass), axis=1) > SMALLEST)):
            must = f"must have an inverse, and an entry beyond ±{SMALLEST:g} in each row"
            raise TableError(f"got {shown(mass.tolist())}; {must}; change its entries", *place)
        inverse = np.linalg.inv(mass)
        return np.array([inverse, -inverse @ slope @ inverse])

    def _wall_coordinates(self) -> FloatArray:
        """The displacement of the wall and its rate, then those of the other modes, M-orthogonal to it."""
        row = self._wall_row()
        shares = self._mobility()[0] @ row
        first = int(np.argmax(np.abs(row * shares)))
        if not row @ shares > np.abs(row) @ np.abs(shares) / SINGULAR:
            text = (
                f"got masses by which an impact there moves {self.walls[0].at} by {row @ shares:g} of its force; must"
            )
            raise TableError(f"{text} be > 0, as of a positive definite matrix; change mass", "walls", 0, "at")
        others = np.delete(np.eye(len(row)) - np.outer(shares / shares[first], np.eye(len(row))[first]), first, axis=0)
        return np.asarray(np.kron(np.vstack([row, others]), np.eye(2)))

    def _place(self) -> tuple[int, int, float]:
        """That of the wall of one mode."""
        self._wall_row()
        return 0, 1, 1.0

    def _moves_wall(self, name: str) -> bool:
        """M⁻¹c changes in its direction, or c does."""
        (mobility, change), row = self._mobility(name), self._wall_row()
        shares, slopes = mobility @ row, change @ row
        off = np.abs(np.outer(shares, slopes) - np.outer(slopes, shares))
        is_turned = bool(np.any(off > ROUNDED * np.max(np.abs(shares)) * np.max(np.abs(slopes))))
        return is_turned or name in names_in(str(self.walls[0].at).partition("=")[0])

    def _wall_row(self) -> FloatArray:
        """The displacement of the wall, a row of those of the modes. Raises `TableError`."""
        modes, at = self.variables[::2], str(self.walls[0].at)
        text, _, zero = at.partition("=")
        with placed("walls", 0, "at"):
            parts = evaluate(text, self._values() | {name: product(name) for name in modes}, "at").parts
        found = {states: series[0] for (states, _, _), series in parts.items()}
        row = np.array([found.pop((name,), 0.0) for name in modes])
        if found or not row.any() or zero.strip().rstrip("0") not in ("", "0.") or "=" not in at:
            must = f'must be a displacement or a sum of several, such as "{modes[0]} - 0.5*{modes[-1]} = 0"'
            raise TableError(f"got {shown(at)}; {must}; the modes are {', '.join(modes)}", "walls", 0, "at")
        return row


def _zeros(*shape: int) -> defaultdict[tuple[str, int], FloatArray]:
    """By a noise or a wave and a power of ε a matrix and its derivative, at first 0."""
    return defaultdict(lambda: np.zeros((2, *shape)))


def _series(
    place: Place, rows: Rows, names: Mapping[str, Form], of_time: OfTime | None = None
) -> Mapping[tuple[str, int], FloatArray]:
    """A matrix and its derivative by the waves and the powers of ε that multiply them. Raises `TableError`."""
    found = _zeros(len(rows), len(rows))
    for (i, j), entry in np.ndenumerate(np.array(rows, dtype=object)):
        if isinstance(entry, str):
            with placed(*place, i, j):
                for (_, wave, power), series in evaluate(entry, names, "the entry", of_time).parts.items():
                    found[wave, power][:, i, j] = series
        elif entry:
            found["", 0][0, i, j] = entry
    return found


def _by_noise(key: str, given: object, noises: Mapping[str, str]) -> Iterator[tuple[Place, str, object]]:
    """The matrices of a key, each with its place and its noise, "" for none. Raises `TableError`."""
    if not key.endswith("_noise"):
        if given or key in ("mass", "stiffness") or not isinstance(given, list | tuple):
            yield (key,), "", given
    elif isinstance(given, Mapping):
        for name, matrix in given.items():
            if name not in noises:
                raise TableError(f"is none of the noises, which are {', '.join(noises)}; rename it", key, name)
            yield (key, name), name, matrix
    elif given and len(noises) > 1:
        names = " and ".join(noises)
        raise TableError(f"is one matrix for the noises {names}; write a table with one for each", key)
    elif given:
        yield from (((key,), name, given) for name in noises)


def _count(mass: object) -> int:
    """The number of modes. Raises `TableError`."""
    if not isinstance(mass, list | tuple) or not 1 <= len(mass) <= MOST_MODES:
        must = f"must be a matrix of 1 to {MOST_MODES} rows, one for each mode"
        raise TableError(f"got {shown(mass)}; {must}", "mass")
    return len(mass)


def _rows(matrix: object, count: int, place: Place) -> Rows:
    """The rows of a matrix, numbers and texts. Raises `TableError`."""
    stated = np.array(matrix, dtype=object)
    if stated.shape != (count, count):
        size = f"{count} row{'s' * (count > 1)} of {count}, as mass is"
        raise TableError(f"got {shown(matrix)}; must be {size}", *place)
    return tuple(tuple(_entry(each, (*place, i, j)) for j, each in enumerate(row)) for i, row in enumerate(stated))


def _entry(given: object, place: Place) -> Entry:
    """An entry of a matrix. Raises `TableError`."""
    if isinstance(given, str):
        return given
    try:
        return real_number(given, "it")
    except ValueError:
        must = "must be a number, or an expression in the parameters"
        raise TableError(f"got {shown(given)}; {must}; write, for example, 1.0", *place) from None


def _listed(given: object) -> object:
    """Arrays of NumPy as lists."""
    if isinstance(given, Mapping):
        return {key: _listed(each) for key, each in given.items()}
    if isinstance(given, np.ndarray | np.generic):
        return given.tolist()
    return type(given)(map(_listed, given)) if isinstance(given, list | tuple) else given
