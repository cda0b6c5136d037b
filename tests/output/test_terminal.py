"""What is printed fits the terminal, and no number is broken."""

import re
import sys

import pytest

from fpsolve.case.case import load_case
from fpsolve.output.remarks import print_remark
from fpsolve.output.terminal import print_results, print_simulation
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


@pytest.fixture
def terminal(monkeypatch):
    """Makes the standard streams a terminal of a width."""

    def begin(width):
        monkeypatch.setenv("COLUMNS", str(width))
        monkeypatch.setenv("TERM", "dumb")
        for stream in (sys.stdout, sys.stderr):
            monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)

    return begin


@pytest.mark.parametrize("width", [60, 80, 200])
def test_quantities_are_whole(case, width, capsys, terminal):
    results, simulated = solve_case(case), tuple(simulate_curves(case))
    terminal(width)
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
def test_remarks_are_wrapped_on_a_terminal(width, capsys, terminal):
    terminal(width)
    text = "case: " + "Λ(2) may be 1e-10 or [less] than " * 10 + "a_word_as_long_as_a_path/" * 6
    print_remark(text)
    first, *others = capsys.readouterr().err.splitlines()
    assert all(line.startswith("  ") for line in others)
    assert " ".join([first, *(line.strip() for line in others)]) == f"note: {text}"
    assert all(len(line) < width for line in [first, *others[:-1]])


def test_remarks_are_whole_in_a_file(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    print_remark("case: " + "a word " * 50)
    assert capsys.readouterr().err.splitlines() == [("note: case: " + "a word " * 50).rstrip()]


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
