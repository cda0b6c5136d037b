"""`fpsolve noise`: from a file to a case, a figure and what it means; and what it refuses."""

import math
import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck
from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT
from fpsolve.measured import named_density, read_spectrum, weak_exponent, weak_moment
from fpsolve.workflow.noise import natural_frequencies, sentences
from tests.kit import read_json

ROOT = Path(__file__).parents[2]
F = np.linspace(0.05, 20, 400)
NOISE = OrnsteinUhlenbeck(alpha=12.0, sigma=0.15)
OMEGA = 4 * math.pi
MY_CASE = f"""
title = "Noise in the damping, 2 Hz, 2 %"
oscillator = {{ omega = {OMEGA}, c1 = {-0.04 * OMEGA}, restitution = 1.0, epsilon = 1.0 }}
noise = {{ kind = "white", s = 0.1 }}
moments = {{ p = [2.0] }}
units = {{ time = "s" }}
"""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def spectrum(name="spectrum.csv", header="f (Hz),G (1/Hz)", factor=1.0, noises=(NOISE,)):
    """One-sided per Hz, G = 2S."""
    G = [2 * factor * sum(noise.spectral_density(2 * math.pi * each) for noise in noises) for each in F]
    np.savetxt(name, np.column_stack([F, G]), delimiter=",", header=header, comments="", fmt="%.10g")
    return name


def noise(*options):
    assert main(["noise", *options]) == 0
    return read_json(next(Path("results").glob("*/noise.json")))


def test_a_spectrum_becomes_a_case_and_a_verdict(capsys):
    """By the averaged formulas; a fit of an exact spectrum is the noise.

    A wall adds N ln r to λ, πN = ω√(1 − ζ²) − (ω²/4)∫ C(τ) sin 2ωτ dτ, and C is exponential.
    """
    options = ["--sided", "one", "--frequency", "2", "--damping-ratio", "0.01", "--restitution", "0.9"]
    found = noise(spectrum(), "--per", "Hz", "--averages", "64", "--noise-in", "stiffness", *options)
    assert found["fit"]["parameters"] == pytest.approx({"alpha": 12.0, "sigma": 0.15}, rel=1e-4)
    assert found["noise"]["parameters"] == pytest.approx({"alpha": 12.0, "sigma": 0.15 * OMEGA**2}, rel=1e-4)
    at_double = NOISE.spectral_density(2 * OMEGA)
    turns = OMEGA * math.sqrt(1 - 1e-4) - OMEGA**3 * at_double / (4 * NOISE.alpha)
    wall = turns / math.pi * math.log(0.9)
    exponent = weak_exponent(OMEGA, 0.01, at_double, "stiffness") + wall
    moment = weak_moment(2, OMEGA, 0.01, at_double, 0, "stiffness") + 2 * wall
    assert found["lyapunov_exponent"]["value"] == pytest.approx(exponent, rel=1e-5)
    assert found["second_moment"]["value"] == pytest.approx(moment, rel=1e-4)
    assert found["second_moment"]["probability_below_0"] > 0.999
    critical = found["critical_damping_ratio"]
    assert critical["moment"]["value"] == pytest.approx(OMEGA * at_double / 4, rel=1e-3)
    assert critical["lyapunov_exponent"]["value"] == pytest.approx(OMEGA * at_double / 8, rel=1e-3)
    case, printed = load_case("results/spectrum.csv/noise.toml"), capsys.readouterr().out
    assert case.problem.values == pytest.approx(
        {
            "system.stiffness": OMEGA**2,
            "system.damping": 0.01 * OMEGA,
            "system.restitution": 0.9,
            "noise.alpha": found["noise"]["parameters"]["alpha"],
            "noise.sigma": found["noise"]["parameters"]["sigma"],
        },
        rel=1e-5,
    )
    assert 'kind = "ornstein-uhlenbeck"' in printed
    assert "the mean square decays with a probability of > 99.9 %" in printed
    assert {path.name for path in Path("results/spectrum.csv").iterdir()} == {
        f"noise.{ending}" for ending in ("json", "png", "pdf", "toml")
    }


def test_noise_in_the_damping_of_a_case_needs_0_too(capsys):
    """Λ(2) = −2ζω + S(2ω)/2 + S(0)/2, and S(0) here is some ten times S(2ω)."""
    Path("my.toml").write_text(MY_CASE, encoding="utf-8")
    file = spectrum(header="f (Hz),G (1/s²/Hz)", factor=0.4)
    found = noise(file, "--sided", "one", "--of", "damping", "--case", "my.toml")
    assert [each["name"] for each in found["frequencies"]] == ["2ω", "0"]
    at_double, at_zero = (0.4 * NOISE.spectral_density(each) for each in (2 * OMEGA, 0.0))
    expected = weak_moment(2, OMEGA, 0.02, at_double, at_zero, "damping")
    assert found["second_moment"]["value"] == pytest.approx(expected, rel=1e-3)
    assert load_case("results/spectrum.csv/noise.toml").problem.values["oscillator.omega"] == pytest.approx(OMEGA)


def test_a_coefficient_of_a_case_leaves_no_line_of_weak_noise(capsys):
    """That is for a relative stiffness or a damping, and here ξ is multiplied by 2 first."""
    parameters, text = f"{{ w = {OMEGA}, c = 0.5 }}", 'title = "x"\nunits.time = "s"\n[system]\n'
    text += f'variables = ["x", "v"]\ndrift = ["v", "-w**2*(1 + 2*xi)*x - c*v"]\nparameters = {parameters}\n'
    Path("my.toml").write_text(text + '[noise]\nkind = "white"\ns = 0.1\n[moments]\np = [2.0]\n', encoding="utf-8")
    options = ["--per", "Hz", "--sided", "one", "--averages", "64", "--noise-in", "stiffness", "--case", "my.toml"]
    found = noise(spectrum(), *options)
    assert found["critical_damping_ratio"] == {"lyapunov_exponent": None, "moment": None}
    expected = weak_moment(2, OMEGA, 0.25 / OMEGA, 4 * NOISE.spectral_density(2 * OMEGA), 0, "stiffness")
    assert found["second_moment"]["value"] == pytest.approx(expected, rel=0.02)
    assert "In weak noise" not in capsys.readouterr().out


def test_an_error_above_the_value_decides_nothing():
    """λ = 1 ± 70 is no growth with a probability of 50.6 %."""
    known = SimpleNamespace(value=1.0, deviation=70.0, below=0.494)
    fit = SimpleNamespace(off=0.0, spectrum=SimpleNamespace(is_formula=False))
    verdict = SimpleNamespace(exponent=known, moment=None)
    said = [*sentences(SimpleNamespace(exponent=None, moment=None, verdict=verdict, failure=None, fit=fit))]
    assert said[0].endswith(": almost every path is not decided; measure for longer, or try another --kind.")


def test_noise_of_eq_7_is_written_with_its_treatment(capsys):
    """Two sines of random walks are bounded, with the kurtosis 2.25."""
    values = 0.1 * np.sin(np.cumsum(0.3 * np.random.default_rng(0).normal(size=(20_000, 2)), axis=0)).sum(axis=1)
    np.savetxt("record.csv", np.column_stack([0.02 * np.arange(values.size), values]), delimiter=",", header="t (s),k")
    noise("--record", "record.csv", "--of", "stiffness", "--frequency", "2", "--damping-ratio", "0.01",
          "--kind", "non-gaussian")  # fmt: skip
    assert 'kind = "non-gaussian"\ntreatment = "exact"\n' in capsys.readouterr().out
    assert load_case("results/record.csv/noise.toml").noise.values["treatment"] == "exact"


@pytest.mark.slow
def test_acceleration_of_a_support_and_two_terms():
    """ω² = g/ℓ and ξ = a/g; the sum of two noises is one with the same spectrum."""
    length = 9.80665 / OMEGA**2
    noises = OrnsteinUhlenbeck(alpha=4.0, sigma=0.1), OrnsteinUhlenbeck(alpha=60.0, sigma=0.3)
    found = noise(
        spectrum(header="f (Hz),G ((m/s^2)^2/Hz)", factor=9.80665**2, noises=noises), "--sided", "one",
        "--of", "acceleration", "--length", f"{length!r}", "--damping-ratio", "0.01", "--averages", "64",
        "--terms", "2",
    )  # fmt: skip
    assert found["natural_frequencies"] == pytest.approx([OMEGA])
    at_double = sum(each.spectral_density(2 * OMEGA) for each in noises)
    assert found["frequencies"][0]["density"] == pytest.approx(at_double, rel=1e-3)
    expected = weak_moment(2, OMEGA, 0.01, at_double, 0, "stiffness")
    assert found["second_moment"]["value"] == pytest.approx(expected, rel=5e-3)
    assert load_case("results/spectrum.csv/noise.toml").system.noise_sections == ("noise.first", "noise.second")


def test_the_sea_at_a_buoy():
    """Public data to a verdict: λ and Λ(2) by the averaged formulas with the fitted density, and that of the sea."""
    path = ROOT / "cases/measured/buoy.csv"
    options = ["--of", "acceleration", "--column", "acceleration", "--sided", "one", "--averages", "12"]
    found = noise(str(path), *options, "--length", "60", "--damping-ratio", "0.001", "--kind", "filter")
    omega = math.sqrt(9.80665 / 60)
    sea = read_spectrum(path, sided="one", of="height", column="elevation")
    by_hand = sea.frequencies**4 * sea.density / 9.80665**2
    [row] = found["frequencies"]
    near = np.abs(sea.frequencies - 2 * omega) <= 0.2 * omega
    assert row["density"] == pytest.approx(np.mean(by_hand[near]), rel=0.3)
    assert found["lyapunov_exponent"]["value"] == pytest.approx(
        weak_exponent(omega, 0.001, row["density"], "stiffness"), rel=1e-3
    )
    assert found["second_moment"]["value"] == pytest.approx(
        weak_moment(2, omega, 0.001, row["density"], 0, "stiffness"), rel=2e-3
    )
    assert found["second_moment"]["probability_below_0"] > 0.99
    case = load_case(ROOT / "cases/systems/hoisted.toml")
    assert case.problem.values == pytest.approx(load_case("results/buoy.csv/noise.toml").problem.values, rel=1e-5)


def test_a_fit_of_another_family_has_the_measured_density_and_its_error(capsys):
    """At 2f, by the mean of the values within 10 % of it; so have Λ(2) and the line of weak noise."""
    path = ROOT / "cases/measured/buoy.csv"
    options = ["--of", "acceleration", "--column", "acceleration", "--sided", "one", "--averages", "12"]
    found = noise(str(path), *options, "--length", "60", "--damping-ratio", "0.001")
    [row], omega = found["frequencies"], math.sqrt(9.80665 / 60)
    sea = read_spectrum(path, sided="one", of="acceleration", column="acceleration").scaled(1 / 9.80665)
    by_hand = np.mean(sea.density[np.argsort(abs(sea.frequencies - 2 * omega))[:5]])
    assert row["density"] == pytest.approx(by_hand, rel=2 / math.sqrt(12 * 5))
    assert row["measured_over_fitted"] == pytest.approx(1, abs=1e-3)
    error = row["measured_over_fitted_error"] * omega**2 * row["density"] / 2
    assert found["second_moment"]["standard_error"] == pytest.approx(error, rel=0.5)
    assert found["critical_damping_ratio"]["moment"]["value"] == pytest.approx(omega * row["density"] / 4, rel=1e-3)
    said = capsys.readouterr()
    assert "off that of the best fit" in said.err


def by_formula(G):
    return spectrum(noises=[SimpleNamespace(spectral_density=lambda omega: G(omega / (2 * math.pi)) / 2)])


def laser(f):
    """In units in which its 1 kHz are 2 Hz."""
    return 5e-10 / (1 + (f / 40) ** 2) * (1 + 0.2 / f)


def peaks(f):
    return sum(a / ((1 - (f / g) ** 2) ** 2 + (0.1 * f / g) ** 2) for a, g in [(1e-6, 1), (3e-6, 4)])


@pytest.mark.parametrize("kind", ["ornstein-uhlenbeck", "filter"])
@pytest.mark.parametrize(("G", "zeta", "rel"), [(laser, 1e-9, 1e-3), (peaks, 0.01, 0.015)])  # of a peak between values
def test_a_misfit_is_not_taken_for_scatter(G, zeta, rel, kind, capsys):
    """By G(2f) itself: values without scatter whose averages are not stated."""
    options = ["--sided", "one", "--frequency", "2", "--damping-ratio", f"{zeta}", "--kind", kind]
    found, at_double = noise(by_formula(G), *options), G(4.0) / 2
    assert found["critical_damping_ratio"]["moment"]["value"] == pytest.approx(OMEGA * at_double / 4, rel=rel)
    assert found["frequencies"][0]["density"] == pytest.approx(at_double, rel=rel)
    if G is laser:
        moment = weak_moment(2, OMEGA, zeta, at_double, 0, "stiffness")
        assert found["second_moment"]["value"] == pytest.approx(moment, rel=0.01) == pytest.approx(-4.6e-9, rel=0.01)
        assert "grows" not in capsys.readouterr().out


def test_a_named_density_has_no_errors(capsys):
    stated = "--parameters", "Hs=2,Tp=9", "--of", "stiffness", "--scale", "0.01", "--damping-ratio", "0.01"
    found = noise("--named", "jonswap", *stated, "--frequency", "0.05")
    critical = 5e-5 * math.pi * 0.05 * float(named_density("jonswap", 0.2 * math.pi, Hs=2, Tp=9))
    assert found["second_moment"]["standard_error"] is found["second_moment"]["probability_below_0"] is None
    out = capsys.readouterr().out
    assert f"Λ(2) < 0 above {100 * critical:.4g} %." in out
    assert "probabilit" not in out


def test_a_kind_that_cannot_have_all_densities_is_refused(capsys):
    """An Ornstein-Uhlenbeck spectrum has no peaks at 4 and 12 Hz."""
    by_formula(lambda f: 1 / (1 + (f - 4) ** 2) + 1 / (1 + (f - 12) ** 2))
    assert main(["noise", *AT_2, "--frequency", "6"]) == BAD_INPUT
    assert "near 2ω₁ that was measured; take another kind, such as filter" in capsys.readouterr().err


def test_terms_that_are_not_told_apart(capsys):
    """Two equal noises for one: their density is right, and a warning says that their parameters are not known."""
    found = noise(spectrum(), *AT_2[1:], "--terms", "2", "--averages", "64")
    assert found["frequencies"][0]["density"] == pytest.approx(NOISE.spectral_density(2 * OMEGA), rel=1e-3)
    assert "do not tell all parameters" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--sided", "one", "--frequency", "2"], "state its damping by --damping-ratio"),
        (
            ["--sided", "one", "--frequency", "2", "--frequency", "3", "--damping-ratio", "0.01"],
            "state their case by --case",
        ),
    ],
)
def test_without_a_system_it_is_said_what_to_state(options, said, capsys):
    found = noise(spectrum(), *options)
    assert found["second_moment"] is None
    assert said in " ".join(capsys.readouterr().out.split())


def test_natural_frequencies_of_systems():
    for name, expected in (("flutter", 2), ("hoisted", 1), ("coupled", 2)):
        assert len(natural_frequencies(load_case(ROOT / f"cases/systems/{name}.toml").system)) == expected
    assert natural_frequencies(load_case(ROOT / "cases/systems/coupled.toml").system) == pytest.approx((1.0, 1.6))
    assert natural_frequencies(load_case(ROOT / "cases/fig1.toml").system) == pytest.approx((1.0,))


FILE = ["spectrum.csv", "--sided", "one"]
AT_2 = [*FILE, "--frequency", "2"]
REFUSED = {
    "no file": ([], "name a file"),
    "no frequency": (FILE, "state the natural frequency by --frequency"),
    "no sides": (["spectrum.csv", "--frequency", "2"], "one-sided"),
    "far": ([*FILE, "--frequency", "40"], "near 2ω = 502.7 rad/time (80 cycles)"),
    "two places": (
        [*AT_2, "--of", "damping", "--noise-in", "stiffness"],
        "leave one out",
    ),
    "no gm": ([*AT_2, "--of", "height"], "metacentric height in m by --gm"),
    "gm": ([*AT_2, "--gm", "1"], "--gm belongs to --of height"),
    "length": ([*FILE, "--length", "2"], "is for --of acceleration"),
    "apart": (
        [*FILE, "--of", "acceleration", "--length", "2", "--frequency", "2"],
        "--length 0.3524 Hz",
    ),
    "unit": ([*AT_2, "--of", "acceleration"], 'has the unit "1/Hz"'),
    "percent": ([*AT_2, "--damping-ratio", "1"], "0.01 is 1 %"),
    "half": ([*AT_2, "--restitution", "0.9"], "state --damping-ratio"),
    "terms": ([*AT_2, "--terms", "3"], "from 1 to 2"),
    "no record": ([*AT_2, "--kind", "non-gaussian"], "name a record"),
    "column": ([*AT_2, "--column", "g"], 'no column "g"; did you mean "G"?'),
    "mode": ([*AT_2, "--mode", "1"], "--mode is for the table"),
    "averages": ([*AT_2, "--averages", "0"], "from 1 to 1e+12"),
    "many averages": ([*AT_2, "--averages", "1e300"], "from 1 to 1e+12"),
    "no number": ([*AT_2, "--damping-ratio", "nan"], "got --damping-ratio nan"),
    "rate": ([*AT_2, "--rate", "10"], "--rate is for a record"),
    "sides of a record": (["--record", "record.csv", "--sided", "one", "--frequency", "2"], "is for a spectrum"),
    "wrong sides": (
        ["spectrum.csv", "--sided", "two", "--frequency", "2", "--record", "record.csv"],
        "state another sided",
    ),
    "case": ([*FILE, "--case", "my.toml"], "has its noise in the damping"),
    "both": ([*FILE, "--case", "my.toml", "--damping-ratio", "0.1"], "leave out --damping-ratio"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name, capsys):
    """One sentence, exit code 2, nothing written."""
    options, said = REFUSED[name]
    spectrum()
    x = np.random.default_rng(0).normal(size=512)
    x *= NOISE.standard_deviation / x.std()
    np.savetxt("record.csv", np.column_stack([np.arange(512) / 64, x]), delimiter=",", header="t (s),x", comments="")
    if "my.toml" in options:
        Path("my.toml").write_text(MY_CASE, encoding="utf-8")
    before = sorted(Path().rglob("*"))
    assert main(["noise", *options]) == BAD_INPUT
    out, error = capsys.readouterr()
    assert said in error
    assert error.count("\n") == 1
    assert not out
    assert sorted(Path().rglob("*")) == before


@pytest.mark.slow
def test_the_page_of_the_docs(tmp_path, monkeypatch, capsys):
    """Each command of the page runs, and prints what the page says it does."""
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    page = (ROOT / "docs/guide/measurement.md").read_text(encoding="utf-8")
    names, printed = {}, ""
    for language, block in re.findall(r"^```(python|sh|text)\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        if language == "python" and "fit_noise" not in block:
            exec(block, names)
        elif language == "sh":
            for line in block.splitlines():
                assert main(shlex.split(line)[1:]) == 0, line
            printed = " ".join(capsys.readouterr().out.split())
        elif language == "text":
            for line in block.splitlines():
                assert " ".join(line.split()) in printed, line


def test_results_stay_where_they_belong():
    """A file called ...csv does not lead out of --out, nor a file into the folder of a case; no old case is left."""
    options = ["--sided", "one", "--averages", "64", "--frequency", "2"]
    for name in ("...csv", "m.csv"):
        noise(spectrum(name), *options, "--damping-ratio", "0.01")
        assert (Path("results") / name / "noise.toml").is_file()
    noise("m.csv", *options)
    assert not Path("results/m.csv/noise.toml").exists()
    assert {path.name for path in Path().iterdir()} == {"...csv", "m.csv", "results"}


def test_what_was_assumed_is_said(capsys):
    np.savetxt("a.csv", np.column_stack([F, 0.02 / (1 + F)]), delimiter=",", header="f (Hz),G")
    found = noise("a.csv", "--sided", "one", "--of", "acceleration", "--frequency", "2", "--averages", "9")
    assert any("taken as m/s²" in each for each in found["warnings"])
    assert "state --unit" in capsys.readouterr().err


def test_a_named_density_becomes_a_case(capsys):
    options = ["--named", "kanai-tajimi", "--parameters", "S0=0.01", "--of", "acceleration", "--frequency", "2.5"]
    found = noise(*options, "--damping-ratio", "0.05", "--kind", "filter")
    assert load_case("results/kanai-tajimi/noise.toml").problem.values["noise.zeta"] > 0.3
    assert abs(found["frequencies"][0]["measured_over_fitted"] - 1) < 0.3
    assert "how many averages" not in capsys.readouterr().err
    for more, said in (
        (["--record", "a.csv"], "in place of a file"),
        (["--scale", "0"], "state another --scale"),
        (["--sided", "two"], "--sided is for a file, and a density was named; leave it out"),
        (["--log-log"], "--log-log is for a file"),
    ):
        assert main(["noise", *options, *more]) == BAD_INPUT
        assert said in capsys.readouterr().err
