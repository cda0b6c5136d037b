"""The room of case files: lines of keys, and cases that are written with other values."""

import pytest

from fpsolve.case.case import load_case
from fpsolve.case.rewrite import rewritten
from fpsolve.case.toml import read_document
from tests.conftest import sampled
from tests.contract.test_cases import CASES

TRICKY = """\
# comment = 1
a = 1  # b = [
"quoted.key" = "x # y"
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
LINES = {
    **{"a": 2, "quoted.key": 3, "text": 4, "literal": 7, "list": 10, "list.0": 11, "list.1.1": 13, "list.2.e": 14},
    **{
        "list.2.f.g": 14,
        "date": 16,
        "table": 17,
        "table.in.ner.h": 18,
        "array.0.i": 20,
        "array.0.sub.j": 22,
        "array.1": 23,
    },
}


def test_keys_of_tricky_toml_are_on_their_lines(tmp_path):
    (tmp_path / "a.toml").write_text(TRICKY, encoding="utf-8")
    places = read_document(tmp_path / "a.toml").places
    assert {key: places[key].line for key in LINES} == LINES
    assert not {"b", "c", "d", "comment"} & places.keys()


@pytest.mark.parametrize(
    "name", sampled("own_equation", "filtered", "stochastic_mathieu", "coupled", "flutter", keep=2)
)
def test_a_case_is_written_with_another_value_wherever_it_states_it(tmp_path, name):
    """In a table of parameters, in that of a noise with a name, or as a part of something."""
    case = load_case(CASES / f"systems/{name}.toml", ["expect=[]", "vary={}", "figure={}", "output={}"])
    for key in case.problem.differentiable:
        value = float(case.problem.values[key]) * 0.99 or 0.01
        (tmp_path / "new.toml").write_text(rewritten(case, tmp_path, {key: value}), encoding="utf-8")
        assert next(load_case(tmp_path / "new.toml").sets()).parameters == {**case.problem.values, key: value}
