"""A case with other values is the case as it was written, with its comments, and reads as it should."""

import tomllib

import pytest

from fpsolve.case.case import load_case
from fpsolve.case.rewrite import rewritten
from tests.conftest import sampled
from tests.test_docs import ROOT

PLAIN = """\
# The oscillator.
title = "T"

[oscillator]
epsilon = 0.1 # small
omega = 1.0
restitution = 0.8
c1 = 0.1# at the end

[noise]
D0 = 1.0
tau0 = 0.5
r0 = 0.95

[moments]
p = [
    1.0, # first
    2.0,
]

[vary] # goes
"noise.D0" = [0.1, 1.0]

# stays
[[expect]]
quantity = "moment"
p = 2.0
value = 0.01
rtol = 1.0
source = "S"
"""


def written(folder, text, overrides, values, expect=None):
    path = folder / "old.toml"
    path.write_text(text, encoding="utf-8")
    case = load_case(path, overrides)
    new = folder / "new" / "new.toml"
    new.parent.mkdir(exist_ok=True)
    new.write_text(rewritten(case, values, expect, new.parent), encoding="utf-8")
    return new.read_text(encoding="utf-8"), load_case(new)


def test_comments_and_lines_stay(tmp_path):
    expect = {"quantity": "moment", "p": 2.0, "value": 0.5, "rtol": 1e-3, "source": "S"}
    text, case = written(tmp_path, PLAIN, ["vary={}", "noise.D0=2.0"], {"oscillator.c1": -0.25}, expect)
    kept = PLAIN[: PLAIN.index("[vary]")].replace("c1 = 0.1#", "c1 = -0.25#").replace("D0 = 1.0", "D0 = 2.0")
    assert text.startswith(kept)
    assert "# stays" in text
    assert case.problem.values["oscillator.c1"] == -0.25
    assert case.expect[0].value == 0.5
    assert not case.vary


@pytest.mark.parametrize(
    "name", sampled("own_equation", "filtered", "stochastic_mathieu", "coupled", "flutter", keep=2)
)
def test_a_value_is_found_wherever_a_case_states_it(name, tmp_path):
    """In a table of parameters, in that of a noise with a name, or where it is a part of something, in [vary]."""
    case = load_case(ROOT / f"cases/systems/{name}.toml", ["expect=[]", "vary={}", "figure={}", "output={}"])
    for key in case.problem.differentiable:
        value = float(case.problem.values[key]) * 0.99 or 0.01
        _, new = written(tmp_path, case.text, case.overrides, {key: value})
        curve = next(new.curves())
        assert curve.parameters[key] == value
        others = {each: case.problem.values[each] for each in case.problem.values if each != key}
        assert {each: curve.parameters[each] for each in others} == others


def test_what_changes_more_than_values_is_written_anew(tmp_path):
    text, case = written(tmp_path, PLAIN, ["vary={}", "expect=[]", "oscillator.c2=0.5"], {"noise.D0": 3.0})
    assert case.problem.values["oscillator.c2"] == 0.5
    assert case.problem.values["noise.D0"] == 3.0
    assert tomllib.loads(text)["moments"]["p"] == [1.0, 2.0]


def test_new_sections_come_in_the_order_of_the_changes(tmp_path):
    """Not in one that the hash of their names tells, which is another in every process."""
    changes = ["monte_carlo.seed=1", "budget.unknowns=5000", 'output.quantities="all"', "excursions.levels=[2.0]"]
    text, _ = written(tmp_path, PLAIN, ["vary={}", "expect=[]", *changes], {})
    starts = [text.index(f"[{each.partition('.')[0]}]") for each in changes]
    assert starts == sorted(starts)
    assert text.startswith(PLAIN[: PLAIN.index("[vary]")].rstrip())


def test_a_mesh_is_named_from_the_new_place(tmp_path):
    mesh = (ROOT / "meshes/default.vtu").read_text(encoding="utf-8")
    (tmp_path / "m.vtu").write_text(mesh, encoding="utf-8")
    plain = PLAIN[: PLAIN.index("[vary]")] + '[mesh]\nfile = "m.vtu"\n'
    text, case = written(tmp_path, plain, [], {"oscillator.c1": 0.2})
    assert 'file = "../m.vtu"' in text
    assert case.cylinder_mesh() is not None
