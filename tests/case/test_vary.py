"""[vary]: lists and ranges, products and sets side by side, files of sets; and which quantities are asked for."""

from __future__ import annotations

import csv
import itertools
import os
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.case.sections import QUANTITY_NAMES, Sweep
from fpsolve.case.vary import Vary, assignments, legend, repeats
from fpsolve.cli import main
from fpsolve.errors import CaseError
from fpsolve.model.noises.non_gaussian import NonGaussianNoise, ReducedNoise
from fpsolve.model.problem import Problem
from fpsolve.theory.perturbation import second_order
from tests.conftest import FIG1, FIG1_NOISE

TEXT = """\
title = "varied"
oscillator = { omega = 2, restitution = 0.9, c1 = 0.1, epsilon = 0.5, impact = "restitution" }
noise = { D0 = 1, tau0 = 1, r0 = 0.9 }
moments.p = [2, -1]
"""
Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_text(vary: str, rest: str = "") -> Path:
        path = tmp_path / "varied.toml"
        path.write_text(f"{TEXT}[vary]\n{vary}\n{rest}", encoding="utf-8")
        return path

    return write_text


def faults_of(path: Path, overrides: Sequence[str] = ()) -> list[str]:
    """Key and sentence of each fault."""
    with pytest.raises(CaseError) as raised:
        load_case(path, overrides)
    return [f"{fault.key}: {fault.sentence}" for fault in raised.value.faults]


def only_fault(path: Path, overrides: Sequence[str] = ()) -> str:
    [text] = faults_of(path, overrides)
    return text


COLUMNS = {"noise.D0": (0.1, 0.5, 1.0), "noise.treatment": ("exact", "ou-reduction"), "oscillator.omega": (1.0, 2.0)}


def test_a_product_has_all_combinations_the_last_key_fastest() -> None:
    vary = Vary(COLUMNS)
    expected = [dict(zip(COLUMNS, values, strict=True)) for values in itertools.product(*COLUMNS.values())]
    assert list(vary.sets) == expected
    assert len(vary) == 12
    assert vary.keys == tuple(COLUMNS)
    assert list(pickle.loads(pickle.dumps(vary)).sets) == expected


def test_sets_side_by_side() -> None:
    vary = Vary({"noise.D0": (0.1, 0.5, 0.1), "noise.r0": (0.9, 0.9, 0.8)}, "zip")
    assert len(vary) == 3
    assert vary.sets[1:] == ({"noise.D0": 0.5, "noise.r0": 0.9}, {"noise.D0": 0.1, "noise.r0": 0.8})
    assert vary.values("noise.D0") == (0.1, 0.5)
    assert list(vary.among(["noise.r0"])) == [{"noise.r0": 0.9}, {"noise.r0": 0.8}]


@pytest.mark.parametrize("mode", ["product", "zip"])
def test_nothing_varied_is_one_set(mode: str) -> None:
    vary = Vary({}, mode)  # type: ignore[arg-type]
    assert not vary
    assert (len(vary), vary.sets, vary.keys) == (1, ({},), ())


def test_curves_are_made_when_they_are_asked_for(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    case = load_case(write('"noise.D0" = { start = 1.0, stop = 2.0, num = 100 }\n"oscillator.c1" = [0.1, 0.2, 0.3]'))
    made = []
    monkeypatch.setattr("fpsolve.case.case.Curve", lambda *arguments: made.append(arguments[-1]) or arguments[-1])
    assert case.planned == 300
    assert list(itertools.islice(case.curves(297), 2)) == made == [298, 299]
    assert list(case.curves(1, 3)) == [2, 3]


@pytest.mark.parametrize(
    ("sweep", "values"),
    [
        ((1e-4, 1e-1, 4, "log"), [1e-4, 1e-3, 1e-2, 1e-1]),
        ((0.1, 10.0, 3, "log"), [0.1, 1.0, 10.0]),
        ((1e-15, 1e15, 31, "log"), [float(f"1e{power}") for power in range(-15, 16)]),
        ((1.0, 2.0, 3, "log"), [1.0, 1.41421356237, 2.0]),
        ((0.1234567890123456, 0.3, 2, "log"), [0.1234567890123456, 0.3]),
        ((1e-15, 5e-15, 5, "linear"), [1e-15, 2e-15, 3e-15, 4e-15, 5e-15]),
        ((-0.3, 0.1, 5, "linear"), [-0.3, -0.2, -0.1, 0.0, 0.1]),
        ((-0.2, 0.2, 9, "linear"), [-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2]),
        ((-1.0, 0.2, 5, "linear"), [-1.0, -0.7, -0.4, -0.1, 0.2]),
        ((-0.0, 1e300, 3, "linear"), [0.0, 5e299, 1e300]),
        ((0.1234567890123456, 1.1234567890123457, 2, "linear"), [0.1234567890123456, 1.1234567890123457]),
    ],
)
def test_values_of_ranges_have_no_needless_digits(sweep: tuple[float, float, int, str], values: list[float]) -> None:
    start, stop, num, scale = sweep
    found = Sweep(start=start, stop=stop, num=num, scale=scale).values.tolist()  # type: ignore[arg-type]
    assert list(map(repr, found)) == list(map(repr, values))


def test_a_range_has_a_constant_factor() -> None:
    values = Sweep(start=0.37, stop=91.0, num=50, scale="log").values
    np.testing.assert_allclose(values[1:] / values[:-1], (91 / 0.37) ** (1 / 49), rtol=1e-11)


@pytest.mark.parametrize(
    "spelling",
    [
        '"noise.D0" = { start = 0.1, stop = 10.0, num = 3, scale = "log" }',
        'noise.D0 = { start = 0.1, stop = 10.0, num = 3, scale = "log" }',
        'noise = { D0 = { start = 0.1, stop = 10.0, num = 3, scale = "log" } }',
        '[vary.noise.D0]\nstart = 0.1\nstop = 10.0\nnum = 3\nscale = "log"',
        '[vary."noise.D0"]\nstart = 0.1\nstop = 10.0\nnum = 3\nscale = "log"',
        'noise.D0.start = 0.1\nnoise.D0.stop = 10.0\nnoise.D0.num = 3\nnoise.D0.scale = "log"',
    ],
)
def test_spellings_of_a_range(write: Write, spelling: str) -> None:
    case = load_case(write(spelling), ['moments.p={ start = 0.01, stop = 1.0, num = 3, scale = "log" }'])
    assert case.vary.columns["noise.D0"] == (0.1, 1.0, 10.0)
    assert case.p.tolist() == [0.01, 0.1, 1.0]


def test_the_treatment_of_the_noise_and_the_impact_law_vary(write: Write) -> None:
    """Eq. (37) has the reduced noise on every curve; on the exact ones the solution has another."""
    case = load_case(write('noise.treatment = ["ou-reduction", "exact"]\noscillator.impact = ["delta", "restitution"]'))
    curves = list(case.curves())
    assert [type(curve.noise) for curve in curves] == [ReducedNoise] * 2 + [NonGaussianNoise] * 2
    assert [curve.theory_reduces_noise for curve in curves] == [False, False, True, True]
    assert [curve.oscillator.impact for curve in curves] == ["delta", "restitution"] * 2
    assert curves[3].label == "noise.treatment = exact, oscillator.impact = restitution"
    assert second_order(curves[0].problem).moment_exponent(2.0) == second_order(curves[2].problem).moment_exponent(2.0)


def test_sets_side_by_side_may_share_values(write: Write) -> None:
    tau0 = "{ start = 1, stop = 3, num = 3 }"
    case = load_case(write(f'mode = "zip"\nnoise.D0 = [1, 2, 1]\nnoise.tau0 = {tau0}\nnoise.r0 = [0.9, 0.9, 0.9]'))
    assert [tuple(curve.varied.values()) for curve in case.curves()] == [(1, 1, 0.9), (2, 2, 0.9), (1, 3, 0.9)]


def test_sets_that_differ_by_rounding_only_are_one(write: Write) -> None:
    values = "noise.D0 = [0.3, 0.5, 0.30000000000000004]"
    assert load_case(write(f'mode = "zip"\n{values}\nnoise.r0 = [0.9, 0.9, 0.8]')).planned == 3


def test_expectations_select_curves_by_texts(write: Write) -> None:
    expected = (
        '[[expect]]\nquantity = "variance_rate"\nvalue = 1\nrtol = 1\nsource = "none"\nwhere = { noise.treatment = '
    )
    vary = 'noise.treatment = ["ou-reduction", "exact"]\nnoise.D0 = [1, 2]'
    case = load_case(write(vary, f'{expected}"exact" }}'))
    assert [case.expect[0].selects(curve.varied) for curve in case.curves()] == [False, False, True, True]


def test_texts_and_numbers_are_written_for_the_eye() -> None:
    varied = {"noise.D0": 0.1234567890123, "noise.treatment": "exact", "oscillator.impact": "delta"}
    assert assignments(varied, "g") == "noise.D0 = 0.123457, noise.treatment = exact, oscillator.impact = delta"
    assert assignments(varied).startswith("noise.D0 = 0.1234567890123, ")
    known = Problem(FIG1, FIG1_NOISE).parameters
    assert legend(varied, lambda key: known[key].quantity) == "$D_0$ = 0.123457/time, treatment = exact, impact = delta"


def test_a_mesh_is_judged_for_each_treatment(write: Write) -> None:
    """Bounded noise cuts the mesh off, Gaussian noise does not."""
    mesh = "[mesh]\nxi_max = 100.0"
    load_case(write('noise.treatment = ["exact"]', mesh))


def sets_file(folder: Path, text: str | bytes) -> None:
    (folder / "sets.csv").write_bytes(text.encode() if isinstance(text, str) else text)


def test_a_file_of_sets(write: Write, tmp_path: Path) -> None:
    """With the mark that Excel writes, its line ends, blank lines, quotes and empty cells at the end."""
    text = '\ufeffnoise.D0, "noise.treatment",oscillator.c1\r\n\r\n0.1,exact,-0\r\n 1e0 ,"ou-reduction",.5\r\n,,\r\n'
    sets_file(tmp_path, text.replace(', "', ',"'))
    for path in (write('file = "sets.csv"'), write('file = "sets.csv"\nmode = "zip"')):
        case = load_case(path)
        assert [curve.varied for curve in case.curves()] == [
            {"noise.D0": 0.1, "noise.treatment": "exact", "oscillator.c1": 0.0},
            {"noise.D0": 1.0, "noise.treatment": "ou-reduction", "oscillator.c1": 0.5},
        ]
        assert (case.planned, case.vary.mode) == (2, "zip")
        assert str(next(case.curves()).varied["oscillator.c1"]) == "0.0"


def test_a_cell_that_is_too_long(write: Write, tmp_path: Path) -> None:
    sets_file(tmp_path, "noise.D0\n1\n" + "9" * 200_000)
    words = "vary.file: sets.csv:3: cannot be read as comma-separated values (field larger than"
    assert only_fault(write('file = "sets.csv"')).startswith(words)


def test_no_file(write: Write, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for file, words in (
        ("folder", "is a directory; name a file of sets in it, such as sets.csv"),
        ("pipe", "is a pipe or a device, not a file; write the sets into a file and name that"),
    ):
        assert only_fault(write(f'file = "{file}"')) == f"vary.file: {file}: {words}"


def test_the_faulty_rows_of_a_long_file_are_told_together(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four kinds among 200 rows; nothing is run or written."""
    rows = [[str(1 + i / 100), "0.5", "exact" if i % 2 else "ou-reduction"] for i in range(200)]
    rows[9][0] = "fast"
    rows[49] = rows[49][:2]
    rows[99][2] = "exat"
    rows[120] = list(rows[20])
    rows[150][1] = "-3"
    with (tmp_path / "sets.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([["noise.D0", "noise.r0", "noise.treatment"], *rows])
    path = write('file = "sets.csv"', "[budget]\nunknowns = 1")
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.splitlines()
    starts = [
        "11: noise.D0: got fast; must be ",
        "51: has 2 cells; must have 3",
        "101: noise.treatment: got exat; ",
        "122: is the same set as line 22; ",
    ]
    for line, start in zip(lines, starts, strict=False):
        assert line.startswith(f"{path}:6: vary.file: sets.csv:{start}")
    assert len(lines) == len(starts) + 1
    assert lines[-1].startswith(f"{path}:8: budget.unknowns: ")
    assert not (tmp_path / "out").exists()


def test_every_faulty_row_is_a_fault(write: Write, tmp_path: Path) -> None:
    sets_file(tmp_path, "noise.D0\n" + "-1\n" * 300)
    faults = faults_of(write('file = "sets.csv"'))
    assert len(faults) == 300
    assert faults[49].startswith("vary.file: sets.csv:51: ")


def test_overrides_of_ranges_and_files(write: Write, tmp_path: Path) -> None:
    sets_file(tmp_path, "noise.D0\n0.3\n0.4\n")
    path = write('"noise.D0" = { start = 1, stop = 2, num = 5 }')
    assert load_case(path, ["vary.noise.D0.num=3"]).vary.values("noise.D0") == (1.0, 1.5, 2.0)
    assert load_case(path, ['vary."noise.D0"=[4.0]']).vary.values("noise.D0") == (4.0,)
    ranged = load_case(path, ['vary.noise.D0={ start = 1, stop = 100, num = 3, scale = "log" }'])
    assert ranged.vary.values("noise.D0") == (1.0, 10.0, 100.0)
    assert load_case(path, ['vary={ file = "sets.csv" }']).vary.values("noise.D0") == (0.3, 0.4)
    assert load_case(write('file = "other.csv"'), ["vary.file=sets.csv"]).vary.values("noise.D0") == (0.3, 0.4)
    assert not load_case(write('file = "other.csv"'), ["vary={}"]).vary


def test_sets_that_are_the_same_are_found() -> None:
    """Numbers are the same to 12 digits, zeros of either sign, too."""
    rows = [(0.3, "a"), (0.3 * (1 + 1e-14), "a"), (0.3, "b"), (-0.0, "a"), (0.3 * (1 + 1e-11), "a"), (0.0, "a")]
    assert repeats(rows) == [(1, 0), (5, 3)]


@pytest.mark.slow
def test_a_set_that_is_found_not_to_be_possible_fails_alone(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is told with its line, which may be another one the next time, and the others are solved."""
    rows = "1,0.1,0.9\n1.1,1e4,1\n1.2,0.1,0.1\n1.3,1e3,0.5\n1.4,0.1,0.9\n"
    only = '[output]\nquantities = ["moment"]\nfigure = false'
    path = write('file = "sets.csv"', only)
    for line, header in ((5, ""), (6, "\n")):
        sets_file(tmp_path, f"{header}noise.D0,oscillator.epsilon,oscillator.restitution\n{rows}")
        options = ["--set", "moments.p=[-1.0]", "--set", 'oscillator.impact="delta"', "--set", "budget.seconds=2.0"]
        assert main(["run", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", *options]) == 3
        assert f"sets.csv:{line}: Eqs. (37)-(38) or R^p overflow; " in capsys.readouterr().err
        with (tmp_path / "out/varied/curves.csv").open(newline="", encoding="utf-8") as table:
            status = [row["status"] for row in csv.DictReader(table)]
        assert (status[3], status[0], status[2], status[4]) == ("failed", "converged", "converged", "converged")


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        ["--report"],
        ["--all", "--table", "--set", "figure={ x = 'oscillator.epsilon', y = 'lyapunov_exponent' }"],
        ["--set", "uncertain={ 'noise.D0' = 0.1 }", "--set", "output.quantities=['moment', 'rate_function']"],
    ],
)
def test_a_set_that_contradicts_itself_is_told_beside_the_others(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str]
) -> None:
    path = write('"oscillator.epsilon" = [0.1, 9.0, 0.2]')
    assert main(["run", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", *options]) == 3
    assert "the restitution law needs" in capsys.readouterr().err
    with (tmp_path / "out/varied/curves.csv").open(newline="", encoding="utf-8") as table:
        assert [row["status"] for row in csv.DictReader(table)] == ["converged", "failed", "converged"]
    for command in ("simulate", "prove"):
        assert main([command, str(path)]) == 2
        assert "with oscillator.epsilon = 9: the restitution law needs" in capsys.readouterr().err


def test_quantities(write: Write) -> None:
    cheap = ("moment", "lyapunov_exponent", "stability_index", "impact_rate", "critical_impact_factor")
    assert load_case(write("")).asked == (*cheap, "eigenfunctions")
    assert load_case(write("", '[output]\nquantities = "all"\n')).asked == QUANTITY_NAMES
    some = '[output]\nquantities = ["stability_index", "moment"]\neigenfunctions = []\nsensitivities = false\n'
    assert load_case(write("", some)).asked == ("stability_index", "moment")
    expected = '[[expect]]\nquantity = "variance_rate"\nvalue = 1\nrtol = 1\nsource = "none"\n'
    assert load_case(write("", some + expected)).expect
