"""report.html: what stands on the page, that it is one file, that texts are texts, and that it never costs a result."""

import re
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import pyvista

from fpsolve.analysis.regions import Region
from fpsolve.analysis.zero import Zero
from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.errors import OutputError, Remedy
from fpsolve.model import OrnsteinUhlenbeck, PlaneSystem, Problem, White
from fpsolve.model.equation import equations_of, noise_sentences
from fpsolve.output.tables import facts_of
from fpsolve.page.page import Drawing
from fpsolve.parts.eigenfunctions import surface_from
from fpsolve.parts.surfaces import picture_of
from fpsolve.show import problem, results
from fpsolve.show.verdict import meaning, verdicts
from fpsolve.study.columns import table_of
from fpsolve.workflow import reports
from fpsolve.workflow.chart import region_meaning
from fpsolve.workflow.folders import CHART, PROVEN, SIMULATED, SOLVED, own_folder
from fpsolve.workflow.reports import shown_at_the_end
from tests.conftest import painted
from tests.kit import DRAWN, files, solve_case
from tests.proofs.case import CASE as PROVABLE
from tests.study.test_chart import CASE as CHARTED

CASES = Path(__file__).parents[2] / "cases"
NASTY = "<script>alert(1)</script>"
ONE = DRAWN.replace('[vary]\n"noise.D0" = [0.1, 1.0]\n', "")
OWN = f"""
title = "{NASTY} & more"
[system]
variables = ["x", "v"]
drift = ["v", "-k * x - 2*b * v - xi * x"]
parameters = {{ k = {{ value = 1.0, symbol = "<script>", unit = "<b>", words = "{NASTY}" }}, b = 0.05 }}
[noise]
kind = "telegraph"
a = 0.5
k = 1.0
[moments]
p = [2.0]
[output]
quantities = ["moment", "lyapunov_exponent"]
"""


class Page(HTMLParser):
    """The elements of a page, its ids, what it refers to, and its text."""

    def __init__(self, path):
        super().__init__()
        self.text, self.tags, self.ids, self.inside, self.outside, self.open = "", [], [], [], [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("href", "xlink:href", "src", "action", "data") and not value.startswith(("data:", "#")):
                self.outside.append(value)
            if name in ("href", "xlink:href") and value.startswith("#"):
                self.inside.append(value[1:])
            self.inside += re.findall(r"url\(#([^)]*)\)", value or "")

    def handle_endtag(self, tag):
        if tag in self.open:
            while self.open.pop() != tag:
                pass

    def handle_data(self, data):
        if not {"style", "script"} & set(self.open[-1:]):
            self.text += data


def run(folder, text, *arguments, command="run", name="test.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return main([command, str(path), "--out", str(folder), "--quiet", "--jobs", "1", *arguments])


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A run of Fig. 1's oscillator."""
    folder = tmp_path_factory.mktemp("reports")
    with painted():
        assert run(folder, ONE, "--report", "--set", "noise.D0=1.0") == 0
    return folder / "test"


@pytest.mark.slow
def test_the_page_holds_the_equation_numbers_meanings_and_the_case(solved):
    page = Page(solved / "report.html")
    words = " ".join(page.text.split())
    for text in (
        "ẍ = −x + 0.001 ẋ + 0.1 ξ ẋ",
        "|ẋ|⁺ = 0.9980019987 |ẋ|⁻ at x = 0",
        "Almost every path grows, doubling in a time of 637",
        "0.01416314365",
        "the mean square grows",
        "moments of the orders δ_p < p < 0 decay",
        "0.00108397, Eq. (39)",
        "natural frequency",
        "with noise.D0 = 1.0",
        "--set noise.D0=1.0",
        'treatment = "ou-reduction"',
        "numpy",
        "The moment Lyapunov exponent, Λ(p), over p",
    ):
        assert text in words, text
    assert "svg" in page.tags


def test_it_is_one_file_without_scripts_and_with_unique_ids(solved):
    page = Page(solved / "report.html")
    assert not page.outside
    assert "script" not in page.tags
    assert len(set(page.ids)) == len(page.ids)
    assert set(page.inside) <= set(page.ids)
    text = (solved / "report.html").read_text(encoding="utf-8")
    assert "@import" not in text
    assert len(text.encode()) < 3e6


def test_an_eigenfunction_is_drawn(solved):
    page = Page(solved / "report.html")
    assert "Eigenfunction T(φ, ξ) of p = 2" in page.text
    assert "could not be drawn" not in page.text
    assert "data:image/png;base64," in (solved / "report.html").read_text(encoding="utf-8")


def test_where_the_noise_has_states_each_is_a_line(tmp_path):
    """T of telegraph noise as it was written, at each of its two values."""
    with_eigenfunctions = OWN.replace('"lyapunov_exponent"]', '"eigenfunctions"]').replace('symbol = "<script>", ', "")
    assert run(tmp_path, with_eigenfunctions) == 0
    written = tmp_path / "test/eigenfunctions/p+2.0.vtu"
    surface = surface_from(written)
    assert surface.is_lines
    assert surface.xi.tolist() == [-0.5, 0.5]
    grid = pyvista.read(written)
    points, found = np.asarray(grid.points), np.asarray(grid.point_data["T"])
    for y in np.unique(points[:, 1]):
        line = points[:, 1] == y
        assert np.array_equal(surface.phi[0], points[line, 0])
        assert surface.values[:, round(y) - 1] == pytest.approx(found[line], rel=1e-12)
    picture_of(surface).save(tmp_path / "lines.png")
    assert (tmp_path / "lines.png").read_bytes()[1:4] == b"PNG"


def test_texts_are_texts(tmp_path):
    assert run(tmp_path, OWN, "--report", "--set", f"figure.title='{NASTY}'", name="a<b>.toml") == 0
    page = Page(tmp_path / "a<b>/report.html")
    assert not {"script", "b"} & set(page.tags)
    assert page.text.count(NASTY) >= 4  # the title, in the head and on the page, the words, the case
    assert "a<b>.toml" in page.text
    assert len(set(page.ids)) == len(page.ids)


@pytest.mark.parametrize("kind", [SOLVED, SIMULATED, CHART, PROVEN])
def test_a_report_goes_with_what_it_reported(tmp_path, kind):
    """Whatever is done next in a folder, also for the same parameters."""
    (tmp_path / "minimal").mkdir()
    for name in ("report.html", "reports.html"):
        (tmp_path / "minimal" / name).write_text("earlier", encoding="utf-8")
    with own_folder(load_case(CASES / "minimal.toml"), tmp_path, (kind,)) as folder:
        assert files(folder) - {".fpsolve.lock"} == {"reports.html"}


@pytest.mark.slow
def test_a_simulation_is_compared_with_the_finite_elements(tmp_path):
    few = "monte_carlo={ paths = 64, time = 40.0 }"
    assert run(tmp_path, ONE, "--report", "--monte-carlo", "--set", few, "--set", "output.eigenfunctions=[]") == 0
    text = Page(tmp_path / "test/report.html").text
    assert "s.e. away" in text
    assert "monte_carlo.json" in text


@pytest.mark.slow
def test_a_simulation_has_a_page(tmp_path):
    assert run(tmp_path, ONE, "--report", "--paths", "64", "--time", "40", command="simulate") == 0
    assert "effective windows" in Page(tmp_path / "test/report.html").text


@pytest.mark.parametrize(("module", "name"), [(problem, "noise_sentences"), (reports, "page_of")])
def test_a_fault_in_the_report_costs_nothing_else(tmp_path, monkeypatch, capsys, module, name):
    def fault(*_, **__):
        raise RuntimeError("a fault")

    monkeypatch.setattr(module, name, fault)
    lean = ["--set", "output={ quantities = ['lyapunov_exponent'] }"]
    assert run(tmp_path, ONE, "--report", *lean) == 0
    assert "warning: test: no report.html: RuntimeError: a fault" in capsys.readouterr().err
    assert {"summary.json", "curves.csv", "results.nc"} <= files(tmp_path / "test")
    assert "report.html" not in files(tmp_path / "test")
    assert not any(name.startswith(".fpsolve") for name in files(tmp_path / "test"))


def test_a_figure_that_fails_is_told_in_its_place(tmp_path, monkeypatch):
    def fault(*_):
        raise RuntimeError("no ink")

    monkeypatch.setattr(results, "main_figure", lambda *_: Drawing("a figure", fault))
    assert run(tmp_path, OWN, "--report") == 0
    assert "this picture could not be drawn: RuntimeError: no ink" in Page(tmp_path / "test/report.html").text


def test_proofs_have_a_page(tmp_path):
    pytest.importorskip("flint")
    text = f'{PROVABLE}[output]\nquantities = ["moment"]\nfigure = false\n'
    assert run(tmp_path, text, "--report", "--width", "0.01", command="prove", name="proven.toml") == 0
    assert "Proven: the moment of order 2 grows." in Page(tmp_path / "proven/report.html").text
    assert run(tmp_path, text, "--report", name="proven.toml") == 0  # which keeps the proof, as of its parameters
    words = Page(tmp_path / "proven/report.html").text
    assert "Other commands wrote proof.json there" in words
    assert "The mean square grows" in words


@pytest.mark.slow
@pytest.mark.usefixtures("pictures")
def test_charts_have_a_page(tmp_path, monkeypatch):
    for name, nodes in (
        ("analysis.stability.NODES", 7),
        ("workflow.chart.CLOSED_FORM_NODES", 31),
    ):
        monkeypatch.setattr(f"fpsolve.{name}", nodes)
    assert run(tmp_path, CHARTED, "--report", command="chart", name="plane.toml") == 0
    page = Page(tmp_path / "plane/report.html")
    assert "almost surely stable" in page.text
    assert "special point" in page.text
    assert "svg" in page.tags


@pytest.mark.parametrize(
    ("name", "equations"),
    [
        ("theorem", ["ẍ = −x + 0.1 ẋ + ξ ẋ", "|ẋ|⁺ = 0.8 |ẋ|⁻ at x = 0"]),
        ("response", ["ẍ = −x + 0.1 ẋ − 0.125 x² ẋ − 0.05 ẋ³ + 0.5 ξ ẋ"]),
        ("systems/own_equation", ["ẍ = −x − 0.2 ẋ − ξ x"]),
        ("systems/two_noises", ["ẍ = −x − 0.2 ẋ − ξ_axial x − ξ_lateral ẋ"]),
        ("systems/turning", ["dx/dt = x − ξ y", "dy/dt = −y + ξ x"]),
    ],
)
def test_equations_have_the_numbers_of_the_case(name, equations):
    assert equations_of(next(load_case(CASES / f"{name}.toml").curves()).problem.system) == equations


def test_equations_have_the_variables_of_the_case():
    problem = Problem(PlaneSystem.of_equations(("q", "v"), ("2*v", "-q - xi*v")), White(s=0.5))
    assert equations_of(problem.system) == ["q̈ = −2 q − ξ q̇"]
    rates = "2*v", "-q - xi*v - q**3/4 + q*v**2 - v**3"
    problem = Problem(PlaneSystem.of_equations(("q", "v"), rates), OrnsteinUhlenbeck(alpha=1.0, sigma=1.0))
    assert equations_of(problem.system) == ["q̈ = −2 q − 0.5 q³ + 0.5 q q̇² − 0.25 q̇³ − ξ q̇"]
    problem = Problem(PlaneSystem.of_equations(("q", "v"), ("v - q**3", rates[1])), problem.noise)
    assert equations_of(problem.system) == ["dq/dt = v − q³", "dv/dt = −q − 0.25 q³ + q v² − v³ − ξ v"]


def test_a_region_tells_what_paths_and_moments_do():
    zeros = Zero("moment", 2.0), Zero("lyapunov_exponent"), Zero("moment", 4.0)
    signs = {"lyapunov_exponent": -1, "moment 2": -1, "moment 4": 1}
    told = region_meaning(Region("some", signs, 0.5, (0.5, 0.5)), zeros)
    expected = "Almost every path decays, the mean square decays and E‖x‖^4 grows, which rare paths carry."
    assert told == f" {expected}"


@pytest.mark.parametrize(("sense", "words"), [("ito", "Itô's"), ("stratonovich", "Stratonovich's")])
def test_white_noise_is_told_with_its_sense(sense, words):
    problem = Problem(PlaneSystem.of_equations(("x", "v"), ("v", "-x - xi*v")), White(s=0.5, interpretation=sense))
    assert noise_sentences(problem) == [f"ξ is noise of the kind white. The equation is meant in {words} sense."]


@pytest.mark.parametrize("called", ["/somewhere/bin/fpsolve", "/somewhere/fpsolve/__main__.py"])
def test_the_command_can_be_typed_again(called, monkeypatch):
    monkeypatch.setattr("sys.argv", [called, "run", "a case.toml"])
    command = "fpsolve" if called.endswith("fpsolve") else "python -m fpsolve"
    case = load_case(CASES / "minimal.toml")
    assert facts_of(case, datetime.now(UTC), 1.0)["command"] == f"{command} run 'a case.toml'"


def test_an_interrupt_is_told_where_the_report_of_what_was_done_cannot_be_written():
    def show():
        raise OutputError("no space is left", Remedy.FOLDER)

    with pytest.raises(KeyboardInterrupt, match="kept"), shown_at_the_end(show):
        raise KeyboardInterrupt("what was done is kept")
    with pytest.raises(OutputError), shown_at_the_end(show):
        pass


def test_rare_paths_that_carry_the_mean_square_are_told_of():
    """λ < 0 < Λ(2), as the theorem's case has them."""
    case = load_case(CASES / "theorem.toml", ["moments.p=[2.0]", "expect=[]", "units.time='s'"])
    [result] = solve_case(case)
    told = " ".join(each.text for each in (*verdicts(case, [result], table_of(case, [result])), *meaning(result)))
    assert "Almost every path decays" in told
    assert "the mean square grows" in told
    assert re.search(r"halving in a time of \S+ s;", told)
    assert "rare paths carry it in bursts" in told
    assert "falls as A^-0.3784" in told
