"""What lies in the folder of a case: files of other parameters go, and what is none of fpsolve's harms nothing."""

import json
import os
from pathlib import Path

import pytest

from fpsolve.errors import OutputError
from fpsolve.workflow.folders import SOLVED, own_folder
from tests.kit import case_in, case_text, read_json

NESTED = "[" * 100_000
TABLES = {
    "summary.json": ["curves.csv", "figure.png"],
    "monte_carlo.json": ["monte_carlo_response.csv"],
    "chart.json": ["chart.csv", "chart.png"],
    "proof.json": [],
}
AXES = {"x": {"key": "noise.D0"}, "y": {"key": "oscillator.c1"}}


@pytest.fixture
def case(tmp_path):
    return case_in(tmp_path, case_text("[moments]\np = [2.0]\n"))


@pytest.fixture
def folder(case, tmp_path):
    """With a file of each kind, which agree with the case."""
    folder = tmp_path / "test"
    folder.mkdir()
    parameters = dict(next(case.curves()).parameters)
    held = {key: value for key, value in parameters.items() if key not in ("noise.D0", "oscillator.c1")}
    for table, others in TABLES.items():
        stated = {"curves": [{"parameters": parameters}]} if "o" not in table[:2] else {"parameters": parameters}
        content = {"parameters": held, **AXES} if table == "chart.json" else stated
        (folder / table).write_text(json.dumps(content), encoding="utf-8")
        for name in others:
            (folder / name).write_text("", encoding="utf-8")
    return folder


def left(case, tmp_path, *replaced):
    with own_folder(case, tmp_path, replaced) as folder:
        return {path.name for path in folder.iterdir()} - {".fpsolve.lock"}


EVERYTHING = {*TABLES, *(name for others in TABLES.values() for name in others)}


def test_what_agrees_stays(case, folder, tmp_path):
    assert left(case, tmp_path) == EVERYTHING


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize(
    "content", [NESTED, "", "[]", "{}", '{"curves": 1}', '{"parameters": {}}', '{"parameters": NaN}']
)
def test_what_does_not_agree_goes_alone(case, folder, tmp_path, table, content):
    (folder / table).write_text(content, encoding="utf-8")
    assert left(case, tmp_path) == EVERYTHING - {table, *TABLES[table]}


def test_a_run_removes_the_responses_of_an_earlier_one(case, folder, tmp_path):
    stale = {"response.csv", "response.png", "response-10.pdf", "response.vtu", "response_3d-2.vtu"}
    for name in {*stale, "response.txt", "my_response.csv"}:
        (folder / name).write_text("", encoding="utf-8")
    assert left(case, tmp_path, SOLVED) == EVERYTHING - {"summary.json", "curves.csv", "figure.png"} | {
        "response.txt",
        "my_response.csv",
    }


def test_parameters_of_a_proof_are_complete(case, folder, tmp_path):
    for curves in ([], [{"parameters": {}}], [{"parameters": {"noise.D0": 0.5}}]):
        (folder / "proof.json").write_text(json.dumps({"curves": curves}), encoding="utf-8")
        assert left(case, tmp_path) == EVERYTHING - {"proof.json"}


def test_a_chart_is_beside_its_table(case, folder, tmp_path):
    (folder / "chart.json").unlink()
    assert left(case, tmp_path) == EVERYTHING - {"chart.json", "chart.csv", "chart.png"}


def test_parameters_and_axes_of_a_chart_are_complete(case, folder, tmp_path):
    chart = read_json(folder / "chart.json")
    del chart["parameters"]["noise.r0"]
    (folder / "chart.json").write_text(json.dumps(chart), encoding="utf-8")
    assert left(case, tmp_path) == EVERYTHING - {"chart.json", "chart.csv", "chart.png"}


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("kind", ["pipe", "device", "huge", "link"])
def test_what_is_no_plain_file_is_removed_unread(case, folder, tmp_path, table, kind):
    path = folder / table
    path.unlink()
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "huge":
        with path.open("wb") as file:
            file.truncate(2**40)
    else:
        path.symlink_to("/dev/zero" if kind == "device" else path)
    assert left(case, tmp_path) == EVERYTHING - {table, *TABLES[table]}


@pytest.mark.parametrize("name", ["summary.json", "figure.png", "eigenfunctions/p+2.0.vtu", "results.nc"])
def test_a_folder_in_the_place_of_a_file_is_refused_before_anything_is_removed(case, folder, tmp_path, name):
    (folder / name).unlink(missing_ok=True)
    (folder / name).mkdir(parents=True)
    with pytest.raises(OutputError, match=r"test/.* cannot be written: Is a directory; choose another folder"):
        left(case, tmp_path, SOLVED)
    assert {path.name for path in folder.iterdir()} >= {*EVERYTHING, name.partition("/")[0]}


@pytest.mark.parametrize("name", ["records", "records/solved", "eigenfunctions", "eigenfunctions-2"])
def test_nothing_is_written_or_removed_through_a_link(case, folder, tmp_path, name):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "p+2.0.vtu").write_text("mine", encoding="utf-8")
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).symlink_to(elsewhere)
    with pytest.raises(OutputError, match=rf"{name} cannot be written to: it is no folder, or a link to one; choose"):
        left(case, tmp_path, SOLVED)
    assert (elsewhere / "p+2.0.vtu").read_text(encoding="utf-8") == "mine"
    (folder / name).unlink()
    (folder / name).write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="no folder"):
        left(case, tmp_path, SOLVED)


def test_a_folder_that_cannot_be_read_is_left_alone(case, folder, tmp_path, monkeypatch):
    (folder / "private").mkdir()
    listed = Path.iterdir

    def refusing(path):
        if path.name == "private":
            raise PermissionError(13, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(Path, "iterdir", refusing)
    assert left(case, tmp_path) == {*EVERYTHING, "private"}
