"""Charts of stability from a case file: what is written, and what its regions say."""

import math
from contextlib import nullcontext

import numpy as np
import pytest

from fpsolve import ExponentSolver, load_case
from fpsolve.analysis.zero import ZeroField
from fpsolve.cli import main
from fpsolve.errors import CaseError
from fpsolve.workflow import Watch, chart_case, run
from fpsolve.workflow.chart import chart_work, solve_chart
from tests.conftest import painted
from tests.kit import case_text, read_csv, read_json

CHART = """[moments]
p = [2.0]
[chart]
x = { key = "oscillator.omega", start = 0.5, stop = 3.0, scale = "log", at = [1.0] }
y = { key = "noise.D0", start = 0.01, stop = 1.0 }
zero = ["lyapunov_exponent", { moment = 2.0 }, { stability_index = -1.0 }]
"""
CASE = case_text(CHART, noise={"D0": 0.1})
LONG = """title = "A delay of thousands of periods"
[system]
variables = ["x", "v"]
drift = ["v", "-x - 0.1*v + 0.5*x(t - tau) - 0.1*xi*x(t - tau)"]
parameters = { tau = 3000.0 }
[noise]
kind = "white"
s = 1.0
[moments]
p = [2.0]
[output]
quantities = ["moment"]
[chart]
x = { key = "system.tau", start = 3000.0, stop = 5000.0 }
y = { key = "noise.s", start = 0.1, stop = 1.0 }
zero = [{ moment = 2.0 }]
nodes = 3
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("charts") / "plane.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.fixture(scope="module", autouse=True)
def few_nodes():
    """Scans with fewer nodes than usual, which take a fifth of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fpsolve.analysis.stability.NODES", 5)
        patch.setattr("fpsolve.workflow.chart.CLOSED_FORM_NODES", 31)
        yield


@pytest.fixture(scope="module")
def folder(path):
    out = path.parent / "results"
    with painted():
        assert main(["chart", str(path), "--out", str(out), "--jobs", "1"]) == 0
    return out / "plane"


@pytest.fixture(scope="module")
def rows(folder):
    return read_csv(folder / "chart.csv")


@pytest.fixture(scope="module")
def summary(folder):
    return read_json(folder / "chart.json")


def solver_at(path, x, y):
    """Of the case with the two parameters of its chart."""
    case = load_case(path)
    [curve] = case.curves()
    problem = curve.problem.at({"oscillator.omega": float(x), "noise.D0": float(y)})
    return ExponentSolver(problem, rtol=1e-11)


def test_all_files_are_written(folder):
    assert {path.name for path in folder.iterdir()} == {"chart.csv", "chart.json", "chart.png", "chart.pdf", "records"}
    assert (folder / "chart.png").read_bytes()[1:4] == b"PNG"


def test_the_table_has_the_columns_and_the_names_of_the_lines(rows):
    assert list(rows[0]) == ["line", "branch", "x", "y", "width", "label"]
    assert list(dict.fromkeys(row["line"] for row in rows)) == ["lyapunov_exponent", "moment 2", "stability_index -1"]
    assert {row["branch"] for row in rows} == {"1"}
    assert {row["label"] for row in rows} == {"", "leaves the frame", "at oscillator.omega = 1"}
    assert all(0 <= float(row["width"]) < 1e-8 for row in rows)


def test_every_line_is_where_its_quantity_is_zero(path, rows):
    for name, p in (("lyapunov_exponent", 0.0), ("moment 2", 2.0), ("stability_index -1", -1.0)):
        for row in [each for each in rows if each["line"] == name][::10]:
            solver = solver_at(path, row["x"], row["y"])
            value, _ = solver.ratio_alone(p)
            scale = solver.scale(p) / abs(p) if p else solver.scales.linear
            assert abs(value) < 1e-9 * scale, row


def test_the_values_asked_for_are_points(rows):
    asked = [row for row in rows if row["label"].startswith("at ")]
    assert [row["line"] for row in asked] == ["lyapunov_exponent", "moment 2"]
    assert all(float(row["x"]) == pytest.approx(1.0, rel=1e-12) for row in asked)


def test_the_summary_says_what_was_done(summary):
    assert (summary["complete"], summary["planned"], summary["done"]) == (True, 3, 3)
    assert summary["x"] == {"key": "oscillator.omega", "start": 0.5, "stop": 3.0, "scale": "log", "at": [1.0]}
    assert [line["line"] for line in summary["lines"]] == ["lyapunov_exponent", "moment 2", "stability_index -1"]
    assert summary["lines"][0]["scan"]["nodes"] == [5, 5]
    assert [line["appears"] for line in summary["lines"]] == [None, None, "hump of the amplitude density"]
    assert "oscillator.omega" not in summary["parameters"]
    assert summary["parameters"]["oscillator.c1"] == 0.1


def test_the_closed_forms_are_near_in_weak_noise(rows, summary):
    """Eqs. (38)-(39) are off by O(ε²): ε = 0.1."""
    for form in summary["closed_forms"]:
        points = np.array(form["branches"][0])
        line = np.array([[float(row["x"]), float(row["y"])] for row in rows if row["line"] == form["line"]])
        distances = [np.min(np.hypot(np.log(points[:, 0] / x) / np.log(6), points[:, 1] - y)) for x, y in line]
        assert max(distances) < 0.02


def test_the_regions_say_what_is_stable_in_them(path, summary):
    assert sum(region["share"] for region in summary["regions"]) == pytest.approx(1)
    for region in summary["regions"]:
        solver = solver_at(path, region["x"], region["y"])
        stable = "almost surely stable" if solver.lyapunov_exponent().value < 0 else "almost surely unstable"
        second = "second moment stable" if solver.pair(2.0).value < 0 else "second moment unstable"
        assert region["name"].startswith(f"{stable}, {second}")
        assert ("δ_p < -1" in region["name"]) == (solver.pair(-1.0).value < 0)


@pytest.mark.slow
def test_a_line_that_does_not_cross_the_frame_is_said_so(path, tmp_path, capsys):
    overrides = ["chart.x.start=2.5", "chart.x.at=[]", "chart.y.stop=0.05", "chart.zero=[{moment=2.0}]"]
    words = [word for text in overrides for word in ("--set", text)]
    assert main(["chart", str(path), "--out", str(tmp_path), *words]) == 0
    assert "Λ(2) < 0 everywhere in the frame" in capsys.readouterr().err
    summary = read_json(tmp_path / "plane" / "chart.json")
    assert summary["complete"]
    assert summary["warnings"] == ["Λ(2) < 0 everywhere in the frame"]
    assert [region["name"] for region in summary["regions"]] == ["second moment stable"]


@pytest.mark.slow
def test_interrupted_it_keeps_what_is_traced(path, tmp_path, capsys):
    calls = iter(range(80))

    def progress(**_):
        if next(calls) == 30:  # in the scan for the second line
            raise KeyboardInterrupt

    watch = Watch(bar=lambda phase: nullcontext(progress if phase.total else lambda: None))
    with pytest.raises(KeyboardInterrupt, match="after 1 branch of 3 lines; what was done is kept in"):
        chart_case(load_case(path), tmp_path, watch=watch)
    summary = read_json(tmp_path / "plane" / "chart.json")
    assert not summary["complete"]
    assert [line["line"] for line in summary["lines"]] == ["lyapunov_exponent"]
    assert (tmp_path / "plane" / "chart.png").exists()


@pytest.mark.slow
def test_an_interrupted_chart_solves_no_point_twice(path, tmp_path, monkeypatch):
    """It is interrupted in the scan, and in a branch; a finished one is drawn again without a solve."""
    case, solved, most = load_case(path, ["chart.zero=['lyapunov_exponent', { moment = 2.0 }]"]), [], [math.inf]
    solve = ZeroField._solved

    def counting(field, at):
        if len(solved) == most[0]:
            raise KeyboardInterrupt
        solved.append((field._ratio.p, field._rtol, *at))
        return solve(field, at)

    monkeypatch.setattr(ZeroField, "_solved", counting)
    whole = chart_case(case, tmp_path / "whole")
    count = len(solved)
    chart_case(case, tmp_path / "whole")
    assert len(solved) == count
    solved.clear()
    for most[0] in (20, 77, 122):
        with pytest.raises(KeyboardInterrupt, match="run it again to go on"):
            chart_case(case, tmp_path / "out")
    most[0] = math.inf
    chart = chart_case(case, tmp_path / "out")
    assert len(set(solved)) == len(solved) <= count + 10
    for line, other in zip(chart.lines, whole.lines, strict=True):
        [branch], [known] = line.branches, other.branches
        assert abs(branch.x.size - known.x.size) <= 1
        for x, y in zip(branch.x, branch.y, strict=True):
            assert np.min(np.hypot(known.x - x, known.y - y)) < 0.05


@pytest.mark.slow
def test_a_phase_for_the_scans_and_one_for_the_points(path, tmp_path):
    counts, totals = {}, {}

    def bar(phase):
        counts[phase.name], totals[phase.name] = 0, phase.total
        return nullcontext(lambda: counts.__setitem__(phase.name, counts[phase.name] + 1))

    override = ["chart.zero=['lyapunov_exponent']", "chart.x.at=[]"]
    chart = chart_case(load_case(path, override), tmp_path, watch=Watch(bar=bar))
    assert totals == {"scan": 25, "lines": None}
    assert counts == {"scan": 25, "lines": chart.lines[0].branches[0].x.size}


@pytest.mark.slow
def test_progress_and_rows_are_those_of_the_whole_chart(path):
    """All rows are given to one `map`, so that workers have them while the first line is traced."""
    two = "chart.zero=['lyapunov_exponent', { moment = 2.0 }]"
    case, nodes, points, given = load_case(path, ["chart.x.at=[]", two]), [], [], []

    def noting(function, rows):
        given.append(len(rows))
        return map(function, rows)

    *partial, whole = solve_chart(case, progress=lambda: nodes.append(1), stepped=lambda: points.append(1), map=noting)
    assert given == [2 * 5]
    assert len(nodes) == chart_work(case) == 2 * 5**2
    assert len(points) == sum(branch.x.size for line in whole.lines for branch in line.branches)  # none has a fold
    assert [len(chart.lines) for chart in partial] == [1, 1, 1, 2, 2, 2]
    assert whole.complete
    assert not any(chart.complete for chart in partial)
    assert not any(chart.remarks for chart in partial)  # "no line was found" where none is traced yet


def test_a_case_states_the_nodes_of_its_scan(path):
    case, given = load_case(path, ["chart.nodes=3", 'chart.zero=["lyapunov_exponent"]']), []

    def noting(function, rows):
        given.append(len(rows))
        return map(function, rows)

    first = next(solve_chart(case, map=noting))
    assert (given, chart_work(case)) == ([3], 9)
    assert first.lines[0].scan.values.shape == (3, 3)
    with pytest.raises(CaseError, match=r"chart.nodes: got 1; must be a whole number >= 2 and <= 1000 \(points of"):
        load_case(path, ["chart.nodes=1"])


@pytest.mark.slow
def test_a_map_and_its_chart_share_a_folder(path, tmp_path):
    """What varies are the two keys of the chart, so that neither removes the other, whichever comes first."""
    sets = ["vary.oscillator.omega=[1.0, 2.0]", "vary.noise.D0=[0.1, 0.2]", "chart.zero=[{moment=2.0}]"]
    sets += [
        "figure={x='oscillator.omega', y={moment=2.0}, map=true}",
        "output={quantities=['moment'], eigenfunctions=[]}",
    ]
    case = load_case(path, sets)
    for what in (run, chart_case, run):
        what(case, tmp_path)
    assert {"summary.json", "figure.png", "chart.csv", "chart.png"} <= {
        each.name for each in (tmp_path / "plane").iterdir()
    }
    held = read_json(tmp_path / "plane" / "chart.json")["parameters"]
    assert not {"oscillator.omega", "noise.D0"} & held.keys()
    assert {row["line"] for row in read_csv(tmp_path / "plane/chart.csv")} == {"moment 2"}


def test_a_chart_of_which_nothing_is_solved_has_failed(tmp_path, capsys):
    path = tmp_path / "long.toml"
    path.write_text(LONG, encoding="utf-8")
    assert main(["chart", str(path), "--out", str(tmp_path)]) == 3
    told = " ".join(capsys.readouterr().err.split())
    assert told.count("Λ(2) is found at no point of the frame: Λ(2) did not converge: ") == 1
    assert told.count("is not found for a delay so long") == 1
