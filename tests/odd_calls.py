"""Calls of the public functions with odd arguments: each returns, or raises one sentence of fpsolve's own.

`python -m tests.odd_calls --count 200 --seed 1` prints what else happens; it takes some minutes.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import chdir
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

import fpsolve
from fpsolve import Problem
from fpsolve.analysis import Axis
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from fpsolve.fem import read_mesh, write_mesh
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, SineWiener
from fpsolve.model.faults import ParameterError
from tests.kit import case_text

LIMIT = 60
"""Seconds after which a call hangs."""
ROTATION, SHEAR = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0))
PACKAGE = str(Path(fpsolve.__file__).parent)
FUNCTIONS = [
    *(lambda x: x, np.sin, lambda x: np.zeros(3), lambda x: np.zeros((2, *np.shape(x))), lambda x: None, lambda: 1.0),
    *(
        lambda x: "x",
        lambda x: np.full(np.shape(x), np.nan),
        lambda x: x + 1j,
        lambda x: [[1.0], [2.0]],
    ),
]
NUMBERS = [
    *(True, False, 0, 1, -1, 2, 0.5, -0.5, -0.0, 1e300, -1e300, 1e-300, 5e-324, 1e15, 1e16, 10**400, 1j),
    *(float("nan"), float("inf"), -float("inf"), np.float32(0.5), np.int64(2), Decimal("0.5"), Fraction(1, 2)),
    *(np.array(1.0), np.array([1.0, np.nan]), np.zeros((2, 2)), np.ma.masked, np.bool_(True)),
    *("", "x", "1", "1.0", b"1", "a\x1b", None, object(), int, ...),
    *(
        [],
        [[]],
        [1, 2],
        [1.0, 2.0],
        [2.0, 1.0],
        [[1, 2], [3]],
        [True, 1.0],
        ["1", "2"],
        (),
        {},
        {"a": 1.0},
        {1},
        range(3),
    ),
    *([1.0] * 3, [1e300, -1e300], [[0.0, 1.0], [1.0, 0.0]], np.datetime64("2020-01-01"), Path("/nowhere/x")),
]
VALUES = [*NUMBERS, *FUNCTIONS]
OSCILLATOR = fpsolve.VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
NOISE = fpsolve.OrnsteinUhlenbeck(alpha=2.0, sigma=2.0)
NUMERICS = {"rtol": 1e-3, "mesh": None, "budget": Budget(unknowns=2000, seconds=2.0)}
FRAME = {"x": Axis("oscillator.omega", 0.8, 1.2), "y": Axis("oscillator.c1", -0.1, 0.1)}
PROBLEM = {"problem": fpsolve.Problem(OSCILLATOR, NOISE)}


def solved_plane(**options: Any) -> Any:
    """Λ(2) of a system of the plane, one term of which is made of the options."""
    system = fpsolve.PlaneSystem([CoefficientMatrix(0, ROTATION), CoefficientMatrix(**options)])
    return fpsolve.moment_lyapunov(Problem(system, NOISE), 2.0, **NUMERICS)


def solved_chain(**options: Any) -> Any:
    """λ with telegraph noise."""
    return fpsolve.lyapunov_exponent(Problem(OSCILLATOR, MarkovChain.telegraph(**options)), **NUMERICS)


def written_mesh(path: Any) -> None:
    """A mesh file at a path."""
    write_mesh(fpsolve.make_mesh(phi_cells=1, phi_degree=2, xi_cells=1, xi_degree=2), path)


CALLS: dict[str, tuple[Callable[..., Any], Mapping[str, Any]]] = {
    "VibroImpactOscillator": (
        fpsolve.VibroImpactOscillator,
        {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1, "c2": 0.0, "c3": 0.0, "impact": "delta"},
    ),
    "NonGaussianNoise": (fpsolve.NonGaussianNoise, {"D0": 1.0, "tau0": 0.5, "r0": 0.95}),
    "OrnsteinUhlenbeck": (fpsolve.OrnsteinUhlenbeck, {"alpha": 1.0, "sigma": 1.0}),
    "SineWiener": (SineWiener, {"amplitude": 1.0, "sigma": 1.0}),
    "MarkovChain": (MarkovChain, {"states": [-1.0, 1.0], "rates": [[-1.0, 1.0], [1.0, -1.0]]}),
    "telegraph": (MarkovChain.telegraph, {"amplitude": 0.5, "rate": 1.0}),
    "lyapunov_exponent of a chain": (solved_chain, {"amplitude": 0.5, "rate": 1.0}),
    "CoefficientMatrix": (CoefficientMatrix, {"order": 1, "matrix": SHEAR, "g": np.sin}),
    "moment_lyapunov of a plane system": (solved_plane, {"order": 1, "matrix": SHEAR, "g": np.sin}),
    "Jump": (Jump, {"phase": 1.5, "log_factor": -0.1, "leading": None}),
    "PlaneSystem": (
        fpsolve.PlaneSystem,
        {"terms": [CoefficientMatrix(0, ROTATION)], "jumps": [Jump(1.5, -0.1)], "epsilon": 0.1},
    ),
    "PlaneSystem.of_equations": (
        fpsolve.PlaneSystem.of_equations,
        {
            "variables": ("x", "v"),
            "drift": ("v", "-k*x - xi*x"),
            "parameters": {"k": 1.0},
            "noises": {"xi": "noise"},
            "walls": [{"at": "x = 0", "restitution": 0.8}],
        },
    ),
    "Problem": (fpsolve.Problem, {"system": OSCILLATOR, "noise": NOISE}),
    "Problem.at": (fpsolve.Problem(OSCILLATOR, NOISE).at, {"values": {"noise.sigma": 1.0}}),
    "Budget": (Budget, {"unknowns": 2000, "seconds": 2.0}),
    "Axis": (Axis, {"key": "oscillator.omega", "start": 0.5, "stop": 2.0, "scale": "linear", "at": (1.0,)}),
    "moment_lyapunov": (fpsolve.moment_lyapunov, {**PROBLEM, "p": [1.0, 2.0], **NUMERICS}),
    "lyapunov_exponent": (fpsolve.lyapunov_exponent, {**PROBLEM, **NUMERICS}),
    "stability_index": (fpsolve.stability_index, {**PROBLEM, **NUMERICS}),
    "sensitivities": (fpsolve.sensitivities, {**PROBLEM, "p": [1.0], **NUMERICS}),
    "MomentLyapunovFunction": (fpsolve.MomentLyapunovFunction, {**PROBLEM, "interval": (-1.0, 2.0), **NUMERICS}),
    "ExponentSolver": (fpsolve.ExponentSolver, {**PROBLEM, **NUMERICS}),
    "boundary": (fpsolve.boundary, {**PROBLEM, "zero": "lyapunov_exponent", **FRAME, "nodes": 2, "step": 0.05}),
    "prove": (fpsolve.prove, {**PROBLEM, "p": 2.0, "width": 1e-3}),
    "simulate": (
        fpsolve.simulate,
        {**PROBLEM, "p": [1.0], "estimator": "direct", "paths": 64, "time": 20.0, "step": 0.05, "seed": 1},
    ),
    "make_mesh": (
        fpsolve.make_mesh,
        {"phi_cells": 2, "phi_degree": 3, "xi_cells": 2, "xi_degree": 3, "xi_min": -8.0, "xi_max": 8.0, "grading": 1.0},
    ),
    "load_case": (fpsolve.load_case, {"path": "case.toml", "overrides": ["oscillator.omega=2.0"]}),
    "run": (fpsolve.run, {"case": "case.toml", "out": "out", "jobs": 1, "scheduler": "", "fresh": False}),
    "open_results": (fpsolve.open_results, {"places": "out"}),
    "read_mesh": (read_mesh, {"path": "mesh.vtu"}),
    "write_mesh": (written_mesh, {"path": "mesh.vtu"}),
}
POSITIONAL = {"open_results": ["places"]}
CASE = case_text('[moments]\np = [1.0]\n[output]\nquantities = ["moment"]\nfigure = false\n', "odd", {"D0": 0.1})


class Hang(BaseException):
    """A call took too long."""


def hang(*_: Any) -> None:
    raise Hang


def fault(name: str, arguments: Mapping[str, Any]) -> str:
    """What is wrong with how a call ends; nothing where it returns, or raises a sentence of fpsolve."""
    function, _ = CALLS[name]
    rest = dict(arguments)
    places = [rest.pop(key) for key in POSITIONAL.get(name, ())]
    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(LIMIT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            function(*places, **rest)
    except (FpsolveError, ValueError, TypeError) as error:
        last, text = traceback.extract_tb(error.__traceback__)[-1], str(error)
        at = f"{Path(last.filename).name}:{last.lineno}"
        if not last.filename.startswith(PACKAGE) and "pathlib" not in last.filename:  # which names the kinds it takes
            return f"{type(error).__name__} of {at}: {text}"
        lines = text.split("\n") if isinstance(error, ParameterError | FpsolveError) else [text]  # one of each fault
        if not text or any(len(line) > 600 or "\n" in line for line in lines) or "Traceback" in text:
            return f"{type(error).__name__} is no sentence ({at}): {text[:300]}"
        if "a fault of fpsolve" in text:
            return text
    except Hang:
        return "hangs"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} of {Path(last.filename).name}:{last.lineno}: {error}"
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return ""


def odd(rng: random.Random, name: str) -> dict[str, Any]:
    """Good arguments, one or two of them exchanged for odd ones."""
    good = dict(CALLS[name][1])
    for key in rng.sample([*good], min(len(good), rng.choice([1, 1, 1, 2]))):
        values = VALUES if name not in ("run", "write_mesh") or key not in ("out", "path") else NUMBERS[30:]
        good[key] = rng.choice(values)
    return good


def printed_by(call: Callable[[], str]) -> tuple[str, str]:
    """What a call returns, and what it prints, libraries in C included."""
    sys.stdout.flush()
    with tempfile.TemporaryFile() as file:
        kept = [os.dup(each) for each in (1, 2)]
        for each in (1, 2):
            os.dup2(file.fileno(), each)
        try:
            found = call()
        finally:
            sys.stdout.flush()
            for each, old in zip((1, 2), kept, strict=True):
                os.dup2(old, each)
                os.close(old)
        file.seek(0)
        return found, file.read().decode(errors="replace")


def faults(seed: int, count: int, names: list[str] | None = None) -> list[str]:
    """What goes wrong in so many calls, in a folder of their own."""
    rng, found = random.Random(seed), []
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for number in range(count):
            Path("case.toml").write_text(CASE, encoding="utf-8")
            chosen = names or [*CALLS]
            name = chosen[number % len(chosen)]
            arguments = odd(rng, name)
            said, text = printed_by(lambda name=name, arguments=arguments: fault(name, arguments))  # type: ignore[misc]
            if said or text:
                changed = {key: each for key, each in arguments.items() if each is not CALLS[name][1][key]}
                found.append(f"{name}({changed}): {said or 'prints'} {text[:300]}")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    options = parser.parse_args()
    started = time.monotonic()
    found = faults(options.seed, options.count)
    print("\n".join(found))
    kinds = Counter(each.partition("(")[0] for each in found)
    print(f"{options.count} calls, {len(found)} with faults in {time.monotonic() - started:.0f} s", dict(kinds) or "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
