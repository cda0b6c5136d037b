"""Pictures of eigenfunctions: what is drawn, by whom, and what is written beside it."""

import subprocess
import sys
from io import BytesIO

import matplotlib.image
import numpy as np
import pytest

from fpsolve.exponent.fields import fields
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.output.eigenfunctions import draw_eigenfunction, surface_of
from fpsolve.parts.nodes import FIELDS
from fpsolve.parts.surfaces import figure_of
from tests.conftest import FIG1, UNIT_NOISE

pytestmark = pytest.mark.usefixtures("pictures")

HARD = VibroImpactOscillator(omega=1.0, restitution=0.3, c1=0.1, epsilon=0.5)
EXACT = NonGaussianNoise(D0=0.5, tau0=1.0, r0=0.9)


@pytest.fixture(scope="module")
def pair():
    return ExponentSolver(Problem(HARD, EXACT)).pair(2.0)


@pytest.mark.parametrize("field", FIELDS)
def test_values_are_those_of_the_fields(pair, field):
    """On both sides of each φ-line, and in both half turns."""
    surface, space = surface_of(pair, field), pair.space
    inside = surface.phi[:, 1:-1].ravel()
    turn = np.mod(inside - space.phi.lines[0], space.phi.span) + space.phi.lines[0]
    at_xi = space.xi.at(surface.xi / EXACT.standard_deviation)
    wanted = getattr(fields(pair, turn, space.phi.at(turn), at_xi), FIELDS[field][0])
    found = surface.values.reshape(*surface.phi.shape, -1)[:, 1:-1].reshape(wanted.shape)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12 * np.abs(wanted).max())
    assert (surface.phi.min(), surface.phi.max()) == (0, pytest.approx(2 * np.pi))
    assert surface.impacts == pytest.approx([np.pi / 2, 3 * np.pi / 2])


def test_the_impact_is_a_jump(pair):
    """T(φ⁻) = R^p T(φ⁺) at nodes that share their phase."""
    surface = surface_of(pair, "T")
    before, after = surface.values[np.abs(surface.phi.ravel() - np.pi / 2) < 1e-9]
    np.testing.assert_allclose(before / after, HARD.impact_factor(2.0), rtol=1e-5)


@pytest.mark.parametrize(
    ("field", "label"),
    [
        ("T", "eigenfunction $T$"),
        ("T_adjoint", "adjoint eigenfunction $T^*$ (time/rad)"),
        ("tilted_density", r"tilted density $T\,T^*$ (time/rad)"),
    ],
)
def test_words_of_the_plane(pair, field, label):
    figure = figure_of(surface_of(pair, field), "viridis")
    axes, bar = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"phase $\varphi$ (rad)", r"noise $\xi$ (1/time)")
    assert bar.get_ylabel() == label
    assert figure.get_suptitle() == f"p = 2, Λ(p) = {pair.value:.6g} (1/time)"
    assert axes.get_title().splitlines() == [
        "oscillator: omega = 1 (rad/time), restitution = 0.3, c1 = 0.1 (1/time), epsilon = 0.5,",
        "c2 = 0 (1/(time length²)), c3 = 0 (time/length²), impact = delta",
        "noise: D0 = 0.5 (1/time), tau0 = 1 (time), r0 = 0.9, treatment = exact",
    ]


def assert_not_blank(picture, shape):
    content = matplotlib.image.imread(BytesIO(picture.png))[:, :, :3]
    assert content.shape == shape
    assert len(np.unique((content * 255).astype(int).reshape(-1, 3), axis=0)) > 300


@pytest.mark.slow
def test_picture_of_the_plane(pair, tmp_path):
    picture = draw_eigenfunction(pair, "tilted_density", cmap="magma")
    assert_not_blank(picture, (750, 1080, 3))
    assert picture.save(tmp_path / "picture.png").read_bytes() == picture.png == picture._repr_png_()


def test_a_constant_has_a_picture():
    """T = 1 at p = 0."""
    surface = surface_of(ExponentSolver(Problem(FIG1, UNIT_NOISE)).pair(0.0), "T")
    assert surface.limits == (0, pytest.approx(1))
    assert figure_of(surface, "viridis").axes[-1].get_ylim() == (0, pytest.approx(1))


def test_what_spans_decades_is_drawn_by_its_logarithm():
    problem = Problem(VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=1.0), UNIT_NOISE)
    surface = surface_of(ExponentSolver(problem, rtol=1e-4).pair(2.0), "T")
    low, high = surface.limits
    assert 0 < 1e3 * low < high
    assert figure_of(surface, "viridis").axes[-1].get_yscale() == "log"


def test_what_cannot_be_drawn_is_refused(pair):
    with pytest.raises(ValueError, match="got field = 'density'; must be one of 'T', 'T_adjoint', 'tilted_density'"):
        draw_eigenfunction(pair, "density")


@pytest.mark.slow
def test_solving_loads_nothing_that_draws():
    code = """
import sys
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.problem import Problem
from tests.conftest import FIG1, UNIT_NOISE
ExponentSolver(Problem(FIG1, UNIT_NOISE)).pair(2.0)
print([name for name in ("pyvista", "matplotlib", "vtkmodules") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
