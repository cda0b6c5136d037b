"""What figures, tables and sentences say of systems and noise of one's own: symbols, units, impacts, derivatives."""

from collections import Counter

import numpy as np
import pytest
import pyvista
from matplotlib.figure import Figure

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.analysis import stationary_density, tilted_density
from fpsolve.data import plain_unit, short_names
from fpsolve.drawing import is_math, plain_numbers, typeset
from fpsolve.errors import OutputError
from fpsolve.exponent import ExponentSolver, critical_impact_factor, critical_restitution
from fpsolve.messages import Code
from fpsolve.model import (
    Bounded,
    MarkovChain,
    ParametricOscillator,
    Telegraph,
    VibroImpactOscillator,
    White,
    noise_kind,
)
from fpsolve.model.kinds import NOISES
from fpsolve.output.eigenfunctions import draw_eigenfunction, surface_of
from fpsolve.output.figures import main_figure
from fpsolve.page.terminal import print_blocks
from fpsolve.parts.eigenfunctions import PART, write_eigenfunctions
from fpsolve.parts.surfaces import figure_of
from fpsolve.show.notes import left_out, notes, shows_perturbed_moments
from fpsolve.show.results import show
from fpsolve.simulation import MonteCarlo
from fpsolve.simulation.estimators import MomentEstimate
from fpsolve.workflow import run
from tests.kit import ALL, case_in, solve_case, solve_sets
from tests.output.eigenfunctions import integral

OWN = """
title = "mine"
[system]
variables = ["x", "v"]
drift = ["v", "-k*x - 2*s*v - load*x"]
parameters = { k = 1.0, s = 0.1 }
noises = { load = "noise.axial" }
[noise.axial]
kind = "KIND"
"""
KINDS = {"telegraph": "a = 0.5\nk = 1.0\n", "white": "s = 0.5\n", "ornstein-uhlenbeck": "alpha = 1.0\nsigma = 0.5\n"}
CHAIN = MarkovChain([0.4, -0.5, 0.4], [[-1.0, 0.4, 0.6], [0.2, -0.5, 0.3], [0.0, 2.0, -2.0]])
MOMENTS = "[moments]\np = [1.0, 2.0, 4.0]\n"
RATES = np.array([[0.0, 1.0], [-1.0, -0.2]]), np.array([[0.0, 0.0], [-1.0, 0.0]])
"""Of ẍ + 0.2ẋ + (1 + ξ)x = 0, without the noise and with it."""


def form_of(noise):
    """Λ(2), and T(φ, ξ_i) = eᵀM_i e up to a factor, from AᵢᵀMᵢ + MᵢAᵢ + Σⱼ qᵢⱼMⱼ = ΛMᵢ, for white noise + s²BᵀMB."""
    (still, driven), one = RATES, np.eye(2)
    matrices = [still + each * driven for each in noise.states]
    blocks = [np.kron(each.T, one) + np.kron(one, each.T) for each in matrices]
    if noise.is_white:
        blocks[0] = blocks[0] + noise.s**2 * np.kron(driven.T, driven.T)
    count = len(blocks)
    total = np.kron(np.array(noise.rates), np.eye(4))
    for i, block in enumerate(blocks):
        total[4 * i : 4 * i + 4, 4 * i : 4 * i + 4] += block
    values, vectors = np.linalg.eig(total)
    at = int(np.argmax(values.real))
    forms = vectors[:, at].real.reshape(count, 2, 2)

    def form(phi):
        e = np.stack([np.cos(phi), -np.sin(phi)], axis=1)
        return np.einsum("ia,sab,ib->is", e, forms, e)

    return values[at].real, form


def own(kind):
    return OWN.replace("KIND", kind) + KINDS[kind]


def signs(problem):
    return [each.quantity.shown.strip("$") for each in problem.parameters.values()]


@pytest.mark.parametrize("kind", KINDS)
def test_no_two_parameters_of_a_problem_have_one_symbol(kind, tmp_path):
    case = case_in(tmp_path, own(kind) + MOMENTS)
    assert max(Counter(signs(case.problem)).values()) == 1
    assert [case.about(f"system.{name}").shown for name in "ks"] == ["k", "s"]
    assert all(is_math(each.quantity.shown) for each in case.parameters.values())


def test_the_noise_is_named_where_it_shares_a_symbol(tmp_path):
    case = case_in(tmp_path, own("white") + MOMENTS)
    assert case.about("noise.axial.s").stated(0.5) == r"${s}_{\mathrm{axial}}$ = 0.5"
    unnamed = PlaneSystem.of_equations(("x", "v"), ("v", "-x - s*v - xi*x"), {"s": 0.1})
    assert Problem(unnamed, White(s=0.5)).parameters["noise.s"].quantity.shown == r"${s}_{\xi}$"


def test_symbols_of_the_kinds_differ():
    """Of the oscillator with noise in its stiffness and of every noise that has parameters of its own."""
    system = ParametricOscillator(stiffness=1.0, damping=0.1)
    for noise in (Telegraph(a=0.5, k=1.0), White(s=0.5), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)):
        of_system, of_noise = ([each.quantity_of(name).latex for name in each.values] for each in (system, noise))
        assert not set(filter(None, of_system)) & set(of_noise)
    stated = [field.json_schema_extra["symbol"] for kind in map(noise_kind, NOISES) for field in kind.fields().values()]
    assert r"$\kappa$" not in stated


def test_one_symbol_for_two_parameters_is_refused(tmp_path):
    text = own("white").replace("k = 1.0, s = 0.1", 'k = { value = 1.0, symbol = "s" }, s = 0.1')
    with pytest.raises(Exception, match="got the symbol s of two parameters; all must differ; choose another one"):
        case_in(tmp_path, text + MOMENTS)


def test_columns_are_told_apart(tmp_path):
    case = case_in(tmp_path, own("telegraph") + MOMENTS + '[vary]\n"system.k" = [1.0]\n"noise.axial.k" = [1.0]\n')
    assert short_names(case.vary.keys) == ["system.k", "noise.axial.k"]
    assert short_names(["system.k", "noise.a"]) == ["k", "a"]


@pytest.mark.parametrize(
    ("unit", "drawn", "said"),
    [
        ("1/time^(1/2)", "1/time$^{1/2}$", "1/sqrt(time)"),
        ("1/time^(3/2)", "1/time$^{3/2}$", "1/time^1.5"),
        ("kg m^-2", "kg m$^{-2}$", "kg m^-2"),
        ("1/time²", "1/time²", "1/time²"),
        ("$m^2$", "$m^2$", "$m^2$"),
    ],
)
def test_powers_in_units_are_typeset(unit, drawn, said):
    assert typeset(unit) == drawn
    assert is_math(drawn)
    assert plain_unit(unit) == said


def test_a_unit_that_is_not_known_is_left_out(tmp_path):
    case = case_in(tmp_path, own("white") + MOMENTS)
    assert case.about("system.k").title == "parameter k"
    assert case.about("noise.axial.s").title == r"intensity of white noise ${s}_{\mathrm{axial}}$"


def test_a_simulation_without_estimates_has_no_legend():
    nothing = (MomentEstimate(2.0, None, None, "direct", 10.0),)
    found = MonteCarlo(nothing, 0.0, 0.1, 0.0, 0.1, paths=32, time=1.0, step=0.1, seed=0, impacts=0, warnings=())
    axes = found.plot(Figure().subplots())
    assert not axes.containers


def test_the_name_of_the_noise_is_asked_for(tmp_path):
    text = own("white").replace('noises = { load = "noise.axial" }\n', "").replace("[noise.axial]", "[noise]")
    with pytest.raises(Exception, match=r'or name the noise, noises = \{ load = "noise" \}'):
        case_in(tmp_path, text + MOMENTS)


@pytest.mark.parametrize(("start", "stop"), [(1.0, 4.0), (2.0, 8.0), (0.9, 4.5), (1.0, 2.0), (0.3, 0.5)])
def test_short_logarithmic_axes_have_round_ticks(pictures, start, stop):
    figure = Figure()
    axes = figure.subplots()
    axes.set(xscale="log", xlim=(start, stop))
    plain_numbers(axes.xaxis)
    figure.draw_without_rendering()
    inside = [tick for tick in axes.get_xticks() if start <= tick <= stop]
    assert len(inside) >= 3
    assert all(len(f"{tick:.6g}".replace(".", "").strip("0")) <= 2 for tick in inside if stop > 2.5 * start)
    assert not axes.xaxis.get_minorticklocs().size


def test_a_short_list_of_moments_is_on_an_even_axis(drawn, tmp_path):
    case = case_in(tmp_path, own("telegraph") + MOMENTS + '[output]\nquantities = ["moment"]\n')
    main_figure(case, solve_case(case), []).write(tmp_path)
    assert drawn[0].axes[0].get_xscale() == "linear"


def test_nothing_is_said_of_impacts_where_there_are_none(tmp_path, capsys):
    [silent] = solve_case(case := case_in(tmp_path, own("telegraph") + MOMENTS))
    assert not [note for note in silent.notes if note.tells_of(Code.NOT_ONE_RAY)]
    print_blocks([*show(case, [silent], tmp_path), *notes(case, [silent])])
    assert "R_c" not in "".join(capsys.readouterr())
    asked = case_in(tmp_path, own("telegraph") + MOMENTS + '[output]\nquantities = ["impact_rate"]\n')
    [told] = solve_case(asked)
    assert [note for note in told.notes if note.tells_of(Code.NOT_ONE_RAY)]
    print_blocks([*show(asked, [told], tmp_path), *notes(asked, [told])])
    assert "no N" in "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("parameters", "restitution", "symbol"),
    [({"r": 0.8}, "r", "r"), ({"loss": 0.2}, "1 - loss", "R"), ({}, 0.8, "R"), ({"e": 0.8}, "e**2", "e")],
)
def test_what_is_stable_for_every_restitution_names_it(parameters, restitution, symbol):
    wall = {"at": "x = 0", "restitution": restitution}
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.2*v - xi*x"), parameters, walls=[wall])
    found = critical_restitution(ExponentSolver(Problem(system, MarkovChain.telegraph(0.3, 1.0))))
    assert found.reason.code is Code.ALWAYS_STABLE
    assert f"for every {symbol} in (0, 1]" in found.reason
    assert VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1).impact_symbol == "r"


def test_an_overdamped_motion_has_no_impacts():
    system = ParametricOscillator(stiffness=1.0, damping=3.0, restitution=0.9)
    found = critical_impact_factor(ExponentSolver(Problem(system, Telegraph(a=0.5, k=1.0))))
    assert found.reason.code is Code.RARE_IMPACTS
    assert "as if the motion did not turn" in found.reason


@pytest.mark.parametrize(("is_map", "is_shown"), [("true", False), ("false", True)])
def test_a_map_shows_no_perturbation_theory(tmp_path, is_map, is_shown):
    vary = '[vary]\n"system.k" = [1.0, 2.0]\n"noise.axial.s" = [0.1, 0.2, 0.3]\n'
    figure = f'[figure]\nx = "system.k"\ny = {{ moment = 2.0 }}\nmap = {is_map}\n'
    case = case_in(tmp_path, own("white") + MOMENTS + vary + figure)
    assert shows_perturbed_moments(case, 6) == is_shown


@pytest.mark.parametrize("noise", [Telegraph(a=0.5, k=1.0), White(s=0.5), CHAIN], ids=lambda noise: noise.kind)
def test_eigenfunctions_of_noise_with_states_are_strips(noise, tmp_path):
    """T of p = 2 is a quadratic form; T T* is a density; the number of a state is y."""
    solver = ExponentSolver(Problem(ParametricOscillator(stiffness=1.0, damping=0.1), noise))
    _, *files = write_eigenfunctions(tmp_path, [solver.pair(2.0)], solver.pair(0.0))
    [grid] = map(pyvista.read, files)
    value, form = form_of(noise)
    assert grid.field_data["Lambda"][0] == pytest.approx(value, rel=1e-9)
    state = np.round(grid.points[:, 1]).astype(int) - 1
    assert sorted(set(state)) == list(range(len(noise.states)))
    expected = form(grid.points[:, 0])[np.arange(state.size), state]
    np.testing.assert_allclose(grid["T"] / grid["T"].max(), expected / expected[grid["T"].argmax()], atol=1e-6)
    for name in ("tilted_density", "stationary_density"):
        assert integral(grid, name) == pytest.approx(0.8, abs=1e-4)  # a strip is 0.8 wide


def test_eigenfunctions_of_white_noise_are_written(tmp_path):
    text = (
        own("white")
        + 'interpretation = "ito"\n[moments]\np = [2.0]\n[output]\neigenfunctions = [2.0]\nfigure = false\n'
    )
    run(case_in(tmp_path, text), tmp_path)
    facts = pyvista.read(tmp_path / "test/eigenfunctions/p+2.0.vtu").field_data
    assert bytes(facts["along_y"]).decode() == "white noise"
    assert np.isnan(facts["impacts"]).tolist() == [True]
    assert (tmp_path / "test/density.vtu").is_file()


SEVERAL = """
title = "two noises"
[system]
variables = ["x", "v"]
drift = ["v", "-(1 + a + b)*x - 0.2*v"]
noises = { a = "noise.a", b = "noise.b" }
[noise.a]
kind = "telegraph"
a = 0.3
k = 1.0
[noise.b]
kind = "telegraph"
a = 0.2
k = 2.0
[moments]
p = [2.0]
[output]
quantities = ["moment", "eigenfunctions"]
"""


def test_eigenfunctions_of_several_noises_with_values_are_refused_in_words(tmp_path):
    case = case_in(tmp_path, SEVERAL)
    [solved] = solve_sets(case)
    assert not solved.pictures
    [note, *_] = left_out(case, monte_carlo=False)
    assert "no eigenfunctions are written: an eigenfunction of the phase and of several noises" in note.text
    pair = ExponentSolver(case.problem).pair(2.0)
    for draw_it in (draw_eigenfunction, tilted_density):
        with pytest.raises(OutputError, match="make all of these noises white but one"):
            draw_it(pair)
    assert max(Counter(signs(case.problem)).values()) == 1
    assert case.about("noise.b.k").shown == r"${k}_{\mathrm{b}}$"


def test_noise_without_a_picture_is_named():
    problem = Problem(ParametricOscillator(stiffness=1.0, damping=0.1), Bounded(mu=0.4, nu=2.0, sigma=0.3))
    assert problem.no_picture.startswith("bounded noise is no Markov process by itself")
    assert not Problem(problem.system, White(s=0.5)).no_picture


def test_files_say_where_the_impacts_are(tmp_path):
    walled = own("telegraph").replace("noises", 'walls = [{ at = "x = 0", restitution = 0.95 }]\nnoises', 1)
    case = case_in(tmp_path, walled + "[moments]\np = [2.0]\n")
    [solved] = solve_sets(case)
    PART.draw(solved.pictures[PART.name], solved.result.curve, tmp_path)
    facts = pyvista.read(tmp_path / "eigenfunctions/p+2.0.vtu").field_data
    assert facts["impacts"] == pytest.approx([np.pi / 2, 1.5 * np.pi], abs=1e-11)
    assert bytes(facts["along_y"]).decode() == "states; xi = -0.5; xi = 0.5"


@pytest.mark.parametrize("noise", [Telegraph(a=0.5, k=1.0), White(s=0.5)], ids=lambda noise: noise.kind)
def test_python_draws_lines_for_states(noise):
    solver = ExponentSolver(Problem(ParametricOscillator(stiffness=1.0, damping=0.1, restitution=0.8), noise))
    assert draw_eigenfunction(solver.pair(2.0)).png.startswith(b"\x89PNG")
    figure = figure_of(surface_of(solver.pair(2.0), "T"), "viridis")
    lines = [line for line in figure.axes[0].lines if line.get_label().startswith(r"$\xi$")]
    assert len(lines) == len(noise.states)
    assert figure.axes[0].get_ylabel().startswith("eigenfunction")
    axes = stationary_density(solver.pair(0.0)).plot(Figure().subplots())
    assert len(axes.lines) == len(noise.states)
    assert axes.get_ylabel() == "density (1/rad)"


def test_parameters_without_a_derivative_are_named(tmp_path):
    """d sqrt(c)/dc is infinite at 0."""
    text = own("telegraph").replace("2*s*v", "(2*s + sqrt(c))*v").replace("s = 0.1", "s = 0.1, c = 0.0")
    [result] = solve_case(case_in(tmp_path, text + MOMENTS, [ALL]))
    assert "system.c" not in result.sensitivities.theta
    assert "no sensitivities to system.c: the derivative of the system by it is not finite at 0" in result.notes


def test_parameters_that_nothing_depends_on_are_named(tmp_path):
    text = own("telegraph").replace("s = 0.1", "s = 0.1, unused = 3.0, loss = 0.1")
    case = case_in(tmp_path, text + MOMENTS)
    assert list(case.problem.remarks) == [
        "system.unused, system.loss: in no rate and in no restitution, so that no result depends on it"
    ]
    assert case.problem.remarks[0] in solve_case(case)[0].notes
    walled = text.replace("[noise.axial]", 'walls = [{ at = "x = 0", restitution = "1 - loss" }]\n[noise.axial]')
    assert "loss" not in case_in(tmp_path, walled + MOMENTS).problem.remarks[0]


def test_infinite_derivatives_are_of_systems_only():
    for noise in (Telegraph(a=0.5, k=1.0), White(s=0.5), MarkovChain.telegraph(0.5, 1.0)):
        assert not Problem(ParametricOscillator(stiffness=1.0, damping=0.1), noise).undifferentiable
