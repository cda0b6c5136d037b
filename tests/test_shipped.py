"""Starting from a case that comes with fpsolve: `fpsolve new`, and `python -m fpsolve`."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fpsolve import load_case
from fpsolve.arrays import one
from fpsolve.case.schema import SCHEMA
from fpsolve.cli import main
from fpsolve.commands.new import described_cases, shipped_cases
from fpsolve.commands.options import BAD_INPUT
from tests.kit import files

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_all_cases_are_listed_with_their_titles(capsys):
    assert main(["new"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(list((ROOT / "cases").rglob("*.toml"))) == len(shipped_cases())
    assert lines[1].split(maxsplit=1) == ["fig1", load_case(ROOT / "cases/fig1.toml").title]
    assert all(described_cases().values())
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("name", ["fig1", "fig1.toml", "telegraph", "systems/telegraph"])
def test_a_case_is_copied_with_its_schema(name, capsys):
    assert main(["new", name]) == 0
    stem = Path(name).stem
    assert capsys.readouterr().out == f"written: {stem}.toml\n"
    assert files(Path()) == {f"{stem}.toml", SCHEMA}
    [(first, *rest), (_, *original)] = (
        each.read_text(encoding="utf-8").splitlines() for each in (Path(f"{stem}.toml"), shipped_cases()[stem])
    )
    assert first == f"#:schema {SCHEMA}"
    assert rest == original
    assert load_case(f"{stem}.toml").p.size


@pytest.mark.parametrize("name", ["fig5", "fig6"])
def test_the_mesh_that_a_case_names_goes_along(name, tmp_path):
    assert main(["new", name, "mine.toml"]) == 0
    case = load_case("mine.toml")
    assert case.cylinder_mesh() is not None
    assert case.mesh.file in files(Path())


def test_a_folder_takes_the_copy(tmp_path):
    assert main(["new", "minimal", str(tmp_path)]) == 0
    assert main(["new", "chart", str(tmp_path / "deeper/mine.toml")]) == 0
    assert files(tmp_path) == {"minimal.toml", SCHEMA, "deeper/mine.toml", f"deeper/{SCHEMA}"}


@pytest.mark.parametrize(("name", "beside"), [("fig1", "fig1.toml"), ("fig6", "fine.vtu")])
def test_nothing_is_overwritten(name, beside, capsys):
    Path(beside).write_text("mine", encoding="utf-8")
    assert main(["new", name]) == BAD_INPUT
    assert f"{beside} is there already" in capsys.readouterr().err
    assert files(Path()) == {beside}
    assert Path(beside).read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(("name", "near"), [("fig7", "fig"), ("telegraf", "telegraph"), ("no such thing", "")])
def test_of_unknown_names_the_nearest_are_told(name, near, capsys):
    assert main(["new", name]) == BAD_INPUT
    said = capsys.readouterr().err
    assert f'got "{name}"; must be the name of a case' in said
    assert ('did you mean "' + near in said) == bool(near)
    assert "`fpsolve new` lists all" in said
    assert "--kind" not in said
    assert files(Path()) == set()


def test_where_a_file_stands_for_the_name_of_a_case_the_command_that_writes_one_is_told(capsys):
    assert main(["new", "my own.toml"]) == BAD_INPUT
    assert "write `fpsolve new 'my own.toml' --kind system`" in capsys.readouterr().err
    assert main(["new", "my own.toml", "--kind", "system"]) == 0
    assert load_case("my own.toml").problem


@pytest.mark.slow
def test_the_package_is_the_command():
    done = subprocess.run([sys.executable, "-m", "fpsolve", "new", "fig"], capture_output=True, text=True, check=False)
    assert done.returncode == BAD_INPUT
    assert "did you mean" in done.stderr


def made(*options: str) -> Path:
    assert main(["new", "my.toml", *options]) == 0
    return Path("my.toml")


def test_a_case_of_a_frequency_a_damping_ratio_and_a_bounce(capsys):
    """ω = 2πf, c₁ = −2ζω/ε² with ε = 1, and R = r for the law of restitution."""
    case = load_case(made("--frequency", "2", "--damping-ratio", "0.01", "--restitution", "0.9"))
    assert capsys.readouterr().out == "written: my.toml\n"
    oscillator, omega = case.oscillator, 4 * math.pi
    assert oscillator.omega == pytest.approx(omega)
    assert oscillator.c1 == pytest.approx(-2 * 0.01 * omega)
    assert oscillator.epsilon == 1.0
    assert math.exp(oscillator.log_impact_factor) == pytest.approx(0.9)
    assert case.units.time == "s"
    assert files(Path()) == {"my.toml", SCHEMA}


@pytest.mark.parametrize("kind", ["oscillator", "system", "parametric", "plane", "modes", "equations"])
def test_each_kind_has_the_frequency_and_the_damping(kind):
    """Without noise: eigenvalues of the modulus ω with the real part −ζω, and R at x = 0."""
    wall = [] if kind == "modes" else ["--restitution", "0.8"]
    case = load_case(made("--kind", kind, "--frequency", "3", "--damping-ratio", "0.02", *wall))
    system, omega = case.system, 6 * math.pi
    still = sum(np.array(each.matrix) for each in system.terms if each.g == one)
    values = np.linalg.eigvals(still)
    if kind == "oscillator":  # in (x, ẋ/ω)
        assert np.trace(still) == pytest.approx(-2 * 0.02 * omega)
    else:
        assert abs(values) == pytest.approx([omega, omega])
        assert values.real == pytest.approx([-0.02 * omega] * 2)
    assert [math.exp(each.log_factor) for each in system.jumps] == pytest.approx([0.8] * len(wall[:1]))
    assert "#" in Path("my.toml").read_text(encoding="utf-8")


def test_two_modes():
    options = ["--kind", "modes", "--frequency", "2", "--frequency", "3.5", "--damping-ratio", "0.01"]
    case = load_case(made(*options, "--damping-ratio", "0.02"))
    values = np.linalg.eigvals(sum(np.array(each.matrix) for each in case.system.terms if each.g == one))
    expected = [2 * math.pi * f for f in (2, 2, 3.5, 3.5)]
    assert np.sort(abs(values)) == pytest.approx(expected)
    assert np.sort(-values.real) == pytest.approx([0.01 * expected[0]] * 2 + [0.02 * expected[2]] * 2)


def test_modes_of_a_table():
    Path("modes.csv").write_text("Fn (Hz),Xi\n2.0,0.01\n3.5,0.02\n9.0,0.03\n", encoding="utf-8")
    case = load_case(made("--modes", "modes.csv", "--mode", "1", "--mode", "2", "--kind", "modes"))
    values = np.linalg.eigvals(sum(np.array(each.matrix) for each in case.system.terms if each.g == one))
    expected = [2 * math.pi * f for f in (2, 2, 3.5, 3.5)]
    assert np.sort(abs(values)) == pytest.approx(expected)
    assert np.sort(-values.real) == pytest.approx([0.01 * expected[0]] * 2 + [0.02 * expected[2]] * 2)


def test_a_kind_alone_needs_no_name(capsys):
    assert main(["new", "--kind", "system"]) == 0
    assert capsys.readouterr().out == "written: system.toml\n"
    assert load_case("system.toml").units.time == "time"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["my.toml", "--kind", "sytem"], 'did you mean "system"?'),
        (["my.toml", "--frequency", "0"], "got --frequency 0.0; must be"),
        (["my.toml", "--damping-ratio", "1"], "0.01 is 1 %"),
        (["my.toml", "--restitution", "1.1"], "1 means no wall"),
        (["my.toml", "--frequency", "1", "--frequency", "2"], "--kind modes"),
        (["my.toml", "--kind", "modes", "--restitution", "0.9"], "no walls"),
        (["my.toml", "--frequency", "1", "--damping-ratio", "0.1", "--damping-ratio", "0.2"], "one for each"),
        (["mine", "--frequency", "1"], "must end in .toml"),
        (["fig1", "my.toml", "--frequency", "1"], "the new file only"),
        (["my.toml", "--mode", "1"], "--mode is for the table"),
        (["my.toml", "--modes", "none.csv"], "no such file"),
        (["my.toml", "--modes", "none.csv", "--frequency", "1"], "leave out --frequency"),
    ],
)
def test_what_is_no_new_case(options, said, capsys):
    assert main(["new", *options]) == BAD_INPUT
    assert said in capsys.readouterr().err
    assert files(Path()) == set()
