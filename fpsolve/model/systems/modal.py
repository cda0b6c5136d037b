"""Modes by their matrices: M q̈ + (C + G + ξ C_ξ) q̇ + (K + H + ξ K_ξ) q = 0."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import ROUNDED, FloatArray, shown
from fpsolve.model.expressions import ExpressionError, Form, calls_of_time, constant, evaluate, names_in
from fpsolve.model.faults import TableError
from fpsolve.model.parameters import stated_field
from fpsolve.model.plane import MOST_VARIABLES
from fpsolve.model.systems.equations import EPSILON, EquationSystem, walls_of

Entry = float | str
Matrix = Sequence[Sequence[Entry]]
NoiseMatrix = Matrix | Mapping[str, Matrix]
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


@dataclass(frozen=True)
class ModalSystem(EquationSystem):
    """Modes by their mass, damping and stiffness; noise in stiffness and damping. See `ModalSystem.of`.

    It is an `EquationSystem` of the variables q and q̇ of each mode, whose rates follow from the matrices.

    Args:
        mobility: M⁻¹, by which modes share an impact.
    """

    mobility: tuple[tuple[Entry, ...], ...] = ()

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
            mass: M, with an inverse; of more than two rows names may stand on its diagonal alone.
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
        still = {"mass": mass, "stiffness": stiffness, "damping": damping}
        still = _listed({**still, "gyroscopic": gyroscopic, "circulatory": circulatory})
        driven = _listed({"stiffness_noise": stiffness_noise, "damping_noise": damping_noise})
        named, sections = dict(parameters or {}), dict(noises or {"xi": "noise"})
        rates = _Rates(still, driven, tuple(modes), named, sections)
        variables, drift = rates.written()
        mobility = tuple(map(tuple, rates.mobility)) if walls else ()
        try:
            return cls(
                variables,
                drift,
                tuple(named.items()),
                tuple(sections.items()),
                walls_of(walls),
                mobility=mobility,
            )
        except TableError as error:
            if error.path[:1] == ("variables",):
                raise TableError(error.text, "modes") from None
            if error.path[:1] == ("drift",):
                raise TableError(f"with the other matrices: {error.text}", "stiffness") from None
            raise

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> ModalSystem:
        named, quantities = cls.named_of(table, cls.stated)
        given = {key: each for key, each in table.items() if key in cls.stated}
        walls = [each.model_dump() for each in table.get("walls", ())]
        return replace(cls.of(**{**given, "parameters": dict(named), "walls": walls}), quantities=quantities)

    def _wall_coordinates(self) -> FloatArray:
        """The displacement of the wall and its rate, then those of the other modes, M-orthogonal to it."""
        names = {name: constant(value) for name, value in self.named}
        mass = np.array([[_value(each, names) for each in row] for row in self.mobility])
        row = self._wall_row(names)
        shares = mass @ row
        first = int(np.argmax(np.abs(row * shares)))
        if not row @ shares > np.abs(row) @ np.abs(shares) / SINGULAR:
            text = (
                f"got masses by which an impact there moves {self.walls[0].at} by {row @ shares:g} of its force; must"
            )
            raise TableError(f"{text} be > 0, as of a positive definite matrix; change mass", "walls", 0, "at")
        others = np.delete(np.eye(len(row)) - np.outer(shares / shares[first], np.eye(len(row))[first]), first, axis=0)
        return np.asarray(np.kron(np.vstack([row, others]), np.eye(2)))

    def _wall_row(self, names: Mapping[str, Form]) -> FloatArray:
        """The displacement of the wall, a row of those of the modes. Raises `TableError`."""
        modes, at = self.variables[::2], str(self.walls[0].at)
        text, _, zero = at.partition("=")
        try:
            states = {name: Form({((name,), "", 0): (1.0,)}) for name in modes}
            parts = evaluate(text, {**names, **states}, "at").parts
        except ExpressionError as error:
            raise TableError(str(error), "walls", 0, "at") from None
        found = {states: series[0] for (states, _, _), series in parts.items()}
        row = np.array([found.pop((name,), 0.0) for name in modes])
        if found or not row.any() or zero.strip().rstrip("0") not in ("", "0.") or "=" not in at:
            must = f'must be a displacement or a sum of several, such as "{modes[0]} - 0.5*{modes[1]} = 0"'
            raise TableError(f"got {shown(at)}; {must}; the modes are {', '.join(modes)}", "walls", 0, "at")
        return row


@dataclass(frozen=True)
class _Rates:
    """The rates of q and q̇ as text.

    Args:
        matrices: without noise, by their keys.
        driven: what noises multiply.
        modes, parameters, noises: as in `ModalSystem.of`.
    """

    matrices: Mapping[str, Matrix]
    driven: Mapping[str, NoiseMatrix]
    modes: tuple[str, ...]
    parameters: Mapping[str, float]
    noises: Mapping[str, str]

    def written(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The names of q and q̇ of each mode in turn, and their rates. Raises `TableError`."""
        modes = self.modes or tuple(f"q{k + 1}" for k in self)
        if len(modes) != self.count:
            raise TableError(f"got {len(modes)} names of {self.count} modes; must be one for each", "modes")
        speeds = [f"{name}_dot" for name in modes]
        of = {"damping": speeds, "gyroscopic": speeds, "stiffness": modes, "circulatory": modes}
        of |= {"stiffness_noise": modes, "damping_noise": speeds}
        matrices = {key: self._entries(each, key) for key, each in self.matrices.items() if key != "mass"}
        for key in ("gyroscopic", "circulatory"):
            self._refuse_symmetric(matrices[key], key)
        inverse = self.mobility
        parts = [(matrix, of[key]) for key, matrix in matrices.items()]
        driven = [(noise, self._entries(matrix, *path), of[path[0]]) for noise, path, matrix in self._driven()]
        for name in self.noises:
            if all(noise != name or not any(map(any, matrix)) for noise, matrix, _ in driven):  # a name may be 0
                raise TableError(f"{name} is in no matrix; write stiffness_noise or damping_noise", "noises", name)
        parts += [(matrix, [f"{noise}*{state}" for state in states]) for noise, matrix, states in driven]
        forces = [[each for matrix, states in parts for each in zip(matrix[j], states, strict=True)] for j in self]
        drift = list[str]()
        for i, speed in enumerate(speeds):
            texts, numbers = list[str](), dict[str, float]()
            for factor, entry, state in ((inverse[i][j], *each) for j in self for each in forces[j]):
                if isinstance(factor, str) or isinstance(entry, str):
                    texts += [f"-{_product(factor, entry)}*{state}"] if factor != 0.0 and entry != 0.0 else []
                else:
                    numbers[state] = numbers.get(state, 0.0) - factor * entry
            texts += [f"+({number!r})*{state}" for state, number in numbers.items() if number]
            drift += [speed, " ".join(texts) or "0"]
        return tuple(name for pair in zip(modes, speeds, strict=True) for name in pair), tuple(drift)

    @cached_property
    def mobility(self) -> list[list[Entry]]:
        """M⁻¹. Raises `TableError`."""
        return self._inverse(self._entries(self.matrices["mass"], "mass"))

    @property
    def count(self) -> int:
        """The number of modes."""
        mass = self.matrices["mass"]
        if not isinstance(mass, list | tuple) or not 1 <= len(mass) <= MOST_MODES:
            must = f"must be a matrix of 1 to {MOST_MODES} rows, one for each mode"
            raise TableError(f"got {shown(mass)}; {must}", "mass")
        return len(mass)

    def __iter__(self) -> Iterator[int]:
        return iter(range(self.count))

    def _driven(self) -> Iterator[tuple[str, tuple[str, ...], Matrix]]:
        """What each noise multiplies: its name, where that stands, and the matrix. Raises `TableError`."""
        for key, given in self.driven.items():
            if isinstance(given, Mapping):
                for name, matrix in given.items():
                    if name not in self.noises:
                        known = ", ".join(self.noises)
                        raise TableError(f"is none of the noises, which are {known}; rename it", key, name)
                    yield name, (key, name), matrix
            elif given and len(self.noises) > 1:
                names = " and ".join(self.noises)
                raise TableError(f"is one matrix for the noises {names}; write a table with one for each", key)
            elif given:
                yield from ((name, (key,), given) for name in self.noises)

    def _entries(self, given: Matrix, *path: str) -> list[list[Entry]]:
        """The entries of a matrix, numbers where they are; zeros of none. Raises `TableError`."""
        if isinstance(given, list | tuple) and not given and path[0] not in ("mass", "stiffness"):
            return [[0.0 for _ in self] for _ in self]
        stated = given if isinstance(given, list | tuple) else ()
        rows = [list(row) if isinstance(row, list | tuple) else [] for row in stated]
        if [len(row) for row in rows] != [self.count for _ in self]:
            size = f"{self.count} row{'s' * (self.count > 1)} of {self.count}, as mass is"
            raise TableError(f"got {shown(given)}; must be {size}", *path)
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                is_number = isinstance(entry, int | float) and not isinstance(entry, bool)
                if not (is_number or isinstance(entry, str)):
                    must = "must be a number, or an expression in the parameters"
                    raise TableError(f"got {shown(entry)}; {must}; write, for example, 1.0", *path, i, j)
                try:
                    text = repr(float(entry)) if is_number else str(entry)
                    number = self._number(text, not is_number and path[0] != "mass")
                except ExpressionError as error:
                    raise TableError(str(error), *path, i, j) from None
                if path[0] == "mass" and isinstance(entry, str) and EPSILON in names_in(entry):
                    raise TableError(f"has {EPSILON}, which a mass may not contain; give it another name", *path, i, j)
                is_free = is_number or not names_in(str(entry))
                rows[i][j] = number[0] if is_free and number is not None else str(entry)
        return rows

    def _numbers(self, matrix: list[list[Entry]]) -> FloatArray:
        """The entries of a matrix at the values of the parameters."""
        values = [[self._number(e) if isinstance(e, str) else (e,) for e in row] for row in matrix]
        return np.array([[each[0] if each else 0.0 for each in row] for row in values])

    def _number(self, text: str, may_turn: bool = True) -> tuple[float, ...] | None:
        """The value of an entry, with 1 for cos(nu*t). Raises `ExpressionError`."""
        waves = dict.fromkeys(calls_of_time(text) if may_turn else (), constant(1.0))
        return evaluate(text, self._constants | waves, "the entry").scalar

    @cached_property
    def _constants(self) -> dict[str, Form]:
        return {name: constant(value) for name, value in self.parameters.items()}

    def _refuse_symmetric(self, matrix: list[list[Entry]], key: str) -> None:
        values = self._numbers(matrix)
        if np.max(np.abs(values + values.T)) > ROUNDED * np.max(np.abs(values)):
            other = "damping" if key == "gyroscopic" else "stiffness"
            must = "must be skew-symmetric, each entry minus the one across the diagonal"
            raise TableError(f"got {shown(values.tolist())}; {must}; write the rest into {other}", key)

    def _inverse(self, mass: list[list[Entry]]) -> list[list[Entry]]:
        """The inverse of the masses, as text where they have names."""
        values = self._numbers(mass)
        scaled = values / np.maximum(np.max(np.abs(values), axis=1, keepdims=True), SMALLEST)
        scaled = scaled / np.maximum(np.max(np.abs(scaled), axis=0), SMALLEST)  # whatever the units of the modes
        if not (np.linalg.cond(scaled) < SINGULAR and np.all(np.max(np.abs(values), axis=1) > SMALLEST)):
            must = f"must have an inverse, and an entry beyond ±{SMALLEST:g} in each row"
            raise TableError(f"got {shown(values.tolist())}; {must}; change its entries", "mass")
        if not any(isinstance(entry, str) for row in mass for entry in row):
            found: list[list[Entry]] = np.linalg.inv(values).tolist()
            return found
        if not any(entry != 0.0 for i, row in enumerate(mass) for j, entry in enumerate(row) if i != j):
            return [[f"1/({mass[i][i]})" if i == j else 0.0 for j in self] for i in self]
        if self.count > 2:
            must = "of more than two modes must be numbers, or have names on a diagonal and zeros beside it"
            raise TableError(f"got {shown(mass)}; {must}; write numbers", "mass")
        (a, b), (c, d) = mass
        det = f"(({a})*({d}) - ({b})*({c}))"
        minus = [[0.0 if each == 0.0 else f"-({each})/{det}" for each in row] for row in mass]
        return [[f"({d})/{det}", minus[0][1]], [minus[1][0], f"({a})/{det}"]]


def _value(entry: Entry, names: Mapping[str, Form]) -> float:
    """The number that an entry of a matrix is at the values of the parameters."""
    return (evaluate(entry, names, "the entry").scalar or (math.nan,))[0] if isinstance(entry, str) else entry


def _listed(given: Any) -> Any:
    """Arrays of NumPy as lists."""
    if isinstance(given, Mapping):
        return {key: _listed(each) for key, each in given.items()}
    if isinstance(given, np.ndarray | np.generic):
        return given.tolist()
    return type(given)(map(_listed, given)) if isinstance(given, list | tuple) else given


def _product(a: Entry, b: Entry) -> str:
    """a b in parentheses."""
    if not isinstance(a, str) and not isinstance(b, str):
        return f"({a * b!r})"
    return "*".join(f"({each})" for each in (a, b) if each != 1.0)
