"""What Python calls of meshes and of Λ(p) refuse, and in which words."""

import math
import re

import meshio
import numpy as np
import pytest

from fpsolve import (
    CylinderMesh,
    ExponentSolver,
    FpsolveError,
    MomentLyapunovFunction,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    simulate,
    stability_index,
    stationary_density,
)
from fpsolve.analysis import adjoint_density, excursion
from fpsolve.exponent import Budget, principal_pair, solve_moments, spectrum
from fpsolve.fem import Generator, read_mesh, write_mesh
from fpsolve.model import Jump, White
from tests.kit import matrices
from tests.numbers.rows.heavy_tails import tailed
from tests.numbers.rows.many_variables import masses
from tests.numbers.rows.no_noise import DAMPED, NOISES, still

UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)


def paper(epsilon: float = 0.1, noise=UNIT, **more):
    given = {"omega": 1.0, "restitution": 0.8, "c1": 0.1} | more
    return Problem(VibroImpactOscillator(epsilon=epsilon, **given), noise)


FIG1, FALLING, SIX = paper(), tailed(0.5, 1.0, 1.1, 0.2, c1=-0.5), masses(3, White(s=0.2))
SLOW = paper(
    1.0930367,
    NonGaussianNoise(D0=0.09531017, tau0=49.143166, r0=0.61455889),
    omega=0.07252887, restitution=0.57982, c1=-0.338098, impact="restitution",
)  # fmt: skip
RAY = ([[-0.3, 0.0], [0.5, -1.0]], [[0.4, 0.0], [0.2, -1.0]], OrnsteinUhlenbeck(alpha=1.0, sigma=0.7))
HALF = {"phi_lines": [np.pi / 2, 3 * np.pi / 2], "z_lines": [-8.0, 0.0, 8.0], "phi_degree": 4, "xi_degree": 4}


def mesh(**change):
    return lambda: CylinderMesh(**(HALF | change))


def on(given: CylinderMesh, problem: Problem = FIG1) -> Generator:
    return Generator(problem, given)


def p_of(p):
    return lambda: moment_lyapunov(FIG1, p)


WHOLE = "must be a whole number from 1 to"
ORDER = r"^p must be a finite number or a {}list of finite numbers, got .+$"
ORDERS = [
    *("2", b"2", ["2"], 2j, [1, 2j], True, [True, 2], np.array([True]), None, [None], {1.0}, len, 10**400),
    *([], [[1.0, 2.0]], [[1], [1, 2]], np.inf, [np.nan], np.timedelta64(3), np.datetime64("2020-01-01")),
    np.ma.array([1.0, 2.0], mask=[False, True]),
]
TAILS = r" is not computed: for r0 > 1 the noise has algebraic tails. Λ\(p\) is infinite for p > 0 and p < -1; "
TAILS += "between.*. Take λ, or choose r0 <= 1, or"
OF_SIX = "of 6 variables"
CALLS = [
    (mesh(phi_lines=[np.pi / 2, 3.0]), "the phase spans 1.4292.*half circle, pi, or the circle, 2 pi"),
    (mesh(phi_lines=[np.pi / 2, 4.0, 3.0, 3 * np.pi / 2]), "phi_lines must increase"),
    (mesh(z_lines=[-8.0, np.nan]), "z_lines must be at least two finite numbers"),
    (mesh(z_lines=[1.0]), "z_lines must be at least two finite numbers"),
    (mesh(z_lines=[-8.0, 1.0, 1.0 + 1e-12, 8.0]), "no cell may be thinner"),
    (mesh(phi_degree=0), f"phi_degree is 0; it {WHOLE} 20"),
    (mesh(xi_degree=2.5), f"xi_degree is 2.5; it {WHOLE} 20"),
    (lambda: make_mesh(xi_min=1.0), r"\[1, 8\] must contain 0 inside.*choose xi_min < 0 < xi_max"),
    (lambda: make_mesh(phi_cells=0), f"phi_cells is 0; it {WHOLE} 1000"),
    (lambda: make_mesh(xi_cells=1001), "xi_cells is 1001"),
    (lambda: make_mesh(grading=-1.0), "grading is -1.0; it must be a number from 0.01 to 100"),
    (lambda: on(mesh(phi_lines=[0, np.pi])()), r"1 impact line\(s\) expected at phi = pi/2 \+ k pi, 0 found"),
    (lambda: on(mesh(phi_lines=[0, np.pi / 2, 2 * np.pi])()), r"2 impact line\(s\) expected"),
    (
        lambda: on(make_mesh(xi_cells=2, xi_degree=20, xi_min=-30, xi_max=30)),
        "linearly dependent up to rounding.*Use more cells, cells of a lower degree",
    ),
    (
        lambda: principal_pair(on(make_mesh(phi_cells=1, phi_degree=3, xi_cells=1, xi_degree=4), paper(2.0)), 6.0),
        "was not found on this mesh.*use more cells",
    ),
    (lambda: write_mesh(make_mesh(), "/proc/none/mesh.vtu"), "cannot be written.*choose another place"),
    *(
        (lambda k=k: spectrum(on(make_mesh(phi_cells=1, phi_degree=3, xi_cells=1, xi_degree=2)), 1.0, k), words)
        for k in (0, 10_000)
        for words in ["it must be from 1 to the number of unknowns, 12"]
    ),
    (lambda: spectrum(on(make_mesh(phi_cells=8, xi_cells=8)), 1.0), "use a coarser mesh"),
    *((p_of(p), ORDER.format("non-empty ")) for p in ORDERS),
    *(
        (lambda p=p, solve=solve: solve(ExponentSolver(FIG1), p), words)
        for solve, orders, words in (
            (ExponentSolver.moments, ("2", [[1.0, 2.0]], [[1], [1, 2]]), ORDER.format("")),
            (solve_moments, ("2", [[1.0, 2.0]], [[1], [1, 2]]), ORDER.format("")),
            (ExponentSolver.pair, ("1", True, 1j, None, [1.0], np.nan), r"^p must be a finite number, got .+$"),
        )
        for p in orders
    ),
    *(
        (
            lambda rtol=rtol, solve=solve: solve(FIG1, rtol=rtol),
            "got rtol = .*; must be > 1e-13 and < 1; write, for example",
        )
        for solve in (lyapunov_exponent, stability_index)
        for rtol in (-1.0, 1e-13, 1.0, math.nan)
    ),
    (lambda: moment_lyapunov(FALLING, 2.0), rf"^Λ\(2\){TAILS}"),
    (lambda: moment_lyapunov(FALLING, [0.0, -0.5]), rf"^Λ\(-0.5\){TAILS}"),
    (lambda: ExponentSolver(FALLING).pair(-1.5), rf"^Λ\(-1.5\){TAILS}"),
    (lambda: MomentLyapunovFunction(FALLING, (-0.9, -0.1)), rf"^Λ\(-0.9\){TAILS}"),
    (lambda: simulate(FALLING, [-0.4]), rf"^Λ\(-0.4\){TAILS}"),
    (lambda: ExponentSolver(FALLING).variance_rate(), rf"^Λ″\(0\){TAILS}"),
    (lambda: excursion(FALLING), rf"^P\(sup ‖x‖ ≥ A\){TAILS}"),
    (lambda: moment_lyapunov(SIX, [1.0, 2.0]), rf"Λ\(1\) is not computed: {OF_SIX} .* λ <= Λ\(2\)/2"),
    (lambda: lyapunov_exponent(SIX), f"^λ is not computed: {OF_SIX}"),
    (lambda: stability_index(SIX), f"^δ_p is not computed: {OF_SIX}"),
    (lambda: moment_lyapunov(masses(5, White(s=0.2)), 6.0), "5005 moments are more than 1000"),
    (lambda: masses(3, NonGaussianNoise(0.1, 0.5, 1.2)), "algebraic tails is for two variables only"),
    (
        lambda: moment_lyapunov(matrices(*RAY), [-0.5, 1.0, -1.5]),
        r"along the ray at phi = 1\.5708, across .* choose p >= 0",
    ),
    (
        lambda: matrices(*RAY, jumps=[Jump(math.pi / 2, -0.1)]),
        r"does not pass the ray of a jump, phi = 1\.5708: .* remove the jump",
    ),
    (lambda: moment_lyapunov(matrices(*RAY, jumps=[Jump(math.atan2(-1, 7), -0.1)]), 1.0), "remove the jumps"),
    (lambda: ExponentSolver(matrices(*RAY)).pair(1.0), "no positive eigenfunction"),
    (
        lambda: ExponentSolver(matrices(0.1 * np.eye(2), np.diag([1.0, -1.0]), White(0.7))).variance_rate(),
        r"Λ″\(p\) jumps",
    ),
    (
        lambda: stationary_density(ExponentSolver(SLOW, rtol=1e-4).pair(0.0)),
        r"the stationary density at p = 0 is not resolved: \d\d% of it is negative",
    ),
    (
        lambda: adjoint_density(ExponentSolver(SLOW, rtol=1e-4).pair(0.0)),
        "the adjoint density at p = 0 is not resolved",
    ),
    (
        lambda: ExponentSolver(SLOW, budget=Budget(unknowns=100)).lyapunov_exponent(),
        r"^Λ\(p\) near p = 0 follows from Λ\(0\.01\), and Λ\(0\.01\) was not found",
    ),
]


@pytest.mark.parametrize(("call", "words"), CALLS, ids=[f"{k} {words[:50]}" for k, (_, words) in enumerate(CALLS)])
def test_call_is_refused(call, words):
    with pytest.raises((FpsolveError, ValueError), match=words):
        call()


CORNERS = [[np.pi / 2, -8, 0], [3 * np.pi / 2, -8, 0], [3 * np.pi / 2, 8, 0], [np.pi / 2, 8, 0]]
QUAD = {"quad": [[0, 1, 2, 3]]}
DEGREE = "xi_degree must be one whole number from 1 to 20 throughout"


@pytest.mark.parametrize(
    ("points", "cells", "degrees", "words"),
    [
        (CORNERS, {"triangle": [[0, 1, 2], [0, 2, 3]]}, None, "holds triangle; every cell must be a quadrilateral"),
        ([*CORNERS, [3.0, 0, 0]], {"quad": [[0, 1, 2, 4]]}, None, "not the full tensor grid of 4 cells"),
        (np.add(CORNERS, [0.1, 0, 0]), QUAD, None, "put a line of the mesh at each impact"),
        (CORNERS, {"quad": [[0, 1, 2, 3]] * 2}, None, "2 quadrilaterals .* not the full tensor grid of 1 cells"),
        *(
            (CORNERS, {"quad": [[0, 1, 2, k]]}, None, f"a cell has the corner {k}, but points are 0 to 3; make")
            for k in (-1, 4)
        ),
        ([[np.nan, 0, 0], *CORNERS[1:]], QUAD, None, "the points must be finite"),
        (CORNERS, QUAD, [3, 3, 4, 3], DEGREE),
        *(
            (CORNERS, QUAD, values, DEGREE)
            for values in (np.full((4, 3), 5), np.full((4, 1), 5), [4.5] * 4, [1e300] * 4, [np.nan] * 4)
        ),
    ],
)
def test_mesh_file_is_refused(tmp_path, points, cells, degrees, words):
    data = {} if degrees is None else {"xi_degree": np.array(degrees)}
    path = tmp_path / "mesh.vtu"
    meshio.Mesh(np.array(points, dtype=float), {k: np.array(v) for k, v in cells.items()}, point_data=data).write(path)
    with pytest.raises(FpsolveError, match=words):
        on(read_mesh(path))


def test_path_that_is_no_mesh_file_is_refused(tmp_path):
    (tmp_path / "folder.vtu").mkdir()
    named = {"no.vtu": "does not exist", "folder.vtu": "is not a file", "mesh.stl": 'ending ".stl"'}
    for content in ("", "no mesh at all"):
        for ending in (".vtu", ".msh"):
            name = f"bad{len(content)}{ending}"
            (tmp_path / name).write_text(content)
            named[name] = f"{name} cannot be read as a {ending} mesh .*make one with `fpsolve mesh`"
    for name, words in named.items():
        with pytest.raises(FpsolveError, match=words):
            read_mesh(tmp_path / name)


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (FALLING, "δ_p is not computed: for r0 > 1 the noise has algebraic tails"),
        (
            paper(0.3, NonGaussianNoise(D0=0.01, tau0=0.5, r0=0.7), restitution=0.5, c1=-3.0),
            r"no root p ≠ 0 in \[-20, 20\].* with bounded noise P\(sup ‖x‖ > A\) may fall faster than any power of A",
        ),
        (paper(0.1, OrnsteinUhlenbeck(alpha=1.0, sigma=0.3), omega=10.0, restitution=0.5, c1=-1.0), "."),
        (still(DAMPED, NOISES["white"]), "."),
        (matrices(0.1 * np.eye(2), np.diag([1.0, -1.0]), White(0.7)), "."),
    ],
)
def test_missing_stability_index_has_a_reason(problem, words):
    found = stability_index(problem)
    assert not found
    assert re.search(words, str(found))
