"""The JSON Schema of case files takes what fpsolve takes, and refuses what has a wrong shape as fpsolve does."""

import json
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from fpsolve.case.case import load_case
from fpsolve.case.schema import SCHEMA, schema, schema_text
from fpsolve.cli import main
from fpsolve.errors import CaseError
from fpsolve.model.kinds import NOISES, SYSTEMS
from tests.snapshots import entries

CASES = Path(__file__).parents[2] / "cases"
FILES = sorted(CASES.rglob("*.toml"))
FIG1, OWN, MATHIEU, CHART = "fig1", "systems/own_equation", "systems/stochastic_mathieu", "chart"
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
    (OWN, 'variables = ["x", "v"]', "variables = []"),
    (OWN, 'words = "damping ratio"', "words = 3"),
    (OWN, "sigma = 1.0\n", ""),
    (OWN, 'kind = "ornstein-uhlenbeck"', 'kind = "white"'),
    (MATHIEU, 'noises = { load = "noise.load", shake = "noise.shake" }', 'noises = ["load", "shake"]'),
    (CHART, "start = 0.3, ", ""),
    (CHART, "{ moment = 2.0 }, { stability_index = -1.0 }", "{ moments = 2.0 }"),
    (CHART, 'scale = "log", at', 'scale = "lg", at'),
]


@pytest.fixture(scope="module")
def validator():
    Draft202012Validator.check_schema(schema())
    return Draft202012Validator(schema())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_case_validates_and_names_the_schema(path, validator):
    text = path.read_text(encoding="utf-8")
    validator.validate(tomllib.loads(text))
    named = text.partition("\n")[0].removeprefix("#:schema ")
    assert (path.parent / named).resolve() == (CASES / SCHEMA).resolve()


@pytest.mark.parametrize("name", sorted({(each.name, each.good) for each in entries()}), ids=lambda pair: pair[0])
def test_the_good_cases_of_the_refusals_validate(name, validator):
    validator.validate(tomllib.loads(name[1]))


@pytest.mark.parametrize(("name", "good", "bad"), FAULTY)
def test_what_has_a_wrong_shape_is_refused_by_both(name, good, bad, validator, tmp_path):
    text = (CASES / f"{name}.toml").read_text(encoding="utf-8")
    assert good in text
    faulty = tmp_path / "faulty.toml"
    faulty.write_text(text.replace(good, bad), encoding="utf-8")
    with pytest.raises(CaseError):
        load_case(faulty)
    assert not validator.is_valid(tomllib.loads(faulty.read_text(encoding="utf-8")))


def test_the_file_beside_the_cases_is_what_is_printed(capsys):
    assert main(["schema"]) == 0
    assert capsys.readouterr().out == schema_text() == (CASES / SCHEMA).read_text(encoding="utf-8")


def test_kinds_keys_ranges_and_units_are_those_declared():
    found = schema()
    tables = [each["properties"] for each in found["$defs"].values() if "properties" in each]
    stated = {each["kind"]["const"] for each in tables if "kind" in each}
    assert stated == {*SYSTEMS, *NOISES}
    omega = found["$defs"]["system_vibro-impact"]["properties"]["omega"]
    assert (omega["minimum"], omega["maximum"], omega["unit"], omega["symbol"]) == (
        1e-15,
        1e15,
        "rad/time",
        r"$\omega$",
    )
    assert omega["description"] == "natural frequency, in rad/time"
    assert "null" not in json.dumps(found)
