"""Modes by their matrices: M q̈ + (C + G + ξ C_ξ) q̇ + (K + H + ξ K_ξ) q = 0."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import ROUNDED, FloatArray, shown
from fpsolve.model.expressions import evaluate, names_in, product
from fpsolve.model.faults import TableError
from fpsolve.model.parameters import stated_field
from fpsolve.model.plane import MOST_VARIABLES
from fpsolve.model.systems.equations import EPSILON, EquationSystem, Place, Read, placed
from fpsolve.model.systems.matrices import OF_FILES, Matrix, MatrixSystem, NoiseMatrix, Stated, series_of, zeros

MOST_MODES = MOST_VARIABLES // 2
"""Largest number of modes."""
SINGULAR = 1e12
"""Condition of a mass matrix, its rows and columns of the size 1, from which on it counts as singular."""
SMALLEST = 1e-300
"""Size of the smallest mass that has an inverse."""
OF_SPEEDS = "damping", "gyroscopic", "damping_noise"
"""The matrices that multiply q̇."""
SKEW = {"gyroscopic": "damping", "circulatory": "stiffness"}
"""The matrices that are skew-symmetric, and where what is not belongs."""


@dataclass(frozen=True)
class ModalSystem(MatrixSystem):
    """Modes by their mass, damping and stiffness; noise in stiffness and damping. See `ModalSystem.of`.

    Its variables are q and q̇ of each mode, whose rates follow from the matrices, of which M is the first.
    """

    kind: ClassVar[str] = "modes"
    source: ClassVar[str] = "stiffness"
    listed: ClassVar[str] = "modes"
    letter: ClassVar[str] = "q"
    most: ClassVar[int] = MOST_MODES
    with_noise: ClassVar[Sequence[str]] = ("stiffness_noise", "damping_noise")
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "mass": stated_field(Stated, f"M, a row for each mode, {OF_FILES}", "mass = [[1.0]]"),
        "stiffness": stated_field(Stated, "K", 'stiffness = [["omega**2"]]'),
        "damping": stated_field(Stated, "C", 'damping = [["2*zeta*omega"]]', ()),
        "gyroscopic": stated_field(Stated, "G, skew-symmetric, added to C", "gyroscopic = [[0, -1.0], [1.0, 0]]", ()),
        "circulatory": stated_field(Stated, "H, skew-symmetric, added to K", "circulatory = [[0, 0.2], [-0.2, 0]]", ()),
        **{
            f"{part}_noise": stated_field(
                Stated | dict[str, Stated],
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
    def of(  # type: ignore[override]  # of other matrices
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
    ) -> Self:
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
        return cls._made(given, modes, parameters, noises, walls)

    @classmethod
    def _variables(cls, listed: Sequence[str]) -> tuple[str, ...]:
        return tuple(each for name in listed for each in (name, f"{name}_dot"))

    def _given_names(self) -> Iterator[tuple[object, Place]]:
        yield from ((name, ("modes",) if path[0] == "variables" else path) for name, path in super()._given_names())

    def _read_by(self, by: str) -> Read:
        (mobility, change), n, read = self._mobility(by), len(self.variables) // 2, Read(linear={*self._used})
        forces = zeros(n, 2 * n)
        for place, driver, matrix in self._parts(by, read, self.matrices[1:]):
            off = np.abs(matrix[0] + matrix[0].T) > ROUNDED * np.max(np.abs(matrix[0]))
            if place[0] in SKEW and off.any():
                must = "must be skew-symmetric, each entry minus the one across the diagonal"
                text = f"got {shown(matrix[0].tolist())}; {must}; write the rest into {SKEW[place[0]]}"
                raise TableError(text, *place)
            forces[driver][:, :, int(place[0] in OF_SPEEDS) :: 2] += matrix
        sums = {
            driver: np.array([-mobility @ force, -(change @ force + mobility @ slope)])
            for driver, (force, slope) in forces.items()
        }
        speeds = map(product, self.variables[1::2])
        read.rates = [each for pair in zip(speeds, self._forms(sums), strict=True) for each in pair]
        return read

    def _mobility(self, by: str = "") -> FloatArray:
        """M⁻¹, by which modes share an impact, and its derivative by a parameter. Raises `TableError`."""
        place, _, rows = self.matrices[0]
        names = self._values(by)
        names.pop(EPSILON, None)
        mass, slope = series_of(place, rows, names)["", 0]
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
        """It is in M or in c, whose M⁻¹c they are."""
        of_mass = [text for text, place in self._texts() if place[0] == "mass"]
        return any(name in names_in(text) for text in (*of_mass, str(self.walls[0].at).partition("=")[0]))

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
