"""Pictures: what is in the files of figures, who may draw, and what each says of its axes."""

import subprocess
import sys
from io import BytesIO

import matplotlib.image
import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
)
from fpsolve.exponent import critical_impact_factor, critical_restitution
from fpsolve.model import ParametricOscillator, Telegraph, White
from fpsolve.tell import draw_eigenfunction
from tests.conftest import sampled
from tests.kit import TEXT, case_in, files, rates, run

SHAKEN = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.3, c1=0.1, epsilon=0.5), NonGaussianNoise(D0=0.5, tau0=1.0, r0=0.9)
)

DRAWN = {"figure.png", "figure.pdf"}


def colours(png):
    content = matplotlib.image.imread(png)[:, :, :3]
    return len(np.unique((content * 255).astype(int).reshape(-1, 3), axis=0)), content.shape[:2]


@pytest.mark.parametrize(
    ("sets", "pictures_there"),
    sampled(
        (["vary={}", "output={ quantities=['moment'] }"], {"figure"}),
        (["output={ quantities=['moment', 'stability_index', 'rate_function'] }"], {"figure", "rate_function"}),
        (
            ["vary={}", "output={ quantities=['moment', 'sensitivities'], sensitivities=true }"],
            {"figure", "sensitivities"},
        ),
        keep=0,
    ),
)
def test_figures_of_a_run_are_drawn_as_png_and_pdf(pictures, tmp_path, sets, pictures_there):
    text = TEXT.replace("figure = false", "figure = true")
    assert run(tmp_path, "run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in sets), case=text).code == 0
    folder = tmp_path / "results/case"
    assert {name.rpartition(".")[0] for name in files(folder) if name.endswith((".png", ".pdf"))} == pictures_there
    for name in pictures_there:
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        count, shape = colours(folder / f"{name}.png")
        assert count > 100
        assert min(shape) > 500


@pytest.mark.slow
def test_eigenfunction_has_a_picture_in_python(pictures, tmp_path):
    picture = draw_eigenfunction(ExponentSolver(SHAKEN).pair(2.0), "T_adjoint", cmap="magma")
    assert colours(BytesIO(picture.png))[0] > 300
    assert picture.save(tmp_path / "picture.png").read_bytes() == picture.png == picture._repr_png_()


@pytest.mark.slow
@pytest.mark.parametrize("field", ["T", "tilted_density"])
def test_eigenfunction_of_directions_has_a_picture_in_python(pictures, field):
    turning = rates("x' = -x + y; y' = -x - y + xi*z; z' = -z + xi*x", White(s=1.0))
    assert colours(BytesIO(draw_eigenfunction(ExponentSolver(turning, rtol=1e-3).pair(1.0), field).png))[0] > 300


def test_figure_over_a_parameter_has_what_is_simulated(tmp_path):
    """Of a moment, and of λ."""
    text = TEXT.replace("figure = false", "figure = true") + "[monte_carlo]\npaths = 64\ntime = 40.0\n"
    for y in ("{ moment = 2.0 }", '"lyapunov_exponent"'):
        figure = f'--set=figure={{ x = "noise.D0", y = {y} }}'
        assert run(tmp_path, "run", "case.toml", "--jobs", "1", "--monte-carlo", figure, case=text).code == 0
    assert files(tmp_path / "results/case") >= DRAWN
    impossible = "--set=vary={ 'oscillator.epsilon' = [0.1, 1.5], 'oscillator.restitution' = [0.1] }"
    more = "--set=oscillator.impact='restitution'", impossible, "--out", "other"
    for figure in ('{ x = "oscillator.epsilon", y = { moment = 2.0 } }', "{}"):
        assert run(tmp_path, "run", "case.toml", "--jobs", "1", f"--set=figure={figure}", *more, case=text).code == 3
        assert files(tmp_path / "other/case") >= DRAWN


def test_many_curves_of_one_moment_are_dots(tmp_path):
    text = TEXT.replace("figure = false", "figure = true")
    many = ['--set=vary."noise.D0"={ start = 0.1, stop = 1.0, num = 12 }', "--set=moments.p=[2.0]"]
    assert run(tmp_path, "run", "case.toml", "--jobs", "1", *many, case=text).code == 0
    assert files(tmp_path / "results/case") >= DRAWN


def test_eigenfunction_of_states_has_a_picture_in_python(pictures):
    telegraph = rates(
        "x' = v; v' = -x - 0.2*v - xi*x", Telegraph(a=0.5, k=1.0), walls=[{"at": "x = 0", "restitution": 0.8}]
    )
    assert draw_eigenfunction(ExponentSolver(telegraph).pair(2.0)).png.startswith(b"\x89PNG")


def test_what_cannot_be_drawn_is_refused():
    pair = ExponentSolver(SHAKEN, rtol=1e-4).pair(2.0)
    with pytest.raises(ValueError, match="got field = 'density'; must be one of 'T', 'T_adjoint', 'tilted_density'"):
        draw_eigenfunction(pair, "density")
    two = rates("x' = v; v' = -(1 + xi1 + xi2)*x - 0.2*v", [Telegraph(a=0.3, k=1.0), Telegraph(a=0.2, k=2.0)])
    with pytest.raises(FpsolveError, match="make all of these noises white but one"):
        draw_eigenfunction(ExponentSolver(two).pair(2.0))


@pytest.mark.slow
def test_solving_and_writing_load_nothing_that_draws(tmp_path):
    """It must work without display, OpenGL or EGL."""
    case_in(tmp_path, TEXT)
    code = """
import sys
from fpsolve.cli import main
assert main(sys.argv[1:]) == 0
print([name for name in sys.modules if "vtkRendering" in name or name == "matplotlib"])
"""
    done = subprocess.run(
        [sys.executable, "-c", code, "run", "test.toml", "--quiet"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "noise",
    [Telegraph(a=0.5, k=1.0), White(s=0.5), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)],
    ids=lambda each: each.kind,
)
def test_no_two_parameters_of_a_problem_have_one_symbol(noise):
    """The noise is named where it shares one with the system."""
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-k*x - s*v - xi*x"), {"s": 0.1, "k": 1.0})
    signs = [each.quantity.shown for each in Problem(system, noise).parameters.values()]
    assert len(set(signs)) == len(signs)
    known = Problem(system, White(s=0.5)).parameters["noise.s"].quantity
    assert (known.shown, known.stated(0.5)) == (r"${s}_{\xi}$", r"${s}_{\xi}$ = 0.5")
    plain = Problem(ParametricOscillator(stiffness=1.0, damping=0.1), noise).parameters.values()
    assert len({each.quantity.shown for each in plain}) == len(plain)


def test_what_is_stable_for_every_restitution_says_so():
    walls = [{"at": "x = 0", "restitution": "1 - loss"}]
    problem = rates("x' = v; v' = -x - 0.2*v - xi*x", Telegraph(a=0.3, k=1.0), walls, loss=0.2)
    found = critical_restitution(ExponentSolver(problem))
    assert not found
    assert "almost surely stable for every R in (0, 1]" in found.reason


def test_an_overdamped_motion_has_no_critical_impact_factor():
    system = ParametricOscillator(stiffness=1.0, damping=3.0, restitution=0.9)
    found = critical_impact_factor(ExponentSolver(Problem(system, Telegraph(a=0.5, k=1.0))))
    assert "as if the motion did not turn" in found.reason
