"""What is printed fits the terminal, and no number is broken."""

import re
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fpsolve.case.sections import Expectation
from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.quantities import INDICES
from fpsolve.messages import Code, Message, Severity
from fpsolve.model.quantity import OSCILLATOR_RESPONSE
from fpsolve.page.page import Column, Grid, Note
from fpsolve.page.terminal import print_blocks
from fpsolve.results.curve import CurveResult, MomentColumns
from fpsolve.results.text import duration
from fpsolve.show.curves import curve_grid
from fpsolve.show.notes import notes
from fpsolve.show.results import show as show_results
from fpsolve.study.columns import table_of
from fpsolve.study.solve import failed
from fpsolve.workflow import simulate as simulation
from fpsolve.workflow.check import Comparison
from fpsolve.workflow.check import show as show_comparisons
from tests.kit import ALL, TEXT, case_in, simulate_curves, solve_case

NONLINEAR = ["vary={}", "oscillator.c1=0.8", "oscillator.c2=0.5", "response.rtol=0.01"]
NONLINEAR += ["monte_carlo={ paths = 64, time = 100.0 }", "output.quantities='all'"]
MEANS = {each.symbol for each in OSCILLATOR_RESPONSE.means.values()}
NUMBER = re.compile(r"-?\d\S*")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return case_in(tmp_path_factory.mktemp("terminal"), TEXT, NONLINEAR)


@pytest.fixture(scope="module")
def solved(case):
    return solve_case(case)


@pytest.fixture
def terminal(monkeypatch):
    """Makes the standard streams a terminal of a width."""

    def begin(width):
        monkeypatch.setenv("COLUMNS", str(width))
        monkeypatch.setenv("TERM", "dumb")
        for stream in (sys.stdout, sys.stderr):
            monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)

    return begin


def print_results(case, results):
    print_blocks([*show_results(case, results, case.path.parent), *notes(case, results)])


def print_notes(case, results, **more):
    print_blocks(notes(case, results, **more))


def cells(text):
    """The rows of the tables of a text."""
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in text.splitlines() if line.startswith("│")]


@pytest.mark.slow
def test_quantities_are_whole(case, solved, capsys, terminal):
    simulated, place = tuple(simulate_curves(case)), case.path.parent
    for width, (blocks, names) in product(
        (60, 80, 200),
        (
            ([*show_results(case, solved, place)], {"λ", "δ_p", "Λ″(0)", "N", "R_c", *MEANS} - {"⟨x⟩"}),
            ([*simulation.show(case, simulated)], {"λ", "Λ″(0)", *MEANS} - {"⟨A²⟩", "⟨A⁴⟩"}),
            ([*simulation.show(case, simulated, solved)], {"λ", "Λ″(0)", *MEANS} - {"⟨A²⟩", "⟨A⁴⟩"}),
        ),
    ):
        terminal(width)
        print_blocks(blocks)
        out = capsys.readouterr().out
        rows = [row for row in cells(out) if names & set(row)]
        assert names <= {cell for row in rows for cell in row}
        assert all(sum(bool(NUMBER.fullmatch(cell)) for cell in row) >= 2 for row in rows)
        assert max(map(len, out.splitlines())) <= width


@pytest.mark.parametrize("width", [50, 80, 120])
def test_remarks_are_wrapped_on_a_terminal(width, capsys, terminal):
    terminal(width)
    text = "case: " + "Λ(2) may be 1e-10 or [less] than " * 10 + "a_word_as_long_as_a_path/" * 6
    print_blocks([Note(Severity.NOTE, text)])
    first, *others = capsys.readouterr().err.splitlines()
    assert all(line.startswith("  ") for line in others)
    assert " ".join([first, *(line.strip() for line in others)]) == f"note: {text}"
    assert all(len(line) < width for line in [first, *others[:-1]])


def test_remarks_are_whole_in_a_file(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    print_blocks([Note(Severity.NOTE, "case: " + "a word " * 50)])
    assert capsys.readouterr().err.splitlines() == [("note: case: " + "a word " * 50).rstrip()]


@pytest.mark.parametrize(
    ("treatments", "star"),
    [(["exact", "ou-reduction"], True), (["ou-reduction"], False), (["exact"], True)],
)
def test_a_star_tells_of_exact_noise_on_any_curve(treatments, star, tmp_path, capsys, monkeypatch):
    """Texts give way to numbers, which are whole."""
    monkeypatch.setenv("COLUMNS", "80")
    sets = [f"vary={{ noise.D0 = [0.1, 1.0], noise.treatment = {treatments} }}".replace("'", '"')]
    more = ["output.eigenfunctions=[]", 'figure={ x = "noise.D0", y = "lyapunov_exponent" }']
    case = case_in(tmp_path, TEXT, [*sets, *more])
    results = solve_case(case)
    print_results(case, results)
    out = capsys.readouterr().out
    assert ("Eq. (39)*" in out, "* for the noise reduced by" in out) == (star, star)
    assert "…" not in out
    for result in results:
        assert f"{result.lyapunov_exponent.value:#.7g}"[:8] in out


def test_curves_stand_apart(tmp_path, capsys):
    case = case_in(tmp_path, TEXT, ['noise.treatment="exact"', "output={ quantities = ['moment'] }"])
    print_results(case, solve_case(case))
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    first, second = (i for i, line in enumerate(lines) if re.fullmatch(r"noise.D0 = [\d.]+", line))
    assert (lines[0], lines[first - 1], lines[second - 1], lines[-1]) == (case.title, "", "", "")


@pytest.mark.slow
def test_what_is_missing_is_told_before_what_is_only_remarkable(case, solved, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    (result,) = solved
    noted = replace(result, notes=tuple(Message(Code.NO_MOMENT, p=i) for i in range(25)), warnings=())
    failed = replace(
        noted, notes=(Message(Code.NO_MOMENT, p=7),), warnings=("a warning",), failures=(Failure(2.0, "a reason"),)
    )
    capsys.readouterr()
    print_notes(case, [noted, failed])
    first, second, third = capsys.readouterr().err.splitlines()
    assert re.fullmatch("not converged: .*: a reason", first)
    assert re.fullmatch("warning: .*: a warning", second)
    assert re.fullmatch(r"note: .*: there is no Λ\(0\); .*", third)


def result(curve, D0, **more):
    """A made-up result of a curve."""
    numbers = np.array([D0, 2 * D0])
    theory = 0 * numbers
    moments = MomentColumns(np.array([-1.0, 2.0]), numbers, theory, 1e-9 * numbers, *[theory] * 3)
    estimates = {name: Estimate(D0 * (-1) ** i, 1e-12, 1.0) for i, name in enumerate(INDICES)}
    return CurveResult(curve, moments, estimates, **more)


def many(tmp_path, count, overrides=(), **remarks):
    """A case with many curves and made-up results; `remarks` make warnings, notes and failures from a number."""
    intensities = [round(0.125 + 0.0625 * i, 4) for i in range(count)]
    case = case_in(tmp_path, TEXT.replace("[0.1, 1.0]", str(intensities)), overrides, "many")
    return case, [
        result(curve, (curve.number + 0.2) * 1.0123456789e-3, **{kind: make(i) for kind, make in remarks.items()})
        for i, curve in enumerate(case.curves())
    ]


def tokens(text):
    return {token for token in re.split(r"[\s│┃┏┳━┓┡╇┩├┼┤└┴┘─]+", text) if token}


KINDS = {
    "warnings": lambda i: (
        Message(Code.INDEX_RTOL_MISSED, rtol=1e-8, symbol="λ", value=i, error=1e-5, size=(i * 7) % 11 * 1e-6),
    ),
    "notes": lambda i: (Message(Code.STRONG_NOISE, first=i, most=0.05, p=6, rest=i / 100, size=i % 90 / 100),),
}
SECTIONS = [
    [],
    ['figure={ x = "noise.D0", y = "lyapunov_exponent" }'],
    ["vary.oscillator.omega=[1.0, 2.0]", "vary.noise.treatment=['ou-reduction', 'exact']"],
]


@pytest.mark.parametrize("count", [1, 3, 12, 60])
@pytest.mark.parametrize("overrides", SECTIONS)
@pytest.mark.parametrize("width", [60, 80])
def test_a_narrow_terminal_breaks_and_cuts_nothing(tmp_path, capsys, terminal, count, overrides, width):
    case, results = many(tmp_path, count, overrides, **KINDS)
    print_results(case, results)
    whole = capsys.readouterr()
    terminal(width)
    print_results(case, results)
    narrow = capsys.readouterr()
    allowed = {"no", "room", "for:", "=", "Eq.", *(f"{each}," for each in tokens(whole.out))}
    assert tokens(narrow.out) - tokens(whole.out) <= allowed
    assert tokens(narrow.err) == tokens(whole.err)
    for text in (narrow.out, narrow.err):
        assert max(map(len, text.splitlines())) <= width
        assert "…" not in text


@pytest.mark.parametrize(("count", "rows"), [(11, 11), (50, 50)])
def test_many_curves_have_a_row_each(tmp_path, capsys, count, rows):
    case, results = many(tmp_path, count)
    print_results(case, results)
    out = capsys.readouterr().out
    assert sum(line.startswith("│") for line in out.splitlines()) == rows
    assert f"{count} curves: {count} converged" in out
    for each in results:
        assert f"{each.lyapunov_exponent.value:#.7g}" in out


def test_of_more_curves_the_extreme_and_the_failed_ones_have_a_row(tmp_path, capsys):
    def failures(i):
        return (Failure(2.0, Message(Code.NOT_CONVERGED, p=2.0, reason=f"at {i % 2}")),) if i in (7, 40) else ()

    case, results = many(tmp_path, 60, failures=failures)
    print_results(case, results)
    out, err = capsys.readouterr()
    rows = [line.split("│")[1:-1] for line in out.splitlines() if line.startswith("│")]
    D0 = [f"{each.curve.varied['noise.D0']:g}" for each in results]
    assert [row[0].strip() for row in rows] == [D0[0], D0[7], D0[40], D0[59]]
    assert [row[-1].strip() for row in rows] == ["least λ, largest δ_p", "", "", "largest λ, least δ_p"]
    assert [row[-2].strip() for row in rows] == ["converged", "partly", "partly", "converged"]
    assert "60 curves: 58 converged, 2 not converged; all numbers are in curves.csv and results.nc" in out
    assert f"not converged: many, noise.D0 = {D0[7]}: Λ(2) did not converge: at 1" in err  # another reason
    assert f"not converged: many, noise.D0 = {D0[40]}: Λ(2) did not converge: at 0" in err


def test_of_many_failed_curves_the_first_are_shown(tmp_path, capsys):
    case, results = many(
        tmp_path, 60, [ALL], failures=lambda i: (Failure(2.0, "Λ(2) did not converge"),) if i % 2 else ()
    )
    for each in results[1::2]:
        each.estimates.update(dict.fromkeys(INDICES))
    print_results(case, results)
    out = capsys.readouterr().out
    rows = [line.split("│")[1:-1] for line in out.splitlines() if "partly │" in line]
    assert [row[0].strip() for row in rows] == [f"{each.curve.varied['noise.D0']:g}" for each in results[1:40:2]]
    assert {cell.strip() for row in rows for cell in (*row[1:5], *row[9:13])} == {""}  # not "none", which nobody knows
    assert "30 converged, 30 not converged; of those that are not converged the first 20 are shown" in out


def test_a_file_has_all_columns_whatever_the_terminal_is(tmp_path, capsys, monkeypatch):
    case, results = many(tmp_path, 12, [ALL])
    texts = []
    for width in ("20", "200"):
        monkeypatch.setenv("COLUMNS", width)
        print_results(case, results)
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    assert "no room for" not in texts[0]
    heading = next(line for line in texts[0].splitlines() if line.startswith("┃"))
    assert all(symbol in heading for symbol in ("D0", "λ", "δ_p", "Λ″(0)", "N", "R_c", "r_c", "Λ(-1)", "Λ(2)"))


@pytest.mark.parametrize(
    ("width", "headings"),
    [(36, "a ┃ rank one ┃ rank two"), (29, "a ┃ one ┃ two"), (25, "a ┃ rank one"), (22, "a ┃ one"), (14, "a")],
)
def test_headings_are_folded_and_columns_left_out_in_their_order(capsys, terminal, width, headings):
    terminal(width)
    columns = [Column("a"), Column("rank one", 1), Column("rank two", 2)]
    print_blocks([Grid("", columns, [["1234567890", "12345", "1"]])])
    out = capsys.readouterr().out
    *_, last = [line for line in out.splitlines() if line.startswith("┃")]
    assert " ┃ ".join(part.strip() for part in last.strip("┃").split("┃")) == headings
    left_out = ["rank one"] * ("one" not in headings) + ["rank two"] * ("two" not in headings)
    assert " ".join(out.partition("no room for: ")[2].split()) == ", ".join(left_out)


def test_where_no_table_fits_rows_are_lists(capsys, terminal):
    terminal(13)
    print_blocks([Grid("", [Column("a"), Column("b", 1)], [["1234567890", "12345"]])])
    assert capsys.readouterr().out.split() == ["a", "=", "1234567890", "b", "=", "12345"]


def test_sentences_that_differ_in_numbers_are_one(tmp_path, capsys):
    case, results = many(tmp_path, 200, ["output.figure=true"], **KINDS)
    print_notes(case, results)
    warning, note = capsys.readouterr().err.splitlines()
    worst = results[89].curve.label
    assert note.startswith(
        "note: many: 200 of 200 curves: perturbation theory, Eq. (37), is for weak noise: do not rely on it from "
        "|p| = 89 on"
    )
    assert note.endswith(f", 0.89, which is 89%; most for {worst} (all in summary.json)")
    largest = results[3].curve.label  # 3 * 7 % 11 = 10
    assert (
        "rtol = 1e-08 is not met by λ: 3 has an estimated error of 1.0e-05; use a larger rtol to accept it" in warning
    )
    assert warning.endswith(f"most for {largest} (all in summary.json)")


def test_curves_that_share_a_sentence_are_named_if_they_are_few(tmp_path, capsys):
    case, results = many(tmp_path, 5, notes=lambda i: ("the same",) if i < 3 else (f"other {'x' * i} {i}",))
    print_notes(case, results)
    labels = [each.curve.label for each in results]
    assert capsys.readouterr().err.splitlines() == [
        f"note: many, {labels[0]}, {labels[1]} and {labels[2]}: the same",
        f"note: many, {labels[3]}: other xxx 3",
        f"note: many, {labels[4]}: other xxxx 4",
    ]


def test_several_sentences_of_one_curve_are_counted(tmp_path, capsys):
    case, results = many(
        tmp_path, 1, ["vary={}"], failures=lambda _: tuple(Failure(p, Message(Code.NO_MOMENT, p=p)) for p in (2, 3, 4))
    )
    print_notes(case, results, file="")
    assert capsys.readouterr().err == "not converged: many: there is no Λ(2); and 2 more like this one\n"


@pytest.mark.parametrize("count", [12, 60])
@pytest.mark.parametrize(
    ("code", "state", "said"),
    [
        (Code.RTOL_MISSED, "beyond rtol", "rtol = 1e-08 is not met"),
        (Code.INDEX_RTOL_MISSED, "beyond rtol", "rtol = 1e-08 is not met"),
        (Code.INDEX_MISSING, "no index", "no δ_p: for a reason"),
    ],
)
def test_the_line_of_states_agrees_with_the_warnings(tmp_path, capsys, count, code, state, said):
    """A curve of which it is said that rtol is not met, or that an index is not there, is not one that converged."""
    told = Message(code, rtol=1e-8, count=1, of=2, p=2.0, symbol="λ", value=1.0, error=1e-3, size=1e-3)
    told = Message(code, symbols=["δ_p"], reason="for a reason") if code is Code.INDEX_MISSING else told
    case, results = many(tmp_path, count, warnings=lambda i: (told,) if i < 5 else ())
    print_results(case, results)
    out, err = capsys.readouterr()
    assert f"{count} curves: {count - 5} converged, 5 with warnings; " in out
    assert f"warning: many: 5 of {count} curves: {said}" in err
    assert len(re.findall(f"│ +{state} │", out)) == (5 if count == 12 else 1)  # of many the extreme ones are shown


@pytest.mark.parametrize(
    ("count", "overrides", "is_shown"),
    [
        (3, [], True),  # in a column of the tables
        (12, ["output.figure=true"], True),
        (12, [], False),
        (3, ['figure={ x = "noise.D0", y = "lyapunov_exponent" }'], False),
        (3, ['figure={ x = "noise.D0", y = { moment = 2.0 } }', "output.figure=true"], True),
    ],
)
def test_weak_noise_is_spoken_of_where_its_equation_is_shown(tmp_path, capsys, count, overrides, is_shown):
    told = Message(Code.STRONG_NOISE, first=2.0, most=0.05, p=6.0, rest=1.0, size=0.5)
    case, results = many(tmp_path, count, overrides, notes=lambda _: (told,))
    print_notes(case, results)
    assert ("perturbation theory, Eq. (37), is for weak noise" in capsys.readouterr().err) == is_shown
    print_notes(case, results, file="")
    assert capsys.readouterr().err == ""


def test_equations_and_names_with_numbers_keep_sentences_apart(tmp_path, capsys):
    case, results = many(tmp_path, 4, notes=lambda i: (f"Eq. (3{i}) fails for tau{i}",))
    print_notes(case, results)
    assert capsys.readouterr().err.count("note:") == 4


def test_of_many_values_that_are_expected_those_that_differ_are_shown(tmp_path, capsys):
    case, _ = many(tmp_path, 60)
    expectation = Expectation(quantity="moment", p=2.0, value=1.0, rtol=1e-3, source="here")
    made = [Comparison(expectation, curve.varied, 1.0 + i / 59, 1e-3, i == 0) for i, curve in enumerate(case.curves())]
    print_blocks(show_comparisons(case, made))
    out = capsys.readouterr().out
    assert out.count("differs") == 50
    assert "9 more differ" in out
    assert "1 of 60 ok" in out
    print_blocks(show_comparisons(case, made[:1] * 60))
    assert capsys.readouterr().out == "many: 60 of 60 ok\n"


@pytest.mark.parametrize("count", [3, 12])
@pytest.mark.parametrize("width", [60, 80])
def test_a_narrow_terminal_breaks_no_comparison(tmp_path, capsys, terminal, count, width):
    case, _ = many(tmp_path, count, SECTIONS[-1])
    source = "an independent Fourier-Hermite computation [of the same]"
    expectation = Expectation(quantity="critical_impact_factor", value=-0.123456789012, rtol=1e-9, source=source)
    made = [Comparison(expectation, each.varied, -0.12345678901, 1e-10, met=True) for each in case.curves()]
    print_blocks(show_comparisons(case, made))
    whole = capsys.readouterr().out
    terminal(width)
    print_blocks(show_comparisons(case, made))
    narrow = capsys.readouterr().out
    assert tokens(narrow) - tokens(whole) <= {"no", "room", "for:", "=", "±,"}
    assert max(map(len, narrow.splitlines())) <= width
    assert "…" not in narrow


@pytest.mark.parametrize(
    ("seconds", "text"), [(4.23, "4.2 s"), (99.94, "99.9 s"), (750.0, "12 min 30 s"), (7500.0, "2 h 5 min")]
)
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_columns_of_theories_that_there_are_not_are_left_out(tmp_path):
    """Perturbation theory is for two variables: of more, a table over a parameter has finite elements alone."""
    text = """
title = "Three variables"
[system]
variables = ["x", "v", "u"]
drift = ["v", "-x - 2*s*v - xi*x + 0.5*u", "-u - 0.5*v"]
parameters = { s = 0.1 }
[noise]
kind = "white"
s = 0.5
[moments]
p = [2.0]
[vary]
"system.s" = [0.1, 0.2]
[figure]
x = "system.s"
y = "stability_index"
"""
    case = case_in(tmp_path, text)
    results = [failed(curve, "nothing was solved") for curve in case.curves()]
    found = curve_grid(case, results, table_of(case, results))
    assert not [column.heading for column in found.columns if column.heading.startswith("Eq.")]
    assert "Eq." not in found.remark


@pytest.mark.parametrize(
    ("count", "text"), [(1, "Almost"), (3, "noise.D0 = 0.25: almost"), (12, "in 0 curves, and grows in 12;")]
)
def test_the_verdict_comes_first_and_tables_over_p_where_they_are_asked_for(tmp_path, capsys, count, text):
    case, results = many(tmp_path, count)
    for is_whole in (False, True):
        print_blocks(show_results(case, results, case.path.parent, is_whole=is_whole))
        out = capsys.readouterr().out
        assert out.startswith(f"{case.title}\n")
        assert out.index(text) < out.index("┏")
        assert ("┃ p ┃" in " ".join(out.split())) == (count == 1 or (is_whole and count == 3))
        assert out.count("┏") == (2 if count == 1 else 1 + 2 * 3 if is_whole and count == 3 else 1)
