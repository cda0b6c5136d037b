"""What is printed fits the terminal, and no number is broken."""

import re
from dataclasses import replace

import pytest

from fpsolve.case.case import load_case
from fpsolve.exponent.error import Failure
from fpsolve.output.terminal import print_remark, print_results, print_simulation, print_warnings
from fpsolve.study.simulate import simulate_curves
from tests.solving import solve_case
from tests.test_workflow import TEXT

NONLINEAR = ["vary={}", "oscillator.c1=0.8", "oscillator.c2=0.5", "monte_carlo={ paths = 64, time = 100.0 }"]
QUANTITY = re.compile(r"(\S+) = \S+ ± \S+")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = tmp_path_factory.mktemp("terminal") / "quick.toml"
    path.write_text(TEXT, encoding="utf-8")
    return load_case(path, NONLINEAR)


@pytest.mark.parametrize("width", [60, 80, 200])
def test_quantities_are_whole(case, width, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    results, simulated = solve_case(case), tuple(simulate_curves(case))
    capsys.readouterr()
    for show, names in (
        (lambda: print_results(case, results), {"λ", "δ_p", "Λ″(0)", "N", "R_c"}),
        (lambda: print_simulation(case, simulated), {"λ", "Λ″(0)", *simulated[0].response.means}),
    ):
        show()
        lines = capsys.readouterr().out.splitlines()
        assert {name for line in lines for name in QUANTITY.findall(line)} == names
        assert max(map(len, lines)) <= width
        assert not [line for line in lines if line.rstrip().endswith("±") or line.startswith("±")]


@pytest.mark.parametrize("width", [50, 80, 120])
def test_remarks_are_wrapped(width, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    text = "warning: case: " + "Λ(2) may be 1e-10 or [less] than " * 10 + "a_word_as_long_as_a_path/" * 6
    print_remark(text, "yellow")
    first, *others = capsys.readouterr().err.splitlines()
    assert all(line.startswith("  ") for line in others)
    assert " ".join([first, *(line.strip() for line in others)]) == text
    assert all(len(line) < width for line in [first, *others[:-1]])


@pytest.mark.parametrize(
    ("treatments", "star"),
    [(["exact", "ou-reduction"], True), (["ou-reduction"], False), (["exact"], True)],
)
def test_a_star_tells_of_exact_noise_on_any_curve(treatments, star, tmp_path, capsys, monkeypatch):
    """Texts give way to numbers, which are whole."""
    monkeypatch.setenv("COLUMNS", "80")
    path = tmp_path / "mixed.toml"
    path.write_text(TEXT, encoding="utf-8")
    sets = [f"vary={{ noise.D0 = [0.1, 1.0], noise.treatment = {treatments} }}".replace("'", '"')]
    case = load_case(path, [*sets, "output.eigenfunctions=[]", 'figure={ x = "noise.D0", y = "lyapunov_exponent" }'])
    results = solve_case(case)
    print_results(case, results)
    out = capsys.readouterr().out
    assert ("Eq. (39)*" in out, "* for the noise reduced by" in out) == (star, star)
    assert "…" not in out
    for result in results:
        assert f"{result.lyapunov_exponent.value:#.7g}"[:8] in out


def test_tables_without_indices_stand_apart(tmp_path, capsys):
    path = tmp_path / "moments.toml"
    path.write_text(TEXT, encoding="utf-8")
    case = load_case(path, ['noise.treatment="exact"', "output={ quantities = ['moment'] }"])
    print_results(case, solve_case(case))
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    ends = [i for i, line in enumerate(lines) if line.startswith("* for the noise reduced by")]
    assert [lines[i + 1] for i in ends] == ["", ""]


def test_what_is_missing_is_told_before_what_is_only_remarkable(case, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    (result,) = solve_case(case)
    noted = replace(result, notes=tuple(f"note {i}" for i in range(25)), warnings=())
    failed = replace(noted, notes=("a note",), warnings=("a warning",), failures=(Failure(2.0, "a reason"),))
    capsys.readouterr()
    print_warnings(case, [noted, failed])
    first, second, *_, last = capsys.readouterr().err.splitlines()
    assert re.fullmatch("not converged: .*: a reason", first)
    assert re.fullmatch("warning: .*: a warning", second)
    assert last.endswith("more remarks are in summary.json: 8 notes")
