"""Case files that are right: what they mean, and that the shipped ones say what the paper says."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from fpsolve.case.case import Case, Curve, load_case
from fpsolve.case.sections import Moments
from fpsolve.case.toml import read_document
from fpsolve.fem.mesh import make_mesh, write_mesh
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import ImpactLaw, VibroImpactOscillator
from fpsolve.study.solve import everything
from tests.oracles import perturbation

CASES, FIRST = Path(__file__).parents[2] / "cases", Path(__file__).parents[1] / "first"
FIGURES = ["fig1", "fig2a", "fig2b", "fig2c", "fig3", "fig4", "fig5", "fig6"]
SMALL = """
title = "small"
oscillator = { omega = 2, restitution = 1, c1 = -1, epsilon = 1 }
noise = { D0 = 1, tau0 = 1, r0 = 1 }
moments.p = [2, -1]
"""

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_text(text: str) -> Path:
        path = tmp_path / "small.toml"
        path.write_text(text, encoding="utf-8", newline="")
        return path

    return write_text


def test_every_figure_and_the_minimal_case_are_shipped() -> None:
    assert {path.stem for path in CASES.glob("*.toml")} >= {*FIGURES, "minimal"}


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_case_loads(path: Path) -> None:
    case = load_case(path)
    assert case.name == path.stem
    assert case.path == path
    assert case.expect
    assert all(tuple(curve.varied) == case.vary.keys for curve in case.curves())
    assert case.planned == len(list(case.curves()))


@pytest.mark.parametrize(
    "path", [*sorted(CASES.rglob("*.toml")), *sorted(FIRST.glob("*.toml"))], ids=lambda path: path.stem
)
def test_a_curve_knows_its_parameters_without_its_problem(path: Path) -> None:
    """No two curves have one digest, and one that a case states by itself has that of the sweep."""
    case = load_case(path)
    curves = list(case.curves())
    assert len({curve.digest for curve in curves}) == case.planned
    for curve in curves:
        assert "problem" not in curve.__dict__
        assert curve.parameters == curve.problem.values
        assert curve.digest == Curve(curve.problem, {}).digest


def test_a_digest_follows_from_all_that_a_problem_is(write: Write) -> None:
    """Units and words do not count; a changed rate does, and the sign of 0 does not."""
    stated = (
        SMALL
        + """[output]
figure = false
"""
    )
    known = load_case(write(stated)).curve({}).digest
    changes = ["oscillator.omega=2.5", 'oscillator.impact="restitution"', "noise.D0=2.0"]
    changes += ['noise.treatment="ou-reduction"']
    assert len({known, *(load_case(write(stated), [each]).curve({}).digest for each in changes)}) == 5
    assert load_case(write(stated), ["oscillator.c2=-0.0", "output.figure=true"]).curve({}).digest == known
    rates = """
title = "own"
moments.p = [2]
noise = { kind = "telegraph", a = 0.5, k = 1.0 }
[system]
variables = ["x", "v"]
drift = ["v", "-(c + xi) * x - 0.1 * v"]
parameters.c = { value = 1.0, unit = "1/time" }
"""
    own = load_case(write(rates)).curve({})
    assert load_case(write(rates.replace("1/time", "1"))).curve({}).digest == own.digest
    assert load_case(write(rates.replace("0.1", "0.2"))).curve({}).digest != own.digest
    for base in (1.0, 3.0):
        varied = load_case(write(rates + f"[vary]\nsystem.c = [{base}, 2.0]\n"))
        assert (next(varied.curves()).digest == own.digest) == (base == 1.0)
    for treatment in ("exact", "ou-reduction"):
        varied = load_case(write(f'{stated}[vary]\nnoise.treatment = ["exact", "ou-reduction"]'))
        alone = load_case(write(stated), [f'noise.treatment="{treatment}"']).curve({})
        assert [curve.digest == alone.digest for curve in varied.curves()].count(True) == 1


CAPTIONS: dict[str, dict[str, float]] = {
    "fig1": {"epsilon": 0.1, "omega": 1, "restitution": 0.8, "c1": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig2a": {"epsilon": 0.1, "restitution": 0.8, "omega": math.pi, "c1": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig2b": {"epsilon": 0.1, "restitution": 0.8, "omega": math.pi, "c1": 0.1, "D0": 0.1, "tau0": 0.5},
    "fig2c": {"epsilon": 0.1, "restitution": 0.8, "omega": math.pi, "c1": 0.1, "D0": 0.1, "r0": 0.95},
    "fig3": {"epsilon": 0.1, "restitution": 0.8, "c1": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig4": {"epsilon": 0.1, "restitution": 0.8, "c1": 0.1, "D0": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig5": {"epsilon": 0.1, "omega": math.pi, "c1": 0.1, "D0": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig6": {"epsilon": 0.01, "restitution": 0.8, "omega": math.pi, "D0": 0.1, "r0": 0.95, "tau0": 0.5},
}


VARIED = dict(zip(FIGURES, ("D0", "D0", "r0", "tau0", "D0 omega", "omega", "restitution", "c1"), strict=True))


@pytest.mark.parametrize("name", FIGURES)
def test_every_curve_of_a_figure_has_the_caption_s_parameters(name: str) -> None:
    case = load_case(CASES / f"{name}.toml")
    assert {key.partition(".")[2] for key in case.vary.keys} == set(VARIED[name].split())
    for curve in case.curves():
        stated = {key.partition(".")[2]: value for key, value in curve.parameters.items()}
        assert stated | CAPTIONS[name] == stated
        assert curve.noise.replaces is not None


def test_what_else_the_paper_says_of_its_figures() -> None:
    cases = {name: load_case(CASES / f"{name}.toml") for name in FIGURES}
    assert {1e-4, 1e-3, 1e-2} <= set(cases["fig2c"].vary.values("noise.tau0"))
    fig3 = cases["fig3"]
    assert (fig3.figure.x, fig3.figure.y) == ("oscillator.omega", "lyapunov_exponent")
    assert fig3.output.eigenfunctions == ()
    assert {case.mesh.file for case in cases.values()} == {None, "../meshes/default.vtu", "../meshes/fine.vtu"}


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_expected_values_agree_with_their_source(path: Path) -> None:
    """Second-order values are those of Eqs. (37)-(39); the others lie within O(ε⁴) of them, relative 1e-3.

    There are none of the nonlinear response.
    """
    case = load_case(path)
    for item in (each for each in case.expect if not each.of_response):
        curves = [curve for curve in case.curves() if item.selects(curve.varied)]
        assert len(curves) == 1
        p = () if item.p is None else (item.p,)
        theory = getattr(perturbation, "moment_exponent" if item.quantity == "moment" else item.quantity)
        value = theory(curves[0].oscillator, curves[0].noise, *p)
        if case.oscillator.epsilon <= 0.1:
            assert item.value == pytest.approx(value, rel=1e-9 if "second order" in item.source else 1.5e-3)
        else:  # strong noise: the values are further right, as the theory's cumulants of order 2 alone
            assert "second order" not in item.source


def test_fig1_of_the_schema() -> None:
    case = load_case(CASES / "fig1.toml")
    assert case.title.startswith("Fig. 1")
    assert case.oscillator == VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
    np.testing.assert_allclose(case.p, np.arange(-2, 6.01, 0.25), atol=1e-14)
    assert case.rtol == 1e-8
    assert [curve.varied for curve in case.curves()] == [{"noise.D0": d0} for d0 in (0.1, 0.5, 1.0)]
    assert case.output.eigenfunctions == (1.0, 2.0)
    assert case.cylinder_mesh() is None


def test_a_curve_holds_every_parameter() -> None:
    curve = next(load_case(CASES / "fig1.toml").curves(2))
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
    assert (curve.noise, curve.varied) == (noise, {"noise.D0": 1.0})
    assert curve.parameters == {
        "oscillator.omega": 1.0,
        "oscillator.restitution": 0.8,
        "oscillator.c1": 0.1,
        "oscillator.epsilon": 0.1,
        "oscillator.c2": 0.0,
        "oscillator.c3": 0.0,
        "oscillator.impact": "delta",
        "noise.D0": 1.0,
        "noise.tau0": 0.5,
        "noise.r0": 0.95,
        "noise.treatment": "ou-reduction",
    }


def test_defaults_and_integers(write: Write) -> None:
    case = load_case(write(SMALL))
    [curve] = case.curves()
    assert curve == Curve(Problem(case.oscillator, NonGaussianNoise(D0=1.0, tau0=1.0, r0=1.0)), {})
    assert isinstance(case.oscillator.omega, float)
    assert case.oscillator.impact is ImpactLaw.DELTA
    assert case.p.tolist() == [2.0, -1.0]
    assert (case.rtol, case.vary.keys, case.expect) == (1e-8, (), ())
    assert (case.figure.x, case.figure.y) == ("p", "moment")
    assert case.output.eigenfunctions is None
    assert case.cylinder_mesh() is None


@pytest.mark.parametrize(
    ("curves", "override", "shown"),
    [
        (10, "moments.rtol=1e-8", [2.0]),  # of the first curve alone
        (11, "moments.rtol=1e-8", [2.0]),
        (11, 'output.quantities="all"', [-1.0, 2.0]),
        (11, "output.eigenfunctions=[2.0]", [2.0]),
        (11, "output.eigenfunctions=[]", []),
        (11, 'output.quantities=["eigenfunctions"]', [-1.0, 2.0]),
        (11, 'output.quantities=["moment"]', []),
    ],
)
def test_eigenfunctions_of_many_curves_are_written_if_asked_for(
    write: Write, curves: int, override: str, shown: list[float]
) -> None:
    case = load_case(write(SMALL), [override, f'vary."noise.D0"={{start=0.1, stop=1.0, num={curves}}}'])
    assert case.shown.tolist() == shown
    assert case.output.asks_for_eigenfunctions == ("rtol" not in override and bool(shown))
    further = everything(case, 2)
    is_unasked = "rtol" in override
    assert further.get("eigenfunctions", {}).get("p", []) == ([] if is_unasked else shown)
    assert not (is_unasked and "eigenfunctions" in further)


def test_a_case_made_in_python_is_checked_too_and_cannot_be_changed() -> None:
    data = tomllib.loads(SMALL)
    case = Case.model_validate(data)
    with pytest.raises(ValidationError):
        Case.model_validate(data | {"figure": {"x": "noise.D0", "y": "stability_index"}})
    with pytest.raises(ValidationError, match="frozen"):
        case.title = "other"  # type: ignore[misc]


def test_windows_line_ends(write: Write) -> None:
    assert load_case(write(SMALL.replace("\n", "\r\n"))).title == "small"


def test_curves_are_a_product_numbered_and_named(write: Write) -> None:
    case = load_case(write(SMALL + '[vary]\n"noise.D0" = [1, 2.5]\n"oscillator.omega" = [3, 0.0001]\n'))
    curves = list(case.curves())
    pairs = [(curve.noise.D0, curve.oscillator.omega) for curve in curves]
    assert pairs == [tuple(curve.varied.values()) for curve in curves] == [(1, 3), (1, 1e-4), (2.5, 3), (2.5, 1e-4)]
    assert [(curve.number, curve.suffix) for curve in curves] == [(1, ""), (2, "-2"), (3, "-3"), (4, "-4")]
    assert curves[3].label == "noise.D0 = 2.5, oscillator.omega = 0.0001"
    assert case.heading(curves[0]) == "small: noise.D0 = 1, oscillator.omega = 3"


def test_the_only_curve_needs_no_name_and_knows_the_noise_before_its_reduction(write: Write) -> None:
    case = load_case(write(SMALL.replace("r0 = 1", 'r0 = 0.9, treatment = "ou-reduction"')))
    [curve] = case.curves()
    assert (curve.number, curve.suffix, curve.label) == (1, "", "")
    assert case.heading(curve) == "small"
    assert curve.noise.replaces == NonGaussianNoise(D0=1.0, tau0=1.0, r0=0.9)
    assert curve.noise == curve.noise.replaces.ou_reduction()


def test_where_selects_curves(write: Write) -> None:
    text = (
        SMALL
        + '[vary]\n"noise.D0" = [1, 2]\n"noise.tau0" = [1, 2]\n[[expect]]\nquantity = "variance_rate"\n'
        + 'value = 1\natol = 9\nsource = "none"\nwhere = { "noise.D0" = 2 }\n'
    )
    case = load_case(write(text))
    selected = [curve.varied for curve in case.curves() if case.expect[0].selects(curve.varied)]
    assert selected == [{"noise.D0": 2, "noise.tau0": 1}, {"noise.D0": 2, "noise.tau0": 2}]
    everywhere = case.expect[0].model_copy(update={"where": {}})
    assert all(everywhere.selects(curve.varied) for curve in case.curves())


def test_mesh_from_numbers(write: Write) -> None:
    mesh = load_case(write(SMALL + "[mesh]\nphi_cells = 3\nxi_min = -5\nxi_max = 9\n")).cylinder_mesh()
    assert mesh is not None
    assert mesh.phi_lines.size == 4
    assert (mesh.z_lines[0], mesh.z_lines[-1]) == (-5, 9)


def test_mesh_file_is_sought_from_the_case(write: Write, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    write_mesh(make_mesh(phi_cells=3), tmp_path / "inner" / "mesh.vtu")
    mesh = load_case(write(SMALL + '[mesh]\nfile = "inner/mesh.vtu"\n')).cylinder_mesh()
    assert mesh is not None
    assert mesh.phi_lines.size == 4


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ("oscillator.omega=3.5", "oscillator.omega", 3.5),
        ("oscillator.omega = 3", "oscillator.omega", 3.0),
        ('oscillator.impact="restitution"', "oscillator.impact", "restitution"),
        ("noise={D0=1, tau0=1, r0=0.5}", "noise.r0", 0.5),
        ("'noise'.\"r0\"=-1", "noise.r0", -1.0),
    ],
)
def test_override(write: Write, override: str, key: str, value: float | str) -> None:
    assert next(load_case(write(SMALL), [override]).curves()).parameters[key] == value


def test_override_of_a_text_needs_no_quotes(write: Write) -> None:
    case = load_case(write(SMALL), ["oscillator.impact=restitution", "noise.treatment=exact", "title=Two words"])
    [curve] = case.curves()
    assert curve.parameters["oscillator.impact"] == "restitution"
    assert curve.oscillator.impact is ImpactLaw.RESTITUTION
    assert curve.noise == NonGaussianNoise(D0=1.0, tau0=1.0, r0=1.0)
    assert curve.theory_reduces_noise
    assert case.title == "Two words"


@pytest.mark.parametrize("stated", ['"noise.D0" = [1]', "noise.D0 = [1]", ""])
@pytest.mark.parametrize("override", ['vary."noise.D0"=[2]', "vary.noise.D0=[2]", 'vary={"noise.D0"=[2]}'])
def test_override_of_a_varied_key(write: Write, stated: str, override: str) -> None:
    assert load_case(write(f"{SMALL}[vary]\n{stated}"), [override]).vary.columns == {"noise.D0": (2.0,)}


def test_later_overrides_win_and_tables_replace_tables(write: Write) -> None:
    overrides = ["moments.p=[1.0]", "moments.p={start=0, stop=1, num=3}", "mesh={}", "mesh.xi_cells=7"]
    overrides += ["output.eigenfunctions=[]", "moments.rtol=1e-6"]  # of sections that are not there
    case = load_case(write(SMALL + "[mesh]\nphi_cells = 3\n"), overrides)
    assert case.p.tolist() == [0.0, 0.5, 1.0]
    assert case.mesh.model_dump(exclude_none=True) == {"xi_cells": 7}
    assert (case.output.eigenfunctions, case.rtol) == ((), 1e-6)


TRICKY = """\
# comment = 1
a = 1  # b = [
"quoted.key" = "x # y"
'single' = 'z'
text = \"\"\"
c = 2
\"\"\"
literal = '''
d = "
'''
list = [
    1,
    # 2,
    [3, "]"],
    { e = 4,  f.g = 5 },
]
date = 1979-05-27 07:32:00
[table . "in.ner"]
h = -1.5e3
[[array]]
i = true
[array.sub]
j = 1
[[array]]
i = false
"""


def test_lines_of_keys(write: Write) -> None:
    places = read_document(write(TRICKY)).places
    expected = {
        "a": 2, "quoted.key": 3, "single": 4, "text": 5, "literal": 8, "list": 11, "list.0": 12, "list.1": 14,
        "list.1.1": 14, "list.2": 15, "list.2.e": 15, "list.2.f.g": 15, "date": 17, "table": 18,
        "table.in.ner": 18, "table.in.ner.h": 19, "array": 20, "array.0": 20, "array.0.i": 21,
        "array.0.sub": 22, "array.0.sub.j": 23, "array.1": 24, "array.1.i": 25,
    }  # fmt: skip
    assert {key: places[key].line for key in expected} == expected
    assert not {"b", "c", "d", "comment"} & places.keys()


def _leaves(value: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [leaf for key, item in items for leaf in _leaves(item, (*path, str(key)))] or [path]


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_key_of_a_shipped_case_is_on_its_line(path: Path) -> None:
    document = read_document(path)
    lines = path.read_text(encoding="utf-8").splitlines()
    for leaf in _leaves(document.data):
        line = document.places[".".join(leaf)].line
        assert line is not None
        name = next(part for part in reversed(leaf) if not part.isdigit())
        assert re.search(rf'\b{re.escape(name)}"? =', lines[line - 1]) or leaf[-1].isdigit()


def test_moments_know_their_orders() -> None:
    moments = Moments(p=(3.0, 1.0))
    assert all(map(moments.has, (1.0, 3.0, 3 + 5e-13, 3 - 5e-13)))
    assert not any(map(moments.has, (3 + 2e-12, 2.0, -1e308, 1e308)))
    assert moments == Moments(p=(3.0, 1.0))
    assert moments != Moments(p=(1.0, 3.0))
    assert hash(moments) == hash(Moments(p=(3.0, 1.0)))
