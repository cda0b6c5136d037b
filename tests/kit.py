"""What tests of cases share: cases that are solved at once, solving them without a folder, and files of a run."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from fpsolve import PlaneSystem, Problem, load_case
from fpsolve.case import Case
from fpsolve.cli import main
from fpsolve.model import CoefficientMatrix, LinearSystem, Noise, System
from fpsolve.results.known import names_of, read_into, record_of
from fpsolve.solve import SetResult, SimulatedSet, simulation_of
from fpsolve.solve.question import Job, Numerics
from fpsolve.solve.sets import everything, result_of, solve_set

ALL = 'output.quantities="all"'
"""Sets what a case asks for to everything."""
QUANTITIES = '["moment", "lyapunov_exponent", "stability_index", "variance_rate", "impact_rate"'
QUANTITIES += ', "critical_impact_factor", "critical_restitution", "eigenfunctions"]'
"""All that is one number, Λ(p), and eigenfunctions."""
OSCILLATOR = {"epsilon": 0.1, "omega": 1.0, "restitution": 0.8, "c1": 0.1}
NOISE = {"D0": 0.5, "tau0": 0.5, "r0": 0.95, "treatment": "ou-reduction"}
TEXT = """
title = "A test"
[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1
[noise]
D0 = 0.5
tau0 = 0.5
r0 = 0.95
treatment = "ou-reduction"
[moments]
p = [2.0, 0.0, -1.0]
[vary]
"noise.D0" = [0.1, 1.0]
[output]
figure = false
eigenfunctions = [2.0]
"""
"""Two parameter sets with three p and an eigenfunction."""
DRAWN = TEXT.replace("figure = false", f"figure = true\nquantities = {QUANTITIES}")
"""The same with a figure and all that is one number."""
LEAN = "output={ quantities = ['lyapunov_exponent'] }"
"""Sets what is solved in the least time."""
HOPELESS = "mesh={ phi_cells = 1, phi_degree = 2, xi_cells = 2, xi_degree = 3 }"
"""Sets a mesh that resolves nothing."""
COSTLY = (
    "fpsolve.solve.sensitivities.solve_sensitivities",
    "fpsolve.solve.excursions.solve_excursion",
    "fpsolve.solve.response.solve_response",
    "fpsolve.solve.eigenfunctions.densities",
)
"""What takes more than the tolerance of Λ(p) needs."""
TABLES = {"summary.json", "moments.csv", "sets.csv", "results.nc"}
"""The files of what is solved."""


def equations(text: str, walls: Sequence[Mapping[str, Any]] = (), **parameters: float) -> System:
    """A system of rates as `x' = v; v' = -x - c*v - xi*x`, noises called xi or as in `rates`."""
    drift = {
        left.strip().removesuffix("'"): right.strip() for left, right in (each.split("=") for each in text.split(";"))
    }
    names = {name: f"noise.{name}" for name in ("xi1", "xi2", "xi3") if name in text}
    return PlaneSystem.of_equations(tuple(drift), tuple(drift.values()), parameters, noises=names or None, walls=walls)


def rates(
    text: str, noise: Noise | Sequence[Noise], walls: Sequence[Mapping[str, Any]] = (), **parameters: float
) -> Problem:
    """A problem of rates as `x' = v; v' = -x - c*v - xi*x` and values of their parameters.

    >>> rates("x' = v; v' = -x - c*v - xi*x", White(s=0.1), walls=[{"at": "x = 0", "restitution": 0.8}], c=0.2)
    >>> rates("x' = v; v' = -(1 + xi1)*x - xi2*v", [White(s=0.1), Telegraph(a=0.5, k=1.0)])
    """
    noises = noise if isinstance(noise, Noise) else {f"xi{k}": each for k, each in enumerate(noise, 1)}
    return Problem(equations(text, walls, **parameters), noises)


def itself(xi: Any) -> Any:
    """The load of a noise that is ξ."""
    return xi


def matrices(drift: Any, load: Any, noise: Noise | Sequence[Noise], **more: Any) -> Problem:
    """The problem ẋ = (drift + ξ load) x of any number of variables, with `jumps` or a `stop`; lists of several."""
    loads, noises = ([load], [noise]) if isinstance(noise, Noise) else (load, noise)
    names = [""] if isinstance(noise, Noise) else [f"xi{k}" for k, _ in enumerate(noises, 1)]
    driven = [CoefficientMatrix(1, each, itself, name) for each, name in zip(loads, names, strict=True)]
    given = noise if isinstance(noise, Noise) else dict(zip(names, noises, strict=True))
    return Problem(LinearSystem([CoefficientMatrix(0, drift), *driven], **more), given)


class Run(NamedTuple):
    """What a command did: its exit code, what it printed, and the folder that it ran in."""

    code: int
    out: str
    err: str
    folder: Path


def run(folder: Path, *arguments: str, to: Callable[[], Any] = io.StringIO, **texts: str | bytes) -> Run:
    """`fpsolve` with these arguments in a folder, in this process, with files of these texts; case=… is case.toml.

    It prints to streams that `to` makes.
    """
    for name, text in texts.items():
        path = folder / (f"{name}.toml" if "." not in name else name)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    out, err = to(), to()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        code = main(list(arguments))
    return Run(code, out.getvalue(), err.getvalue(), folder)


def case_text(more: str = "", title: str = "A test", noise: Mapping[str, Any] = NOISE, **oscillator: Any) -> str:
    """A case file: parameters for which cases are solved at once, or others, and further sections."""
    sections = {"oscillator": OSCILLATOR | oscillator, "noise": {**NOISE, **noise}}
    lines = [
        line
        for name, values in sections.items()
        for line in (f"[{name}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items()))
    ]
    return "\n".join([f"title = {json.dumps(title)}", *lines, more])


def case_in(folder: Path, text: str, overrides: Sequence[str] = (), name: str = "test") -> Case:
    """A case of a text, whose file is in a folder."""
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return load_case(path, overrides)


def solve_sets(case: Case) -> list[Any]:
    """All that a case wants of its parameter sets, each with its record and its pictures."""
    jobs = [solve_set(Job(parameter_set, everything(case), Numerics.of(case))) for parameter_set in case.sets()]
    return [SimpleNamespace(result=result_of(job), record=record_of(job), pictures=job.pictures) for job in jobs]


def solve_case(case: Case) -> list[SetResult]:
    """The numbers alone."""
    return [solved.result for solved in solve_sets(case)]


def simulate_sets(case: Case) -> list[SimulatedSet]:
    """The simulation of every parameter set, without a folder."""
    return [
        SimulatedSet(parameter_set, *simulation_of(parameter_set, case.simulated.tolist(), case.monte_carlo))
        for parameter_set in case.sets()
    ]


def from_record(case: Case, parameter_set: Any, record: Any) -> SetResult:
    """A solved set as it comes back from its record."""
    asked, numerics = everything(case), Numerics.of(case)
    return result_of(read_into(Job(parameter_set, asked, numerics), record, names_of(asked, numerics), is_all=True))


def read_json(path: Path) -> Any:
    """The data of a file of JSON."""
    return json.loads(path.read_text(encoding="utf-8"))


def read_csv(path: Path) -> list[dict[str, str]]:
    """The rows of a table, by the heads of its columns."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def records_in(folder: Path) -> list[bytes]:
    """All records of sets in a folder of results, the torn ones too."""
    path = folder / "records/solved.jsonl"
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def sets(records: list[bytes]) -> set[bytes]:
    """The keys of the sets of whole records; one that takes long has several, of its parts."""
    return {line.split(b'"')[3] for line in records if line.startswith(b'{"key"') and line.endswith(b"\n")}


def files(folder: Path) -> set[str]:
    """All files below a folder, by their paths from there."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


LIST = "records/files.txt"


def put(folder: Path, command: str, *names: str) -> None:
    """Write empty files, and say in the list of the folder that a command did, for other parameters if it is new."""
    for name in (LIST, *names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    text = (folder / LIST).read_text() or "of other parameters\n"
    (folder / LIST).write_text(text + "".join(f"{command} {name}\n" for name in names))


def chain_of_masses(count, damping=0.02, spring=0):
    """A₀ and A₁ of unit masses and springs from the ground on, one spring k(1 + ξ), and the frequencies.

    The unit of time is that of the first frequency, and all modes have one damping ratio.
    """
    stiffness = 2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    stiffness[-1, -1] = 1.0
    stretch = np.eye(count)[spring] - (np.eye(count)[spring - 1] if spring else 0.0)
    squares, modes = np.linalg.eigh(stiffness)
    stiffness, load = stiffness / squares[0], np.outer(stretch, stretch) / squares[0]
    frequencies = np.sqrt(squares / squares[0])
    damper = modes @ np.diag(2 * damping * frequencies) @ modes.T
    none, one = np.zeros((count, count)), np.eye(count)
    return np.block([[none, one], [-stiffness, -damper]]), np.block([[none, none], [-load, none]]), frequencies
