"""Tables of a finished case stay as they are in a further run, and only those."""

import csv
import os

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.cli import NOT_CONVERGED, main
from fpsolve.exponent import ExponentSolver
from fpsolve.output.records import Records
from fpsolve.workflow import seal, sets
from fpsolve.workflow.cases import run_case
from fpsolve.workflow.seal import SEAL, TABLES, sealed
from tests.kit import case_text

BARE = '[output]\nfigure = false\nquantities = ["moment", "lyapunov_exponent"]\n'
TEXT = case_text(f'[moments]\np = [2.0]\n{BARE}[vary]\nfile = "sets.csv"\n')
SETS = "noise.D0,noise.treatment\n0.1,exact\n0.2,exact\n0.3,ou-reduction\n"


@pytest.fixture
def place(tmp_path):
    """A folder with a case that is solved."""
    (tmp_path / "test.toml").write_text(TEXT)
    (tmp_path / "sets.csv").write_text(SETS)
    run(tmp_path)
    return tmp_path


def case_of(place):
    return load_case(place / "test.toml")


def run(place, **how):
    return run_case(case_of(place), place / "out", **how)


def tables(place):
    return {name: (place / "out/test" / name).read_bytes() for name in TABLES}


def seal_of(place):
    return sealed(case_of(place), place / "out/test")


def test_tables_of_a_finished_case_stay_and_no_record_is_read(place, monkeypatch):
    before, first = tables(place), run_case(case_of(place), place / "another")
    monkeypatch.setattr(Records, "look", lambda _: pytest.fail("records are looked for"))
    outcome = run(place)
    assert (outcome.known, outcome.failed, outcome.outdated) == (3, 0, 0)
    monkeypatch.undo()
    assert tables(place) == before
    for one, two in zip(outcome.results, first.results, strict=True):
        np.testing.assert_array_equal(one.moments.value, two.moments.value)


def written_over(name, change):
    def apply(place):
        path = place / "out/test" / name
        path.write_bytes(change(path.read_bytes()))

    return apply


def damaged_record(place):
    [path] = (place / "out/test/records/solved").glob("*.jsonl")
    path.write_bytes(path.read_bytes().replace(b'"record": {', b'"record": [', 1))


def pipe(place):
    (place / "out/test" / SEAL).unlink()
    os.mkfifo(place / "out/test" / SEAL)


CHANGES = {
    "summary.json of another run": written_over("summary.json", lambda old: old.replace(b"0.1", b"0.4")),
    "half of moments.csv": written_over("moments.csv", lambda old: old[: len(old) // 2]),
    "no results.nc": lambda place: (place / "out/test/results.nc").unlink(),
    "an empty curves.csv": written_over("curves.csv", lambda old: b""),
    "a record that is damaged": damaged_record,
    "no records": lambda place: [path.unlink() for path in (place / "out/test/records/solved").iterdir()],
    "a torn seal": written_over(SEAL, lambda old: old[:-9]),
    "another seal": written_over(SEAL, lambda old: b'["", 0, 0, []]'),
    "a seal that is nested": written_over(SEAL, lambda old: b"[" * 100_000),
    "a seal that is a pipe": pipe,
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_what_has_changed_is_written_anew(place, change):
    before = tables(place)
    change(place)
    assert seal_of(place) is None
    run(place)
    rows = [[{**row, "seconds": 0} for row in csv.DictReader(text.decode().splitlines())] for text in (
        before["curves.csv"], tables(place)["curves.csv"],
    )]  # fmt: skip
    assert rows[0] == rows[1]
    assert tables(place)["moments.csv"] == before["moments.csv"]
    assert seal_of(place)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("test.toml", 'title = "', 'title = "another '),
        ("test.toml", "p = [2.0]", "p = [3.0]"),
        ("test.toml", "figure = false", "figure = true"),
        ("sets.csv", "0.2,exact", "0.25,exact"),
        ("sets.csv", "0.2,exact\n", ""),
    ],
)
def test_another_case_breaks_the_seal(place, name, old, new):
    path = place / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    assert seal_of(place) is None
    run(place)
    assert seal_of(place)
    path.write_text(text)
    assert seal_of(place) is None


def test_another_version_breaks_the_seal(place, monkeypatch):
    monkeypatch.setattr(seal, "__version__", "0.0")
    assert seal_of(place) is None
    monkeypatch.undo()
    assert seal_of(place)
    monkeypatch.setattr("fpsolve.output.records.RESULT_VERSION", 0)
    assert seal_of(place) is None


def test_a_fresh_run_solves_and_writes_all(place):
    before = (place / "out/test/results.nc").stat().st_mtime_ns
    assert run(place, is_fresh=True).known == 0
    assert (place / "out/test/results.nc").stat().st_mtime_ns != before
    assert seal_of(place)


@pytest.mark.parametrize("name", ["write_results", "write_curves", "write_dataset", "seal"])
@pytest.mark.parametrize("is_fresh", [False, True])
def test_a_run_that_is_stopped_as_it_writes_leaves_no_seal(place, monkeypatch, name, is_fresh):
    def stop(*_):
        raise KeyboardInterrupt

    before = tables(place)["moments.csv"]
    (place / "out/test/curves.csv").unlink()
    monkeypatch.setattr(sets, name, stop)
    with pytest.raises(KeyboardInterrupt):
        run(place, is_fresh=is_fresh)
    monkeypatch.undo()
    assert seal_of(place) is None
    run(place)
    assert tables(place)["moments.csv"] == before
    assert seal_of(place)


def test_what_failed_is_told_again(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    values = '[vary]\n"oscillator.epsilon" = [0.01, 3.0]\n[budget]\nunknowns = 300\n'
    (tmp_path / "test.toml").write_text(case_text(f"[moments]\np = [2.0]\n{BARE}{values}"))
    said = list[str]()
    for _ in range(2):
        assert main(["run", "test.toml", "--out", "out", "--quiet"]) == NOT_CONVERGED
        out, err = capsys.readouterr()
        assert "2 curves, 1 not converged" in out
        said.append(err)
    assert said[0] == said[1]
    assert "not converged" in said[0]
    assert seal_of(tmp_path).failed == 1


def test_pictures_are_drawn_again_beside_tables_that_stay(tmp_path):
    (tmp_path / "test.toml").write_text(case_text("[moments]\np = [2.0]\n[output]\neigenfunctions = [2.0]\n"))
    run(tmp_path)
    [picture] = (tmp_path / "out/test/eigenfunctions").glob("*.vtu")
    before, drawn = tables(tmp_path), picture.read_bytes()
    picture.unlink()
    outcome = run(tmp_path)
    assert outcome.known == 1
    assert picture.read_bytes() == drawn
    assert tables(tmp_path) == before
    assert seal_of(tmp_path)


@pytest.mark.parametrize("values", ["", '[vary]\n"noise.D0" = [0.1, 0.2, 0.3]\n'])
def test_an_interrupt_in_drawing_leaves_tables_and_seal(tmp_path, monkeypatch, values):
    text = f"[moments]\np = [2.0]\n[output]\nfigure = false\neigenfunctions = [2.0]\n{values}"
    (tmp_path / "test.toml").write_text(case_text(text))
    run(tmp_path)
    before = tables(tmp_path)

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(ExponentSolver, "pair", stop)
    count = case_of(tmp_path).planned
    with pytest.raises(KeyboardInterrupt, match=f"^interrupted after {count} of {count} curve"):
        run(tmp_path)
    monkeypatch.undo()
    assert tables(tmp_path) == before
    assert seal_of(tmp_path)
    run(tmp_path)
    assert list((tmp_path / "out/test/eigenfunctions").glob("*.vtu"))


def test_many_curves_are_told_from_their_tables(tmp_path, capsys, monkeypatch):
    """The extreme ones of a run that finds all sealed are those of the run that solved them."""
    monkeypatch.chdir(tmp_path)
    sets = '[vary]\n"noise.D0" = { start = 0.1, stop = 0.9, num = 18 }\n"oscillator.omega" = [0.5, 1.0, 2.0]\n'
    (tmp_path / "test.toml").write_text(case_text(f"[moments]\np = [2.0]\n{BARE}{sets}"))
    said = list[str]()
    for _ in range(2):
        assert main(["run", "test.toml", "--out", "out"]) == 0
        said.append(capsys.readouterr().out.partition("written:")[0])
    assert said[0] == said[1]
    assert "54 curves: 54 converged" in said[1]
    rows = list(csv.DictReader((tmp_path / "out/test/curves.csv").read_text().splitlines()))
    by_exponent = sorted(rows, key=lambda row: float(row["lyapunov_exponent"]))
    for word, row in (("least λ", by_exponent[0]), ("largest λ", by_exponent[-1])):
        [line] = [line for line in said[1].splitlines() if word in line]
        shown = [float(cell) for cell in line.split("│")[1:3]]
        assert shown == pytest.approx([float(row["noise.D0"]), float(row["oscillator.omega"])], rel=1e-5)
