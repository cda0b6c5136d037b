"""Starting from a case that comes with fpsolve: `fpsolve new`, and `python -m fpsolve`."""

import subprocess
import sys
from pathlib import Path

import pytest

from fpsolve import load_case
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
    assert files(Path()) == set()


@pytest.mark.slow
def test_the_package_is_the_command():
    done = subprocess.run([sys.executable, "-m", "fpsolve", "new", "fig"], capture_output=True, text=True, check=False)
    assert done.returncode == BAD_INPUT
    assert "did you mean" in done.stderr
