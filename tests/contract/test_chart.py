"""`fpsolve chart`: lines where their quantity is zero, what is said of the regions between them, and its files."""

from contextlib import nullcontext

import numpy as np
import pytest

from fpsolve import ExponentSolver, load_case
from fpsolve.commands import chart_case
from fpsolve.tell import Watch
from tests.kit import case_in, case_text, read_csv, read_json, run

TEXT = """[moments]
p = [2.0]
[chart]
nodes = 5
step = 0.06
x = { key = "oscillator.omega", start = 0.5, stop = 3.0, scale = "log", at = [1.0] }
y = { key = "noise.D0", start = 0.01, stop = 1.0 }
lines = ["lyapunov_exponent = 0", "moment(2) = 0", "stability_index = -1"]
"""
CASE = case_text(TEXT, noise={"D0": 0.1})
TWO = ["chart.lines=['lyapunov_exponent = 0', 'moment(2) = 0']", "chart.x.at=[]"]
LINES = {"lyapunov_exponent = 0": 0.0, "moment(2) = 0": 2.0, "stability_index = -1": -1.0}
"""The p of each line."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chart")
    done = run(folder, "chart", "case.toml", "--jobs", "1", case=CASE)
    assert done.code == 0, done.err
    return folder / "results/case"


def solver_at(x, y, folder):
    problem = load_case(folder.parents[1] / "case.toml").problem
    return ExponentSolver(problem.at({"oscillator.omega": float(x), "noise.D0": float(y)}), rtol=1e-11)


def test_lines_of_a_chart_lie_where_their_quantity_is_zero(folder):
    rows = read_csv(folder / "chart.csv")
    assert list(rows[0]) == ["line", "branch", "x", "y", "width", "label"]
    assert [*dict.fromkeys(row["line"] for row in rows)] == [*LINES]
    assert all(0 <= float(row["width"]) < 1e-8 for row in rows)
    for name, p in LINES.items():
        for row in [each for each in rows if each["line"] == name][::15]:
            solver = solver_at(row["x"], row["y"], folder)
            value = solver.pair(p).value / p if p else solver.lyapunov_exponent().value
            assert abs(value) < 1e-11, row  # of a strength of 0.01
    labels = {row["label"] for row in rows}
    assert labels == {"", "leaves the frame", "at oscillator.omega = 1"}
    asked = [row for row in rows if row["label"].startswith("at ")]
    assert [row["line"] for row in asked] == [*LINES][:2]
    assert all(float(row["x"]) == pytest.approx(1.0, rel=1e-12) for row in asked)


def test_closed_forms_of_a_chart_are_near_its_lines_in_weak_noise(folder):
    """Eqs. (38)-(39) are off by O(ε²): ε = 0.1."""
    rows, summary = read_csv(folder / "chart.csv"), read_json(folder / "chart.json")
    assert {form["line"] for form in summary["closed_forms"]} <= {*LINES}
    for form in summary["closed_forms"]:
        points = np.array(form["branches"][0])
        line = np.array([[float(row["x"]), float(row["y"])] for row in rows if row["line"] == form["line"]])
        distances = [np.min(np.hypot(np.log(points[:, 0] / x) / np.log(6), points[:, 1] - y)) for x, y in line]
        assert max(distances) < 0.02


def test_regions_of_a_chart_are_named_by_what_is_stable_in_them(folder):
    regions = read_json(folder / "chart.json")["regions"]
    assert sum(region["share"] for region in regions) == pytest.approx(1)
    assert len(regions) > 2
    for region in regions:
        solver = solver_at(region["x"], region["y"], folder)
        stable = "almost surely stable" if solver.lyapunov_exponent().value < 0 else "almost surely unstable"
        second = "second moment stable" if solver.pair(2.0).value < 0 else "second moment unstable"
        assert region["name"].startswith(f"{stable}, {second}")
        assert ("δ_p < -1" in region["name"]) == (solver.pair(-1.0).value < 0)


def test_files_and_summary_of_a_chart(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {"chart.csv", "chart.json", "chart.png", "chart.pdf", "records"}
    summary = read_json(folder / "chart.json")
    assert (summary["complete"], summary["planned"], summary["done"]) == (True, 3, 3)
    assert summary["x"] == {"key": "oscillator.omega", "start": 0.5, "stop": 3.0, "scale": "log", "at": [1.0]}
    assert [(line["line"], line["scan"]["nodes"]) for line in summary["lines"]] == [(name, [5, 5]) for name in LINES]
    assert [line["appears"] for line in summary["lines"]] == [None, None, "hump of the amplitude density"]
    assert "oscillator.omega" not in summary["parameters"]
    assert summary["parameters"]["oscillator.c1"] == 0.1


@pytest.mark.slow
def test_a_line_that_does_not_cross_the_frame_is_said_so(tmp_path):
    overrides = ["chart.x.start=2.5", "chart.x.at=[]", "chart.y.stop=0.05", "chart.lines=['moment(2) = 0']"]
    done = run(tmp_path, "chart", "case.toml", *(f"--set={each}" for each in overrides), case=CASE)
    summary = read_json(tmp_path / "results/case/chart.json")
    assert (done.code, summary["complete"], summary["warnings"]) == (0, True, ["Λ(2) < 0 everywhere in the frame"])
    assert "Λ(2) < 0 everywhere in the frame" in done.err
    assert [region["name"] for region in summary["regions"]] == ["second moment stable"]


LONG = """title = "A delay of thousands of periods"
moments.p = [2.0]
output.quantities = ["moment"]
[system]
variables = ["x", "v"]
drift = ["v", "-x - 0.1*v + 0.5*x(t - tau) - 0.1*xi*x(t - tau)"]
parameters = { tau = 3000.0 }
[noise]
kind = "white"
s = 1.0
[chart]
x = { key = "system.tau", start = 3000.0, stop = 5000.0 }
y = { key = "noise.s", start = 0.1, stop = 1.0 }
lines = ["moment(2) = 0"]
nodes = 2
"""


def test_a_chart_of_which_no_point_is_solved_has_failed_for_one_reason(tmp_path):
    done = run(tmp_path, "chart", "case.toml", "--jobs", "1", case=LONG)
    told = " ".join(done.err.split())
    assert done.code == 3
    assert told.count("fpsolve found Λ(2) at no point of the frame: Λ(2) did not converge: ") == 1
    assert told.count("is not found for a delay so long") == 1


@pytest.mark.slow
def test_an_interrupted_chart_goes_on_to_the_same_lines_and_a_whole_one_solves_nothing_again(tmp_path):
    case, counts, most = case_in(tmp_path, CASE, TWO), dict.fromkeys(("scan", "lines"), 0), [np.inf]

    def bar(phase):
        def advance(count=1, *, failed=0, known=False):
            counts[phase.name] += 0 if known else count
            if sum(counts.values()) > most[0]:
                raise KeyboardInterrupt

        return nullcontext(advance)

    def points(place):
        rows = read_csv(tmp_path / place / "test/chart.csv")
        return np.array([[float(row["x"]), float(row["y"])] for row in rows])

    watch = Watch(bar=bar)
    whole = chart_case(case, tmp_path / "whole", watch=watch)
    assert counts == {"scan": 2 * 25, "lines": sum(branch.x.size for line in whole.lines for branch in line.branches)}
    total = sum(counts.values())
    kept = {path: path.read_bytes() for path in (tmp_path / "whole/test/records").rglob("*.jsonl")}
    chart_case(case, tmp_path / "whole", watch=watch)
    assert {path: path.read_bytes() for path in kept} == kept
    for share, done in ((0.3, 0), (0.6, 1)):
        most[0] = sum(counts.values()) + share * total
        with pytest.raises(KeyboardInterrupt, match=r"of 2 lines; .*run it again to go on"):
            chart_case(case, tmp_path / "out", watch=watch)
        summary = read_json(tmp_path / "out/test/chart.json") if done else {"complete": False, "lines": []}
        assert (summary["complete"], len(summary["lines"])) == (False, done)
    most[0] = np.inf
    chart_case(case, tmp_path / "out", watch=watch)
    one, other = points("whole"), points("out")
    assert abs(len(one) - len(other)) <= 2
    assert max(np.min(np.hypot(*(one - point).T)) for point in other) < 0.05


@pytest.mark.slow
def test_what_only_other_commands_use_does_not_keep_a_case_from_being_read(tmp_path):
    assert case_in(tmp_path, CASE, ["chart.x.key='none'", "monte_carlo.step=9.0", "mesh.xi_max=100.0"]).planned == 1


def test_a_map_and_a_chart_of_the_same_keys_share_a_folder(tmp_path):
    sets = ["vary.oscillator.omega=[1.0, 2.0]", "vary.noise.D0=[0.1, 0.2]", "chart.lines=['moment(2) = 0']"]
    sets += [
        "figure={x='oscillator.omega', y={moment=2.0}, map=true}",
        "output={quantities=['moment'], eigenfunctions=[]}",
    ]
    for command in ("run", "chart", "run"):
        done = run(tmp_path, command, "case.toml", *(f"--set={each}" for each in sets), case=CASE)
        assert done.code == 0, done.err
    folder = tmp_path / "results/case"
    assert {"summary.json", "figure.png", "chart.csv", "chart.png"} <= {each.name for each in folder.iterdir()}
    assert not {"oscillator.omega", "noise.D0"} & read_json(folder / "chart.json")["parameters"].keys()
    assert {row["line"] for row in read_csv(folder / "chart.csv")} == {"moment(2) = 0"}
