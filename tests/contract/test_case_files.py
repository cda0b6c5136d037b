"""Case files that are right: what they mean, in every spelling, and the schema that editors check them by."""

import json
import tomllib
from functools import partial

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from pydantic import ValidationError
from scipy import sparse
from scipy.io import mmwrite, savemat

from fpsolve import CaseError, load_case
from fpsolve.case import Case
from fpsolve.fem import make_mesh, write_mesh
from fpsolve.model import MarkovChain, NonGaussianNoise, ReducedNoise
from fpsolve.theory import second_order
from tests.contract.test_cases import CASES
from tests.kit import case_in, files, run
from tests.snapshots import entries

FILES = sorted(CASES.rglob("*.toml"))
SMALL = """
title = "small"
oscillator = { omega = 2, restitution = 0.9, c1 = 0.1, epsilon = 0.5, impact = "restitution" }
noise = { D0 = 1, tau0 = 1, r0 = 0.9 }
moments.p = [2, -1]
"""
LISTED = '"noise.D0" = { start = 1, stop = 2, num = 5 }'
RANGE = '{ start = 0.1, stop = 10.0, num = 3, scale = "log" }'
SETS = "noise.D0\n0.3\n0.4\n"
EXCEL = '\ufeffnoise.D0,"noise.treatment",oscillator.c1\r\n\r\n0.1,exact,-0\r\n 1e0 ,"ou-reduction",.5\r\n,,\r\n'


def varied(folder, text, *overrides):
    """What varies in the parameter sets of a case."""
    case = case_in(folder, f"{SMALL}[vary]\n{text}\n", overrides)
    found = [tuple(parameter_set.varied.values()) for parameter_set in case.sets()]
    assert [each.number for each in case.sets()] == [*range(1, case.planned + 1)]
    assert case.planned == len(found)
    assert [*case.sets(1)] == [*case.sets()][1:]
    assert repr(found) == repr([tuple(each or 0.0 for each in row) for row in found])  # no -0.0
    return found


@pytest.mark.parametrize(
    ("text", "overrides", "sets"),
    [
        ("", [], [()]),
        ('mode = "zip"', [], [()]),
        ('"noise.D0" = [1, 2.5]\n"oscillator.omega" = [3, 0.5]', [], [(1, 3), (1, 0.5), (2.5, 3), (2.5, 0.5)]),
        ('mode = "zip"\nnoise.D0 = [1, 2, 1]\nnoise.r0 = [0.9, 0.9, 0.8]', [], [(1, 0.9), (2, 0.9), (1, 0.8)]),
        ('mode = "zip"\nnoise.D0 = [1, 2]\nnoise.r0 = { start = 0, stop = 0.5, num = 2 }', [], [(1, 0), (2, 0.5)]),
        (
            'noise.treatment = ["exact", "ou-reduction"]\nnoise.D0 = [1]',
            [],
            [("exact", 1), ("ou-reduction", 1)],
        ),
        *(
            (text, [], [(0.1,), (1.0,), (10.0,)])
            for text in (
                f'"noise.D0" = {RANGE}',
                f"noise.D0 = {RANGE}",
                f"noise = {{ D0 = {RANGE} }}",
                "noise.D0.start = 0.1\nnoise.D0.stop = 10.0\nnoise.D0.num = 3\nnoise.D0.scale = 'log'",
                "[vary.noise.D0]\nstart = 0.1\nstop = 10.0\nnum = 3\nscale = 'log'",
            )
        ),
        ('file = "sets.csv"', [], [(0.3,), (0.4,)]),
        ('file = "sets.csv"\nmode = "zip"', [], [(0.3,), (0.4,)]),
        ('file = "excel.csv"', [], [(0.1, "exact", 0.0), (1.0, "ou-reduction", 0.5)]),
        (LISTED, ["vary.noise.D0.num=3"], [(1,), (1.5,), (2,)]),
        (LISTED, ['vary."noise.D0"=[4.0]'], [(4,)]),
        ("noise.D0 = [1]", ["vary.noise.D0=[2]"], [(2,)]),
        ("", ['vary={"noise.D0"=[2]}'], [(2,)]),
        (LISTED, [f"vary.noise.D0={RANGE}"], [(0.1,), (1,), (10,)]),
        (LISTED, ['vary={ file = "sets.csv" }'], [(0.3,), (0.4,)]),
        ('file = "other.csv"', ["vary.file=sets.csv"], [(0.3,), (0.4,)]),
        ('file = "other.csv"', ["vary={}"], [()]),
    ],
)
def test_sets_of_lists_ranges_and_files_of_sets(tmp_path, text, overrides, sets):
    (tmp_path / "sets.csv").write_text(SETS)
    (tmp_path / "excel.csv").write_bytes(EXCEL.encode())
    assert varied(tmp_path, text, *overrides) == sets


@pytest.mark.parametrize(
    ("start", "stop", "scale", "values"),
    [
        (1e-4, 1e-1, "log", [1e-4, 1e-3, 1e-2, 1e-1]),
        (1e-15, 1e15, "log", [float(f"1e{power}") for power in range(-15, 16)]),
        (1.0, 2.0, "log", [1.0, 1.41421356237, 2.0]),
        (0.1234567890123456, 0.3, "log", [0.1234567890123456, 0.3]),
        (1e-15, 5e-15, "linear", [1e-15, 2e-15, 3e-15, 4e-15, 5e-15]),
        (0.2, 0.6, "linear", [0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6]),
    ],
)
def test_values_of_a_range_have_no_needless_digits(tmp_path, start, stop, scale, values):
    text = f'noise.D0 = {{ start = {start}, stop = {stop}, num = {len(values)}, scale = "{scale}" }}'
    assert repr(varied(tmp_path, text)) == repr([(each,) for each in values])


def test_orders_of_moments_in_a_range_pass_zero_exactly(tmp_path):
    case = case_in(tmp_path, SMALL, ["moments.p={ start = -0.3, stop = 0.1, num = 5 }"])
    assert repr(case.p.tolist()) == repr([-0.3, -0.2, -0.1, 0.0, 0.1])


@pytest.mark.slow
def test_a_hundred_thousand_values_are_read_within_seconds_and_one_more_is_refused(tmp_path):
    numbers = [f"0.{i:06}" for i in range(1, 100_002)]
    most, more = (f"[{', '.join(each)}]" for each in (numbers[:-1], numbers))
    case = case_in(tmp_path, SMALL.replace("[2, -1]", most) + f"output.eigenfunctions = {most}")
    assert case.p.size == len(case.output.eigenfunctions) == 100_000
    with pytest.raises(CaseError, match=r"monte_carlo.p: has the length 100001; must be at most 100000(?s:.)*noise.D0"):
        case_in(tmp_path, f'{SMALL}monte_carlo.p = {more}\nvary."noise.D0" = {more}')


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ("oscillator.omega=3.5", "oscillator.omega", 3.5),
        ("oscillator.omega = 3", "oscillator.omega", 3.0),
        ('oscillator.impact="delta"', "oscillator.impact", "delta"),
        ("oscillator.impact=delta", "oscillator.impact", "delta"),
        ("noise.treatment=exact", "noise.treatment", "exact"),
        ("noise={D0=1, tau0=1, r0=0.5}", "noise.r0", 0.5),
        ("'noise'.\"r0\"=-1", "noise.r0", -1.0),
    ],
)
def test_override_of_a_parameter(tmp_path, override, key, value):
    assert next(case_in(tmp_path, SMALL, [override]).sets()).parameters[key] == value


def test_later_overrides_win_and_tables_replace_tables(tmp_path):
    overrides = ["moments.p=[1.0]", "moments.p={start=0, stop=1, num=3}", "mesh={}", "mesh.xi_cells=7"]
    overrides += ["output.eigenfunctions=[]", "moments.rtol=1e-6", "title=Two words"]
    case = case_in(tmp_path, SMALL + "[mesh]\nphi_cells = 3\n", overrides)
    assert (case.p.tolist(), case.output.eigenfunctions, case.rtol) == ([0.0, 0.5, 1.0], (), 1e-6)
    assert (case.title, case.mesh.model_dump(exclude_none=True)) == ("Two words", {"xi_cells": 7})


def test_a_case_made_in_python_is_checked_and_frozen():
    data = tomllib.loads(SMALL)
    case = Case.model_validate(data)
    with pytest.raises(ValidationError, match="figure"):
        Case.model_validate(data | {"figure": {"x": "noise.D0", "y": "stability_index"}})
    with pytest.raises(ValidationError, match="frozen"):
        case.title = "other"


def test_a_case_is_read_with_line_ends_of_windows_and_by_a_link(tmp_path):
    (tmp_path / "windows.toml").write_bytes(SMALL.replace("\n", "\r\n").encode())
    (tmp_path / "link.toml").symlink_to("windows.toml")
    assert load_case(tmp_path / "link.toml").title == "small"


def test_labels_and_heading_of_sets(tmp_path):
    text = '[vary]\nnoise.treatment = ["ou-reduction", "exact"]\noscillator.omega = [3, 0.0001]\n'
    case = case_in(tmp_path, SMALL + text)
    *_, last = case.sets()
    assert (last.suffix, last.label) == ("-4", "noise.treatment = exact, oscillator.omega = 0.0001")
    assert case.heading(last) == "small: noise.treatment = exact, oscillator.omega = 0.0001"
    assert case.about("oscillator.omega").title == r"natural frequency $\omega$ (rad/time)"
    [alone] = case_in(tmp_path, SMALL).sets()
    assert (alone.suffix, alone.label) == ("", "")


def test_reduced_and_exact_noise_have_one_perturbation_theory(tmp_path):
    case = case_in(tmp_path, SMALL + 'vary.noise.treatment = ["ou-reduction", "exact"]')
    reduced, exact = case.sets()
    assert reduced.noise == ReducedNoise(D0=1.0, tau0=1.0, r0=0.9)
    assert exact.noise == reduced.noise.at({"treatment": "exact"}) == NonGaussianNoise(D0=1.0, tau0=1.0, r0=0.9)
    assert len({second_order(each.problem).moment_exponent(2.0) for each in (reduced, exact)}) == 1


def test_an_expectation_selects_sets_by_their_values(tmp_path):
    text = 'vary = { "noise.treatment" = ["ou-reduction", "exact"], "noise.D0" = [1, 2] }\n[[expect]]\n'
    text += 'quantity = "variance_rate"\nvalue = 1\natol = 9\nsource = "none"\n'
    text += 'where = { noise.treatment = "exact", noise.D0 = 2 }\n'
    case = case_in(tmp_path, SMALL + text)
    assert [case.expect[0].selects(each.varied) for each in case.sets()] == [False, False, False, True]


def test_a_mesh_is_made_from_numbers_or_read_beside_the_case(tmp_path):
    mesh = case_in(tmp_path, SMALL + "[mesh]\nphi_cells = 3\nxi_min = -5\nxi_max = 9\n").cylinder_mesh()
    assert (mesh.phi_lines.size, mesh.z_lines[0], mesh.z_lines[-1]) == (4, -5, 9)
    (tmp_path / "inner").mkdir()
    write_mesh(make_mesh(phi_cells=3), tmp_path / "inner/mesh.vtu")
    assert case_in(tmp_path, SMALL + '[mesh]\nfile = "inner/mesh.vtu"\n').cylinder_mesh().phi_lines.size == 4


MANY = '[vary]\n"noise.D0" = { start = 0.1, stop = 0.2, num = 11 }\n'
NONLINEAR = "oscillator.c2=0.5"
ALL = {"moment_derivative", "rate_function", "variance_rate", "critical_restitution", "excursions", "sensitivities"}
CHEAP = {"moment", "lyapunov_exponent", "stability_index", "impact_rate", "critical_impact_factor", "eigenfunctions"}


@pytest.mark.parametrize(
    ("text", "overrides", "asked"),
    [
        ("", [], CHEAP),
        ("", ['output.quantities="all"'], CHEAP | ALL),
        ("", ['output.quantities=["stability_index", "moment"]'], {"stability_index", "moment"}),
        ("", [NONLINEAR], CHEAP | {"response"}),
    ],
)
def test_quantities_that_a_case_asks_for(tmp_path, text, overrides, asked):
    assert {*case_in(tmp_path, SMALL + text, overrides).asked} == asked


@pytest.mark.parametrize(
    ("text", "overrides", "found"),
    [
        ("", [], (False, False)),
        ("", [NONLINEAR], (True, False)),
        (MANY.replace("11", "10"), [NONLINEAR], (True, False)),
        (MANY, [NONLINEAR], (False, True)),
        (MANY, [NONLINEAR, 'output.quantities=["response"]'], (True, False)),
        (MANY, [], (False, False)),
        ("", ['output.quantities=["response"]'], (True, False)),
        ("", [NONLINEAR, "response.off=true"], (False, False)),
        ("", ['vary."oscillator.c3"=[0.0, 0.2]'], (True, False)),
    ],
)
def test_response_is_computed_unasked_of_up_to_ten_nonlinear_sets(tmp_path, text, overrides, found):
    case = case_in(tmp_path, SMALL + text, overrides)
    assert ("response" in case.asked, case.leaves_out_response) == found


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (
            'kind = "ou-reduction"\nD0 = 1.0\ntau0 = 0.5\nr0 = 0.9',
            "D0 = 1\ntau0 = 0.5\nr0 = 0.9\ntreatment = 'ou-reduction'",
        ),
        ('kind = "non-gaussian"\nD0 = 1.0\ntau0 = 0.5\nr0 = 0.9', "D0 = 1\ntau0 = 0.5\nr0 = 0.9\ntreatment = 'exact'"),
        (
            'kind = "markov-chain"\nstates = [-0.5, 0.5]\nrates = [[0, 1], [1, 0]]',
            'kind = "markov-chain"\nstates = [-0.5, 0.5]\nrates = [[-1, 1], [1, -1]]',
        ),
    ],
)
def test_one_noise_in_two_spellings(tmp_path, one, other):
    base = SMALL.replace("noise = { D0 = 1, tau0 = 1, r0 = 0.9 }\n", "")
    first, second = (case_in(tmp_path, f"{base}[noise]\n{each}").problem for each in (one, other))
    assert first == second
    assert "chain" not in one or first.noise == MarkovChain((-0.5, 0.5), ((-1.0, 1.0), (1.0, -1.0)))


@pytest.mark.parametrize("pair", [("alpha", "sigma"), ("alpha", "standard_deviation"), ("D0", "tau0")])
def test_ornstein_uhlenbeck_noise_by_either_pair_is_one_law(tmp_path, pair):
    values = {"alpha": 0.5, "sigma": 0.5, "standard_deviation": 0.5, "D0": 0.5, "tau0": 2.0}
    base = SMALL.replace("D0 = 1, tau0 = 1, r0 = 0.9", ", ".join(f"{each} = {values[each]}" for each in pair))
    case = case_in(tmp_path, base.replace("noise = {", 'noise = { kind = "ornstein-uhlenbeck",'))
    assert case.noise.values == {each: values[each] for each in pair}
    assert [case.noise.alpha, case.noise.sigma, case.noise.standard_deviation] == pytest.approx([0.5] * 3)
    assert set(case.problem.differentiable) >= {f"noise.{name}" for name in pair}


def test_the_oscillator_is_a_system_of_kind_vibro_impact(tmp_path):
    named = SMALL.replace("oscillator = {", 'system = { kind = "vibro-impact",')
    assert case_in(tmp_path, named).problem == case_in(tmp_path, SMALL).problem


OWN = """
title = "own"
moments.p = [2]
[system]
variables = ["x", "v"]
drift = ["v", "-omega**2*x - 2*zeta*omega*v - load*x"]
parameters = { omega = 1.0, zeta = { value = 0.1, symbol = "\\\\zeta", unit = "1", words = "damping ratio" } }
noises = { load = "noise.axial" }
[noise.axial]
kind = "telegraph"
a = 0.5
k = 1.0
"""


def test_names_of_parameters_and_noises_of_equations(tmp_path):
    case = case_in(tmp_path, OWN, ["system.zeta=0.2"])
    assert [*case.parameters] == ["system.omega", "system.zeta", "noise.axial.a", "noise.axial.k"]
    assert case.about("system.zeta").title == r"damping ratio $\zeta$"
    plain = OWN.replace("noise.axial", "noise").replace("load", "xi").replace('noises = { xi = "noise" }\n', "")
    other = case_in(tmp_path, plain)
    assert [*other.parameters][2:] == ["noise.a", "noise.k"]
    assert other.system.terms == case_in(tmp_path, OWN, ["system.parameters.zeta=0.1"]).system.terms


@pytest.mark.parametrize(
    ("overrides", "same"),
    [
        (['system.parameters.zeta={ value = 0.1, unit = "1/time" }', "output.figure=false"], True),
        (["vary.system.zeta=[0.1, 0.3]"], True),
        (["system.zeta=0.1000001"], False),
        (["vary.system.zeta=[0.3, 0.1]"], False),
        (['system.drift=["v", "-omega**2*x - 3*zeta*omega*v - load*x"]'], False),
        (["noise.axial.k=2.0"], False),
        (['noise.axial={ kind = "sine-wiener", amplitude = 0.5, sigma = 1.0 }'], False),
    ],
)
def test_digest_of_a_set_follows_from_its_problem_alone(tmp_path, overrides, same):
    known, found = (next(case_in(tmp_path, OWN, each).sets()).digest for each in ([], overrides))
    assert (known == found) is same


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_shipped_case_is_read_and_its_sets_differ(path):
    case = load_case(path)
    parameter_sets = [*case.sets()]
    assert (case.name, case.path) == (path.stem, path)
    assert all(tuple(each.varied) == case.vary.keys for each in parameter_sets)
    assert len({each.digest for each in parameter_sets}) == case.planned == len(parameter_sets)
    assert all(each.parameters == each.problem.values for each in parameter_sets)


MODES = """
title = "Three masses"
moments.p = [2]
[system]
kind = "modes"
mass = [[1, 0, 0], [0, 2, 0], [0, 0, 1]]
stiffness = [[2, -1, 0], [-1, 2, -1], [0, -1, 1]]
damping = [[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.1]]
stiffness_noise = { a = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], b = [[0, 0, 0], [0, 1, 0], [0, 0, 0]] }
noises = { a = "noise.first", b = "noise.second" }
[noise]
first = { kind = "white", s = 0.1 }
second = { kind = "white", s = 0.2 }
"""


SYSTEM = MODES[MODES.index("[system]") : MODES.index("noises =")]
LINEAR, RATES = (
    MODES.replace(SYSTEM, f"[system]\n{own}\n")
    for own in (
        """kind = "linear"
matrix = [[0, 1, 0], [-1, -0.2, 0.3], [0, -0.3, -1]]
noise_matrices = { a = [[0, 0, 0], [-1, 0, 0], [0, 0, 0]], b = [[0, 0, 0], [0, -1, 0], [0, 0, 0.5]] }
variables = ["x", "v", "u"]""",
        """variables = ["x", "v", "u"]
drift = ["v", "-x - 0.2*v + 0.3*u - a*x - b*v", "-0.3*v - u + 0.5*b*u"]""",
    )
)
WRITERS = {
    ".mat": lambda path, each: savemat(path, {"A": sparse.csc_array(each)}),
    ".npy": np.save,
    ".mat:B": lambda path, each: savemat(path[:-2], {"A": each.T, "B": each}),
    ".mtx": lambda path, each: mmwrite(path, sparse.csr_array(each)),
    ".csv": partial(np.savetxt, delimiter=","),
}


@pytest.mark.parametrize("text", [MODES, LINEAR])
def test_matrices_in_files_are_those_in_the_case_wherever_a_design_puts_it(tmp_path, text):
    here, changes, system = case_in(tmp_path, text), [], tomllib.loads(text)["system"]
    key = next(each for each in ("stiffness_noise", "noise_matrices") if each in system)
    system |= {f"{key}.{name}": each for name, each in system[key].items()}
    stated = [(key, each) for key, each in system.items() if np.ndim(each) == 2]
    for (key, each), (ending, write) in zip(stated, WRITERS.items(), strict=False):
        write(str(tmp_path / f"{key}{ending}"), np.array(each))
        changes.append(f"system.{key}={key}{ending}")
    assert case_in(tmp_path, text, changes).problem == here.problem
    options = [f"--set={each}" for each in changes]
    done = run(tmp_path, "design", "test.toml", "--for", "moment(2) = -0.0775", "--by", "noise.second.s", *options)
    assert (done.code, load_case(tmp_path / "results/test/design.toml").system.terms) == (0, here.system.terms)


def test_a_state_matrix_is_that_of_its_rates_and_one_of_several_in_a_file_has_a_name(tmp_path):
    found, wanted = (case_in(tmp_path, each).problem.linear for each in (LINEAR, RATES))
    assert (found.terms, found.states) == (wanted.terms, wanted.states)
    savemat(tmp_path / "all.mat", {"A": np.eye(3), "B": np.eye(3)})
    with pytest.raises(CaseError, match=r"holds A, B: name one of these, as in all\.mat:A"):
        case_in(tmp_path, LINEAR, ["system.matrix=all.mat"])


FIG1, EQUATIONS, MATHIEU, CHART = "fig1", "systems/own_equation", "systems/stochastic_mathieu", "chart"
FAULTY = [
    (FIG1, "omega = 1.0", 'omega = "1.0"'),
    (FIG1, "omega = 1.0", "omega = 0.0"),
    (FIG1, "omega = 1.0", "omga = 1.0"),
    (FIG1, "restitution = 0.8", "restitution = 1.1"),
    (FIG1, 'impact = "delta"', 'impact = "dleta"'),
    (FIG1, "r0 = 0.95", "r0 = 3.0"),
    (FIG1, "tau0 = 0.5\n", ""),
    (FIG1, 'treatment = "ou-reduction"', 'kind = "ou-reductoin"'),
    (FIG1, "rtol = 1e-8", "rtol = 1.0"),
    (FIG1, "num = 33", "num = 1"),
    (FIG1, "num = 33", "number = 33"),
    (FIG1, "[moments]", "[moment]"),
    (FIG1, "[moments]", "[system]\nkind = 'parametric'\nstiffness = 1.0\ndamping = 0.1\n[moments]"),
    (FIG1, '"noise.D0" = [0.1, 0.5, 1.0]', '"noise.D0" = []'),
    (FIG1, 'y = "moment"', 'y = "moments"'),
    (FIG1, "eigenfunctions = [1.0, 2.0]", 'quantities = ["moment", "lambda"]'),
    (FIG1, 'source = "independent', 'sauce = "independent'),
    (EQUATIONS, 'variables = ["x", "v"]', "variables = []"),
    (EQUATIONS, 'words = "damping ratio"', "words = 3"),
    (EQUATIONS, "sigma = 1.0\n", ""),
    (EQUATIONS, 'kind = "ornstein-uhlenbeck"', 'kind = "white"'),
    (MATHIEU, 'noises = { load = "noise.load", shake = "noise.shake" }', 'noises = ["load", "shake"]'),
    (CHART, "start = 0.3, ", ""),
    (CHART, '"moment(2) = 0", ', "{ moment = 2.0 }, "),
    (CHART, 'scale = "log", at', 'scale = "lg", at'),
]


@pytest.fixture(scope="module")
def schema(tmp_path_factory):
    done = run(tmp_path_factory.mktemp("schema"), "schema")
    [path] = CASES.glob("*.json")
    assert (done.code, done.out) == (0, path.read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(json.loads(done.out))
    return Draft202012Validator(json.loads(done.out))


def test_cases_and_good_cases_of_refusals_meet_the_schema_that_they_name(schema):
    texts = {path: path.read_text(encoding="utf-8") for path in FILES}
    for text in (*texts.values(), *{each.good for each in entries()}):
        schema.validate(tomllib.loads(text))
    named = {path.parent / text.partition("\n")[0].removeprefix("#:schema ") for path, text in texts.items()}
    assert {each.resolve() for each in named} == {*CASES.glob("*.json")}


@pytest.mark.parametrize(("name", "right", "wrong"), FAULTY)
def test_a_wrong_shape_is_refused_by_the_schema_and_by_fpsolve(schema, tmp_path, name, right, wrong):
    text = (CASES / f"{name}.toml").read_text(encoding="utf-8")
    assert right in text
    with pytest.raises(CaseError):
        case_in(tmp_path, text.replace(right, wrong))
    assert not schema.is_valid(tomllib.loads(text.replace(right, wrong)))


def test_examples_of_the_schema_are_meant_for_their_keys(schema):
    """Of each key of a system or a noise the example is one of that key, and is valid there."""
    tables = {name: each for name, each in schema.schema["$defs"].items() if name.startswith(("system", "noise"))}
    assert len(tables) > 12
    for table in tables.values():
        for key, field in table["properties"].items():
            assert field["description"]
            for example in field.get("examples", []):
                [(name, value)] = tomllib.loads(example.partition(" or ")[0]).items()
                assert name == key
                Draft202012Validator({**field, "$defs": schema.schema["$defs"]}).validate(value)


@pytest.mark.parametrize(
    ("arguments", "written"),
    [
        (["fig1"], {"fig1.toml"}),
        (["fig1.toml"], {"fig1.toml"}),
        (["systems/telegraph"], {"telegraph.toml"}),
        (["fig5", "mine.toml"], {"mine.toml", "default.vtu"}),
        (["fig6", "mine.toml"], {"mine.toml", "fine.vtu"}),
        (["beam", "mine.toml"], {"mine.toml", "mass.mtx", "stiffness.mtx", "load.mtx", "damping.mtx"}),
        (["minimal", "."], {"minimal.toml"}),
        (["chart", "deeper/mine.toml"], {"deeper/mine.toml"}),
    ],
)
def test_new_copies_a_case_with_its_schema_and_its_files(tmp_path, arguments, written):
    done = run(tmp_path, "new", *arguments)
    [place] = [each for each in written if each.endswith(".toml")]
    [schema] = [path for path in files(tmp_path) if path.endswith(".json")]
    assert (done.code, done.out) == (0, f"written: {place}\n")
    assert files(tmp_path) - {schema} == written
    copy = load_case(tmp_path / place)
    copy.cylinder_mesh()
    [original] = [path for path in FILES if path.stem == arguments[0].removesuffix(".toml").rpartition("/")[2]]
    text = original.read_text(encoding="utf-8")
    beside = text.replace('"beam/', '"')  # where the matrices are now
    assert "mesh" in copy.model_fields_set or copy.text.partition("\n")[2] == beside.partition("\n")[2]


@pytest.mark.parametrize(
    ("name", "there", "words"),
    [
        ("fig1", "fig1.toml", "fig1.toml is there already"),
        ("fig6", "fine.vtu", "fine.vtu is there already"),
        ("fig7", "a.toml", 'got "fig7"; must be the name of a case; did you mean "fig'),
        ("telegraf", "a.toml", 'did you mean "telegraph"'),
        ("no such thing", "a.toml", "`fpsolve new` lists all"),
    ],
)
def test_new_overwrites_nothing_and_tells_the_nearest_name(tmp_path, name, there, words):
    done = run(tmp_path, "new", name, **{there: "mine"})
    assert done.code == 2
    assert words in done.err
    assert ("did you mean" in done.err) == (name in ("fig7", "telegraf"))
    assert (files(tmp_path), (tmp_path / there).read_text()) == ({there}, "mine")


def test_new_lists_all_cases_with_their_titles(tmp_path):
    lines = run(tmp_path, "new").out.splitlines()
    assert len(lines) == len(FILES)
    assert lines[1].split(maxsplit=1) == ["fig1", load_case(CASES / "fig1.toml").title]
    assert files(tmp_path) == set()
