"""What a run tells: on a terminal, where nothing is cut, in sentences and notes, and in report.html, one safe file."""

import html
import io
import re
from html.parser import HTMLParser

import pytest

from fpsolve import load_case
from fpsolve.model import OrnsteinUhlenbeck, White, equations_of
from tests.conftest import painted, sampled
from tests.kit import HOPELESS, LEAN, TEXT, files, rates, read_json, run

NASTY = "<script>alert(1)</script>"
BURSTS = """
title = "Telegraph"
[system]
variables = ["x", "v"]
drift = ["v", "-x - 2*zeta*v - xi*x"]
parameters = { zeta = 0.08 }
[noise]
kind = "telegraph"
a = 0.8
k = 1.0
[moments]
p = [1.0, 2.0]
[output]
quantities = ["moment", "lyapunov_exponent", "stability_index", "excursions"]
figure = false
[excursions]
levels = [2, 4, 8]
"""
"""λ < 0 < Λ(2): rare paths carry the mean square."""
ODD = BURSTS.replace('"Telegraph"', f'"{NASTY} & more"').replace(
    "zeta = 0.08", f'zeta = {{ value = 0.08, symbol = "<script>", unit = "<b>", words = "{NASTY}" }}'
)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def notes(err):
    """What is said on the standard error but for the progress of what takes long."""
    return re.sub(r"(?m)^case, .*\n", "", err)


def words(text):
    return set(re.split(r"[\s│┃┏┳━┓┡╇┩├┼┤└┴┘─]+", text)) - {""}


EXPECTED = """
[[expect]]
quantity = "critical_impact_factor"
value = 0.9
rtol = 1e-9
source = "a computation [of the same]"
"""
MANY = "vary.noise.D0={start=0.1, stop=1.0, num=12}"
RESPONSE = ["oscillator.c1=0.8", "oscillator.c2=0.5", "response.rtol=0.01", "vary={}"]


@pytest.mark.parametrize(
    ("command", "sets"),
    sampled(
        (["run", "--table"], ["output={ quantities=['moment', 'lyapunov_exponent'] }"]),
        (
            ["run"],
            [
                MANY,
                "output={ quantities=['moment', 'lyapunov_exponent', 'stability_index'] }",
                "oscillator.epsilon=0.5",
                "moments.rtol=1e-4",
            ],
        ),
        (["check"], [MANY]),
        (["run", "--all", "--table"], RESPONSE),
        (["simulate"], [*RESPONSE, "monte_carlo={ paths=64, time=100.0 }"]),
        keep=1,
    ),
)
def test_a_narrow_terminal_cuts_no_word_and_no_number(tmp_path, monkeypatch, command, sets):
    """Columns may be left out, and are named; a file has all of them."""
    monkeypatch.setenv("TERM", "dumb")
    asked = [command[0], "case.toml", *command[1:], "--jobs", "1", *(f"--set={each}" for each in sets)]
    whole = run(tmp_path, *asked, case=TEXT + EXPECTED)
    for width in (40, 60, 80):
        monkeypatch.setenv("COLUMNS", str(width))
        shown = run(tmp_path, *asked, to=Terminal)
        assert shown.code == whole.code
        for text in (shown.out, shown.err):
            assert max(map(len, text.splitlines()), default=0) <= width
            assert "…" not in text
        ends = shown.out.rpartition("written:")[0] or shown.out
        new = words(ends) - words(whole.out) - {"no", "room", "for:", "="}
        assert {each.strip(",") for each in new} <= {each.strip(",") for each in words(whole.out)}
        assert words(notes(shown.err)) == words(notes(whole.err))
    monkeypatch.setenv("COLUMNS", "20")
    assert "no room for" not in run(tmp_path, *asked).out


@pytest.mark.slow
def test_of_many_sets_the_extreme_and_the_first_failed_ones_have_a_row(tmp_path):
    sets = ["vary={ oscillator.epsilon={start=0.01, stop=1.5, num=60} }", LEAN, HOPELESS]
    done = run(tmp_path, "run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in sets), case=TEXT)
    parameter_sets = read_json(tmp_path / "results/case/summary.json")["sets"]
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in done.out.splitlines() if line.startswith("│")]
    found = {f"{each['varied']['oscillator.epsilon']:g}": each for each in parameter_sets}
    failed = [name for name, each in found.items() if each["status"] == "failed"]
    assert [row[0] for row in rows if row[3] == "failed"] == failed[:20]
    assert {row[1] for row in rows if row[3] == "failed"} == {""}  # not "none", which nobody knows
    known = {name: each["lyapunov_exponent"] for name, each in found.items() if name not in failed}
    assert {row[4]: row[0] for row in rows if row[4]} == {
        "least λ": min(known, key=known.get),
        "largest λ": max(known, key=known.get),
    }
    least = found[min(known, key=known.get)]["lyapunov_exponent"]
    assert [float(row[1]) for row in rows if row[4] == "least λ"] == pytest.approx([least], rel=0.01)
    assert f"Almost every path decays in 0 parameter sets, grows in {len(known)}." in done.out
    end = f"60 parameter sets: {len(known)} with warnings, {len(failed)} not converged; "
    end += "the table has the first 20 that are not converged"
    assert f"{end}; all numbers are in sets.csv and results.nc" in done.out
    failures, warnings = notes(done.err).splitlines()
    assert re.fullmatch(
        r"not converged: case: 38 of 60 parameter sets: fpsolve found no λ: .*phi_cells.*; worst for osc.* = 1.5 .*",
        failures.replace("(", "", 1),
    )
    assert re.fullmatch(
        r"warning: case: 22 of 60 parameter sets: rtol = 1e-08 is not met by λ: .*; worst for .* \(all in sets.csv\)",
        warnings,
    )


@pytest.mark.slow
def test_of_many_expected_values_those_that_differ_are_shown(tmp_path):
    expect = '[[expect]]\nquantity = "moment"\np = 0.0\nvalue = VALUE\natol = 1e-12\nsource = "here"\n'
    asked = ["check", "case.toml", "--jobs", "1", "--set=vary.noise.D0={start=0.1, stop=1.0, num=60}"]
    differs = run(tmp_path, *asked, case=TEXT + expect.replace("VALUE", "1.0")).out
    assert differs.count("differs") == 50
    assert "10 more values differ\n0 of 60 ok" in differs
    assert run(tmp_path, *asked, case=TEXT + expect.replace("VALUE", "0.0")).out == "case: 60 of 60 ok\n"


def test_notes_that_differ_in_numbers_are_one_with_the_worst(tmp_path):
    """And name the parameter sets where they are few; of weak noise is spoken where its equation is shown."""
    sets = [
        "oscillator.epsilon=1.0",
        "moments.rtol=1e-4",
        "output={ quantities=['moment'], figure=false }",
        "moments.p=[2.0]",
        "vary.noise.D0=[0.5, 1.0]",
    ]
    asked = ["run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in sets)]
    weak = "perturbation theory, Eq. (37), is for weak noise"
    few = notes(run(tmp_path, *asked, case=TEXT).err)
    assert few.count("note: ") == 1
    assert few.startswith(f"note: case, noise.D0 = 0.5 and noise.D0 = 1: {weak}. Do not rely on it from |p| = 2 on")
    assert few.endswith("; worst for noise.D0 = 1 (all in sets.csv)\n")
    many = run(tmp_path, *asked, "--set", "vary.noise.D0={start=0.3, stop=1.0, num=12}").err
    assert weak not in many  # a table of many parameter sets has no column of it
    assert "perturbation theory, Eq. (37)" not in run(tmp_path, "check", *asked[1:]).err


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            [],
            "Almost every path decays, halving in a time of 23.4; the mean square grows, doubling in a time of 24.7. "
            "… rare paths carry the growth in bursts … Start with φ₀ = 0, stationary noise: P(sup ‖x‖ ≥ 2) between "
            "0.288 and 0.436, P(sup ‖x‖ ≥ 4) between 0.117 and 0.177, P(sup ‖x‖ ≥ 8) between 0.0474 and 0.0717; ‖x‖ is "
            "the length of (x, v), and ‖x₀‖ = 1. … δ_p = 1.302367 > 0: moments of order p decay for 0 < p < δ_p and "
            "grow for p > δ_p. … P(sup ‖x‖ ≥ A), falls as A^-1.302.",
        ),
        (["noise.a=0.3"], "the mean square decays, halving"),
        (["system.zeta=0.01"], "without bound; … δ_p = -"),
        (
            ["system.zeta=0.01", "system.drift=['v', '-x - 2*zeta*v - v**3 - xi*x']"],
            "Almost every path grows, doubling in a time of … near rest; the mean square",
        ),
        (
            ["vary={ system.zeta=[0.02, 0.08] }", "figure={ x='system.zeta', y='lyapunov_exponent' }"],
            "P(sup ‖x‖ ≥ 8) … 0.0474-0.0717",
        ),
        (["vary={ system.zeta=[0.02, 0.08] }"], "system.zeta = 0.08: almost every path decays"),
        (["output.quantities=['stability_index']", "excursions={}"], "δ_p = 1.302367 > 0"),
        (["units.time='s'"], "halving in a time of 23.4 s;"),
    ],
)
def test_sentences_say_what_the_numbers_mean(tmp_path, changes, told):
    done = run(tmp_path, "run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in changes), case=BURSTS)
    assert done.code == 0
    assert re.search(".*".join(map(re.escape, told.split(" … "))), " ".join(done.out.split())), done.out


def test_excursions_are_in_the_summary(tmp_path):
    """A set without the start of an excursion is told beside the others."""
    sets = ["excursions.xi=0.8", "vary={'noise.a'=[0.8, 0.7]}"]
    done = run(tmp_path, "run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in sets), case=BURSTS)
    assert done.code == 3
    assert (
        "noise.a = 0.7: fpsolve found no P(sup ‖x‖ ≥ A): got xi = 0.8; must be one of the states, -0.7, 0.7" in done.err
    )
    assert run(tmp_path, "run", "case.toml", "--out", "all", case=BURSTS).code == 0
    [parameter_set] = read_json(tmp_path / "all/case/summary.json")["sets"]
    found = parameter_set["excursions"]
    assert found["start"] == {"phi": 0.0, "xi": "stationary"}
    assert (found["stability_index"], found["lower"], found["upcrossings"]) == pytest.approx(
        (1.302367339, 0.712, 4.10), rel=2e-3
    )
    assert [each["level"] for each in found["levels"]] == [2.0, 4.0, 8.0]
    assert all(0 < each["least_probable"] < each["most_probable"] < 1 for each in found["levels"])


class Page(HTMLParser):
    """The elements of a page, its ids, what it refers to, and its text."""

    def __init__(self, path):
        super().__init__()
        self.text, self.tags, self.ids, self.inside, self.outside = "", [], [], [], []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        assert not self.outside
        assert "script" not in self.tags
        assert len(set(self.ids)) == len(self.ids)
        assert set(self.inside) <= set(self.ids)
        assert "@import" not in self.source

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("href", "src", "action", "data") and not value.startswith("data:"):
                (self.inside if value.startswith("#") else self.outside).append(value.removeprefix("#"))

    def handle_data(self, data):
        self.text += f" {data}"


def page_of(folder, *options, text=BURSTS, command="run", out="results/case"):
    with painted():
        done = run(folder, command, "case.toml", "--report", *options, case=text)
    assert done.code == 0, done
    page = Page(folder / out / REPORTS[command])
    page.text = " ".join(page.text.split())
    return page


def test_the_report_is_one_safe_file_with_equation_numbers_meanings_pictures_and_the_case(tmp_path):
    text = ODD.replace('"excursions"]\nfigure = false', '"excursions", "eigenfunctions"]').replace(
        'symbol = "<script>", ', ""
    )
    page = page_of(tmp_path, "--set", f"figure.title='{NASTY}'", text=text)
    for words in (
        "ẍ = −x − 0.16 ẋ − ξ x",
        "ξ is noise of the kind telegraph, with standard deviation 0.8 and correlation time 0.5.",
        "Almost every path decays, halving in a time of 23.4; the mean square grows, doubling in a time of 24.7.",
        "rare paths carry the growth in bursts",
        "P(sup ‖x‖ ≥ 8) between 0.0474 and 0.0717",
        "-0.0296213724",
        "-0.0396131, Eq. (39)",
        "amplitude",
        "The moment Lyapunov exponent, Λ(p), over p",
        "Eigenfunction T(φ, ξ) of p = 2",
        "All numbers are in summary.json, sets.csv, moments.csv, results.nc",
        "numpy",
        f"With --set figure.title='{NASTY}'",
        'kind = "telegraph"',
    ):
        assert words in page.text, words
    assert "could not be drawn" not in page.text
    assert page.text.count(NASTY) >= 4  # the title, in the head and on the page, the words, the case
    assert "b" not in page.tags
    assert {*re.findall("data:image/(.*?);base64,", page.source)} == {"svg+xml"}
    assert len(page.source.encode()) < 3e6
    assert html.escape(NASTY, quote=False) in page.source


REPORTS = {"run": "report.html", "simulate": "monte_carlo.html", "chart": "chart.html", "prove": "proof.html"}
PLANE = """
[chart]
x = { key = "oscillator.c1", start = 0.05, stop = 0.1 }
y = { key = "noise.D0", start = 0.1, stop = 0.2 }
lines = ["moment(2) = 0"]
"""


@pytest.mark.parametrize("command", sampled(*REPORTS))
def test_a_report_goes_with_what_it_reported_and_no_other_command_removes_it(tmp_path, command):
    if command == "prove":
        pytest.importorskip("flint")
    few = ["--quiet", "--set=monte_carlo={ paths=64, time=40.0 }", "--set=vary={}", "--set=output={figure=false}"]
    (tmp_path / "results/case").mkdir(parents=True)
    (tmp_path / "results/case/reports.html").write_text("mine", encoding="utf-8")
    for name, is_there in ((command, True), ("simulate" if command == "run" else "run", True), (command, False)):
        report = ["--report"] * (name == command and is_there)
        assert run(tmp_path, name, "case.toml", *few, *report, case=TEXT + PLANE).code == 0
        pages = {each for each in files(tmp_path / "results/case") if each.endswith(".html")}
        assert pages == {"reports.html", *[REPORTS[command]] * is_there}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "options", "words"),
    [
        ("run", ["--monte-carlo"], "s.e. away … monte_carlo.json"),
        ("simulate", [], "effective windows"),
    ],
)
def test_a_simulation_is_on_the_page(tmp_path, command, options, words):
    few = ["--set", "monte_carlo={ paths=64, time=40.0 }", "--set", "vary={}", "--set", "output={figure=true}"]
    page = page_of(tmp_path, *options, *few, text=TEXT, command=command)
    assert re.search(words.replace(" … ", ".*"), page.text)


def test_a_proof_is_on_the_page_and_stays_beside_a_run(tmp_path):
    pytest.importorskip("flint")
    moment = ["--set=output={ quantities=['moment'], figure=false }", "--set=excursions={}", "--set=moments.p=[2.0]"]
    page = page_of(tmp_path, "--width", "0.01", *moment, command="prove")
    assert "Proven: the moment of order 2 grows." in page.text
    assert "The mean square grows" in page_of(tmp_path, *moment).text
    assert "proof.html" in files(tmp_path / "results/case")


def spring(force="", noise=None, rate="v"):
    return rates(f"q' = {rate}; v' = -q - xi*v{force}", noise or OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)).system


@pytest.mark.parametrize(
    ("system", "equations"),
    [
        (lambda case: case("theorem"), ["ẍ = −x + 0.1 ẋ + ξ ẋ", "|ẋ|⁺ = 0.8 |ẋ|⁻ at x = 0"]),
        (lambda case: case("response"), ["ẍ = −x + 0.1 ẋ − 0.125 x² ẋ − 0.05 ẋ³ + 0.5 ξ ẋ"]),
        (lambda case: case("systems/two_noises"), ["ẍ = −x − 0.2 ẋ − ξ_axial x − ξ_lateral ẋ"]),
        (lambda case: case("systems/turning"), ["dx/dt = x − ξ y", "dy/dt = −y + ξ x"]),
        (lambda _: spring(noise=White(s=0.5), rate="2*v"), ["q̈ = −2 q − ξ q̇"]),
        (lambda _: spring(" - q**3/4 + q*v**2 - v**3", rate="2*v"), ["q̈ = −2 q − 0.5 q³ + 0.5 q q̇² − 0.25 q̇³ − ξ q̇"]),
        (lambda _: spring(rate="v - q**3"), ["dq/dt = v − q³", "dv/dt = −q − ξ v"]),
    ],
)
def test_equations_have_the_numbers_and_variables_of_the_case(request, system, equations):
    cases = request.config.rootpath / "cases"
    assert equations_of(system(lambda name: next(load_case(cases / f"{name}.toml").sets()).problem.system)) == equations


OWN = (
    BURSTS.partition("[output]")[0]
    .replace("zeta = 0.08", "zeta = 0.08, unused = 3.0, c = 0.0")
    .replace("2*zeta*v", "(2*zeta + sqrt(c))*v")
)
SEVERAL = """
title = "two noises"
[system]
variables = ["x", "v"]
drift = ["v", "-(1 + a + b)*x - 0.2*v"]
noises = { a = "noise.a", b = "noise.b" }
[noise.a]
kind = "telegraph"
a = 0.3
k = 1.0
[noise.b]
kind = "telegraph"
a = 0.2
k = 2.0
[moments]
p = [2.0]
"""


@pytest.mark.parametrize(
    ("text", "quantities", "told"),
    [
        (OWN, ["moment"], "system.unused: no rate and no restitution has it, so that no result depends on it"),
        (OWN, ["sensitivities"], "no sensitivities to system.c: the derivative of the system by it is not finite at 0"),
        (OWN, ["moment", "impact_rate"], "there is no N: "),
        (
            SEVERAL,
            ["moment", "eigenfunctions"],
            "no eigenfunctions are written: an eigenfunction of the phase and of several noises",
        ),
    ],
)
def test_what_an_own_system_does_not_have_is_told(tmp_path, text, quantities, told):
    options = ["--set=moments.p=[2.0]", f"--set=output={{ quantities={quantities}, figure=false }}"]
    done = run(tmp_path, "run", "case.toml", *options, case=text)
    assert (done.code, told in done.err) == (0, True), done.err
    assert not list(tmp_path.rglob("*.vtu"))


def test_nothing_is_said_unasked_of_impacts_where_there_are_none(tmp_path):
    done = run(tmp_path, "run", "case.toml", "--set=output={ figure=false, eigenfunctions=[] }", case=OWN)
    assert (done.code, "no N" in done.err, "R_c" in done.out) == (0, False, False), done
    assert "system.unused: no rate" in done.err
