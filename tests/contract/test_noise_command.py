"""`fpsolve noise`: from a measurement to a case and to what it means, and what it refuses."""

import io
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from fpsolve import OrnsteinUhlenbeck, load_case, moment_lyapunov
from fpsolve.measured import named_density, read_spectrum, weak_exponent, weak_moment
from tests.kit import files, read_json, run

ROOT = Path(__file__).parents[2]
F, OMEGA, GRAVITY = np.linspace(0.05, 20, 400), 4 * math.pi, 9.80665
NOISE = OrnsteinUhlenbeck(alpha=12.0, sigma=0.15)
AT_DOUBLE = NOISE.spectral_density(2 * OMEGA)
MY_CASE = f"""
title = "Noise in the damping, 2 Hz, 2 %"
oscillator = {{ omega = {OMEGA}, c1 = {-0.04 * OMEGA}, restitution = 1.0, epsilon = 1.0 }}
noise = {{ kind = "white", s = 0.1 }}
moments = {{ p = [2.0] }}
units = {{ time = "s" }}
"""
TWICE = f"""
title = "x"
units.time = "s"
[system]
variables = ["x", "v"]
drift = ["v", "-w**2*(1 + 2*xi)*x - c*v"]
parameters = {{ w = {OMEGA}, c = 0.5 }}
[noise]
kind = "white"
s = 0.1
[moments]
p = [2.0]
"""


def spectrum(head="f (Hz),G (1/Hz)", factor=1.0, G=lambda f: 2 * NOISE.spectral_density(2 * math.pi * f)):
    """The text of a one-sided density per Hz."""
    return "\n".join([head, *(f"{f:.10g},{factor * G(f):.10g}" for f in F)]) + "\n"


def laser(f):
    """In units in which its 1 kHz are 2 Hz."""
    return 5e-10 / (1 + (f / 40) ** 2) * (1 + 0.2 / f)


EXACT = spectrum()
SURE = "m.csv --sided one --averages 64"
AT_2 = "m.csv --sided one --frequency 2"


def noise(folder, options, text=EXACT, **more):
    """What noise.json says, and what was printed."""
    ended = run(folder, "noise", *shlex.split(options), **{"m.csv": text}, **more)
    assert ended.code == 0, ended.err
    return read_json(next((folder / "results").glob("*/noise.json"))), " ".join(ended.out.split()), ended.err


def known(found, name):
    """λ or Λ(2), and its standard error."""
    return found[name]["value"], found[name]["standard_error"]


def critical(found):
    """The damping ratio from which on Λ(2) < 0, and λ < 0."""
    return [found["critical_damping_ratio"][name]["value"] for name in ("moment", "lyapunov_exponent")]


def test_spectrum_becomes_a_case_and_a_verdict_by_the_averaged_formulas(tmp_path):
    """A fit of an exact spectrum is the noise; a wall adds N ln r to λ, with N of an exponential covariance."""
    options = f"{SURE} --per Hz --noise-in stiffness --frequency 2 --damping-ratio 0.01 --restitution 0.9"
    found, printed, _ = noise(tmp_path, options)
    assert found["fit"]["parameters"] == pytest.approx({"alpha": 12.0, "sigma": 0.15}, rel=1e-4)
    turns = OMEGA * math.sqrt(1 - 1e-4) - OMEGA**3 * AT_DOUBLE / (4 * NOISE.alpha)
    wall = turns / math.pi * math.log(0.9)
    exponent = weak_exponent(OMEGA, 0.01, AT_DOUBLE, "stiffness") + wall
    moment = weak_moment(2, OMEGA, 0.01, AT_DOUBLE, 0, "stiffness") + 2 * wall
    assert known(found, "lyapunov_exponent")[0] == pytest.approx(exponent, rel=1e-5)
    assert known(found, "second_moment")[0] == pytest.approx(moment, rel=1e-4)
    assert found["second_moment"]["probability_below_0"] > 0.999
    assert critical(found) == pytest.approx([OMEGA * AT_DOUBLE / 4, OMEGA * AT_DOUBLE / 8], rel=1e-3)
    values = load_case(tmp_path / "results/m.csv/noise.toml").problem.values
    oscillator = {"system.stiffness": OMEGA**2, "system.damping": 0.01 * OMEGA, "system.restitution": 0.9}
    assert values == pytest.approx({**oscillator, "noise.alpha": 12.0, "noise.sigma": 0.15 * OMEGA**2}, rel=1e-4)
    assert 'kind = "ornstein-uhlenbeck"' in printed
    assert "the mean square decays with a probability of > 99.9 %" in printed
    assert files(tmp_path / "results/m.csv") == {
        *(f"noise.{ending}" for ending in ("json", "png", "pdf", "toml")),
        "records/files.txt",
    }


def test_lambda_within_two_standard_errors_of_0_decides_nothing_and_says_what_does(tmp_path):
    """An error falls as the root of the averages, so that (2 error/value)² times as many decide."""
    options = f"{AT_2} --damping-ratio {OMEGA * AT_DOUBLE / 8.2:.6g} --averages"
    found, printed, _ = noise(tmp_path, f"{options} 4")
    value, error = known(found, "lyapunov_exponent")
    times = (2 * error / value) ** 2
    assert found["lyapunov_exponent"]["to_decide"]["times_as_long"] == pytest.approx(times, rel=0.01)
    assert not found["lyapunov_exponent"]["decided"]
    share = 50 * math.erfc(-value / error / math.sqrt(2))
    assert f"not decided, almost every path grows with a probability of {share:.3g} %; take some " in printed
    for factor in (0.95, 1.05):
        found, printed, _ = noise(tmp_path, f"{options} {4 * times * factor}")
        assert found["lyapunov_exponent"]["decided"] == (factor > 1)
    assert found["lyapunov_exponent"]["to_decide"] is None
    assert "not decided" not in printed


def test_noise_in_the_damping_of_a_case_needs_the_density_at_0(tmp_path):
    """S(0) is here some ten times S(2ω)."""
    text, more = spectrum("f (Hz),G (1/s²/Hz)", 0.4), "m.csv --sided one --of damping --case my.toml"
    sets = {"my": MY_CASE + 'vary.file = "sets.csv"', "sets.csv": "oscillator.c1\n-0.5\n"}
    found, _, _ = noise(tmp_path, more, text, **sets)
    assert [each["name"] for each in found["frequencies"]] == ["2ω", "0"]
    expected = weak_moment(2, OMEGA, 0.02, 0.4 * AT_DOUBLE, 0.4 * NOISE.spectral_density(0.0), "damping")
    assert known(found, "second_moment")[0] == pytest.approx(expected, rel=1e-3)
    values = load_case(tmp_path / "results/m.csv/noise.toml").problem.values
    assert values["oscillator.omega"] == pytest.approx(OMEGA)


def test_noise_times_2_in_the_equation_of_a_case_has_no_line_of_weak_noise(tmp_path):
    found, printed, _ = noise(tmp_path, f"{SURE} --noise-in stiffness --case my.toml", my=TWICE)
    assert found["critical_damping_ratio"] == {"lyapunov_exponent": None, "moment": None}
    expected = weak_moment(2, OMEGA, 0.25 / OMEGA, 4 * AT_DOUBLE, 0, "stiffness")
    assert known(found, "second_moment")[0] == pytest.approx(expected, rel=0.02)
    assert "Damping needed" not in printed


PARAMETRIC = f"""
title = "x"
system = {{ kind = "parametric", stiffness = {OMEGA**2}, damping = 0.25, restitution = 0.9 }}
noise = {{ kind = "white", s = 0.1 }}
moments = {{ p = [2.0] }}
units = {{ time = "s" }}
"""
DELTA = MY_CASE.replace("restitution = 1.0", "restitution = 0.9") + 'vary."oscillator.c1" = [-0.5]'
OF_CASES = {  # with the place of the noise, ln R, and by what the noise is multiplied in the equation
    "delta": (DELTA, "damping", -0.1, 1),
    "restitution": (
        MY_CASE.replace("1.0, eps", '0.9, c2 = 0.1, impact = "restitution", eps'),
        "damping",
        math.log(0.9),
        1,
    ),
    "parametric": (PARAMETRIC, "stiffness", math.log(0.9), 1),
    "equation": (TWICE, "stiffness", 0.0, 2),
}


@pytest.mark.parametrize("name", OF_CASES)
def test_two_noises_in_the_place_of_that_of_a_case_act_by_the_density_of_their_sum(name, tmp_path):
    """In weak noise, beside two impacts in a period; and as the one noise that they are together."""
    text, place, log_factor, by = OF_CASES[name]
    head, size = ("f (Hz),G (1/s²/Hz)", 6 * OMEGA**2) if place == "damping" else ("f (Hz),G (1/Hz)", 6)
    options = f"{SURE} --of {place} --case my.toml --terms"
    one, two = (noise(tmp_path, f"{options} {n}", spectrum(head, size), my=text)[0] for n in (1, 2))
    moment, _ = known(two, "second_moment")
    assert moment == pytest.approx(known(one, "second_moment")[0], rel=1e-4)
    at_double, at_zero = (by**2 * size * NOISE.spectral_density(each) for each in (2 * OMEGA, 0.0))
    assert two["frequencies"][0]["fitted_density"]["value"] * by**2 == pytest.approx(at_double, rel=1e-3)
    zeta = 0.02 if place == "damping" else 0.25 / OMEGA
    still = -2 * zeta * OMEGA + 2 * log_factor * OMEGA / math.pi
    grown = weak_moment(2, OMEGA, 0.0, at_double, at_zero, place)
    assert moment - still == pytest.approx(grown, rel=0.1)
    case = load_case(tmp_path / "results/m.csv/noise.toml")
    assert case.system.noise_sections == ("noise.first", "noise.second")
    assert case.vary.keys == (("system.c1",) if name == "delta" else ())
    assert moment_lyapunov(case.parameter_set(next(iter(case.vary.sets))).problem, 2.0).value[0] == pytest.approx(
        moment, rel=0.02
    )


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_page_is_what_was_measured_the_verdict_and_the_section_on_one_screen(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    options = f"{SURE} --frequency 2 --damping-ratio 0.01 --restitution 0.9"
    ended = run(tmp_path, "noise", *options.split(), to=Terminal, **{"m.csv": EXACT})
    printed, order = (
        re.sub(r"\x1b\[[0-9;]*m", "", ended.out),
        ["2f", "Damping needed", "λ = ", "Λ(2) = ", "[noise]", "written"],
    )
    assert sorted(order, key=printed.index) == order
    assert printed.count("\n") <= 24
    assert max(map(len, printed.split("\n"))) <= 80
    row = [cell.strip() for cell in printed.split("2f")[1].split("│")]
    assert [float(row[i]) for i in (1, 2, 4, 6)] == pytest.approx([4, AT_DOUBLE, AT_DOUBLE, 1], rel=1e-3)


def test_where_no_noise_of_the_kind_is_that_of_a_formula_another_kind_decides(tmp_path):
    """A filter with the density of `laser` at 2ω but for a thousandth: ζ is put where its Λ(2) = 0."""
    options, text = f"{AT_2} --kind filter --damping-ratio", spectrum(G=laser)
    found, _, _ = noise(tmp_path, f"{options} 1e-9", text)
    zeta = OMEGA * found["frequencies"][0]["fitted_density"]["value"] / 4
    found, printed, _ = noise(tmp_path, f"{options} {zeta}", text)
    assert found["second_moment"]["to_decide"]["times_as_long"] is None
    assert "no more data but another --kind or --terms 2 helps" in printed


def test_without_averages_these_are_asked_for_where_nothing_is_decided(tmp_path):
    rough = np.random.default_rng(1).gamma(16, 1 / 16, F.size)
    text = spectrum(G=lambda f: 2 * NOISE.spectral_density(2 * math.pi * f) * float(np.interp(f, F, rough)))
    _, printed, _ = noise(tmp_path, f"{AT_2} --damping-ratio {OMEGA * AT_DOUBLE / 4}", text)
    assert "state --averages; by the scatter of the values some" in printed


def test_a_longer_record_is_asked_for_where_nothing_is_decided(tmp_path):
    kicks, left = np.random.default_rng(2).normal(size=4096), math.exp(-NOISE.alpha / 64)
    values = lfilter([NOISE.standard_deviation * math.sqrt(1 - left**2)], [1, -left], kicks)
    text = "t (s),x (1)\n" + "".join(f"{k / 64},{each}\n" for k, each in enumerate(values))
    options = f"--record m.csv --of stiffness --frequency 2 --damping-ratio {OMEGA * AT_DOUBLE / 4}"
    found, printed, _ = noise(tmp_path, options, text)
    assert found["second_moment"]["to_decide"]["times_as_long"] > 1
    assert "s of record in place of 64." in printed


def test_noise_of_eq_7_is_written_with_its_treatment(tmp_path):
    """Two sines of random walks are bounded, with the kurtosis 2.25."""
    values = 0.1 * np.sin(np.cumsum(0.3 * np.random.default_rng(0).normal(size=(20_000, 2)), axis=0)).sum(axis=1)
    text = "t (s),k (-)\n" + "".join(f"{0.02 * k:.2f},{each}\n" for k, each in enumerate(values))
    options = "--record m.csv --of stiffness --frequency 2 --damping-ratio 0.01 --kind non-gaussian"
    _, printed, _ = noise(tmp_path, options, text)
    assert 'kind = "non-gaussian" treatment = "exact"' in printed
    assert load_case(tmp_path / "results/m.csv/noise.toml").noise.values["treatment"] == "exact"


@pytest.mark.slow
def test_acceleration_of_a_support_as_two_noises_has_their_density(tmp_path):
    """ω² = g/ℓ and ξ = a/g."""
    both = OrnsteinUhlenbeck(alpha=4.0, sigma=0.1), OrnsteinUhlenbeck(alpha=60.0, sigma=0.3)

    def density(omega):
        return sum(each.spectral_density(omega) for each in both)

    text = spectrum("f (Hz),G ((m/s^2)^2/Hz)", GRAVITY**2, lambda f: 2 * density(2 * math.pi * f))
    options = f"{SURE} --of acceleration --length {GRAVITY / OMEGA**2!r} --damping-ratio 0.01 --terms 2"
    found, _, _ = noise(tmp_path, options, text)
    at_double = density(2 * OMEGA)
    assert found["natural_frequencies"] == pytest.approx([OMEGA])
    assert found["frequencies"][0]["fitted_density"]["value"] == pytest.approx(at_double, rel=1e-3)
    expected = weak_moment(2, OMEGA, 0.01, at_double, 0, "stiffness")
    assert known(found, "second_moment")[0] == pytest.approx(expected, rel=5e-3)
    case = load_case(tmp_path / "results/m.csv/noise.toml")
    assert case.system.noise_sections == ("noise.first", "noise.second")


BUOY = ROOT / "cases/measured/buoy.csv"
AT_SEA = f"--of acceleration --column acceleration --sided one --averages 12 --length 60 --damping-ratio 0.001 {BUOY}"


@pytest.mark.parametrize("kind", ["filter", "ornstein-uhlenbeck"])
def test_sea_at_a_buoy_has_its_measured_density_at_2_omega(kind, tmp_path):
    """Public data to a verdict: by the mean of the values within 10 % of it, which a fit of another family has, too."""
    found, _, warned = noise(tmp_path, f"{AT_SEA} --kind {kind}")
    [row], omega = found["frequencies"], math.sqrt(GRAVITY / 60)
    sea = read_spectrum(BUOY, sided="one", of="height", column="elevation")
    near = np.argsort(abs(sea.frequencies - 2 * omega))[:5]
    by_hand = np.mean((sea.frequencies**4 * sea.density)[near]) / GRAVITY**2
    fitted = row["fitted_density"]["value"]
    assert fitted == pytest.approx(by_hand, rel=0.3 if kind == "filter" else 2 / math.sqrt(12 * 5))
    moment, error = known(found, "second_moment")
    assert moment == pytest.approx(weak_moment(2, omega, 0.001, fitted, 0, "stiffness"), rel=2e-3)
    measured = row["measured_density"]
    assert row["measured_over_fitted"] == pytest.approx(measured["value"] / fitted)
    assert critical(found)[0] == pytest.approx(omega * measured["value"] / 4, rel=1e-3)
    if kind == "filter":
        exponent = weak_exponent(omega, 0.001, fitted, "stiffness")
        assert known(found, "lyapunov_exponent")[0] == pytest.approx(exponent, rel=1e-3)
        assert found["second_moment"]["probability_below_0"] > 0.99
        values = load_case(tmp_path / "results/buoy.csv/noise.toml").problem.values
        assert load_case(ROOT / "cases/systems/hoisted.toml").problem.values == pytest.approx(values, rel=1e-5)
    else:
        assert row["measured_over_fitted"] == pytest.approx(1, abs=1e-3)
        assert error == pytest.approx(measured["standard_error"] * omega**2 / 2, rel=0.5)
        assert "off the best fit" in warned


def peaks(f):
    return sum(a / ((1 - (f / g) ** 2) ** 2 + (0.1 * f / g) ** 2) for a, g in [(1e-6, 1), (3e-6, 4)])


@pytest.mark.parametrize("kind", ["ornstein-uhlenbeck", "filter"])
@pytest.mark.parametrize(("G", "zeta", "rel"), [(laser, 1e-9, 1e-3), (peaks, 0.01, 0.015)])  # of a peak between values
def test_misfit_of_values_without_scatter_is_not_taken_for_scatter(G, zeta, rel, kind, tmp_path):
    options = f"{AT_2} --damping-ratio {zeta} --kind {kind}"
    (found, printed, _), at_double = noise(tmp_path, options, spectrum(G=G)), G(4.0) / 2
    assert critical(found)[0] == pytest.approx(OMEGA * at_double / 4, rel=rel)
    assert found["frequencies"][0]["fitted_density"]["value"] == pytest.approx(at_double, rel=rel)
    if G is laser:
        expected = weak_moment(2, OMEGA, zeta, at_double, 0, "stiffness")
        assert known(found, "second_moment")[0] == pytest.approx(expected, rel=0.01) == pytest.approx(-4.6e-9, rel=0.01)
        assert "grows" not in printed


def test_named_density_of_waves_has_no_errors(tmp_path):
    stated = "--named jonswap --parameters Hs=2,Tp=9 --of stiffness --scale 0.01 --frequency 0.05 --damping-ratio 0.01"
    found, printed, warned = noise(tmp_path, stated)
    least = 5e-5 * math.pi * 0.05 * float(named_density("jonswap", 0.2 * math.pi, Hs=2, Tp=9))
    assert found["second_moment"]["standard_error"] is found["second_moment"]["probability_below_0"] is None
    assert found["frequencies"][0]["measured_density"]["standard_error"] is None
    assert found["read"] == "gamma = 3.3, Hs = 2, Tp = 9"
    assert printed.startswith(f"jonswap: {found['read']} Density")
    assert f"for Λ(2) < 0: {100 * least:.4g} %." in printed
    assert not any(each in printed + warned for each in ("probabilit", "measured", "±"))


GROUND = "--named kanai-tajimi --parameters S0=0.01 --of acceleration --frequency 2.5"


def test_named_density_of_the_ground_becomes_a_case_in_its_own_unit(tmp_path):
    found, _, warned = noise(tmp_path, f"{GROUND} --damping-ratio 0.05 --kind filter")
    assert load_case(tmp_path / "results/kanai-tajimi/noise.toml").problem.values["noise.zeta"] > 0.3
    assert abs(found["frequencies"][0]["measured_over_fitted"] - 1) < 0.3
    assert "how many averages" not in warned


SAID = [
    # what is said where no verdict can be told
    (AT_2, EXACT, "state its damping by --damping-ratio", ""),
    (f"{AT_2} --frequency 3 --damping-ratio 0.01", EXACT, "state their case by --case", ""),
    (f"{SURE} --frequency 2 --terms 2", EXACT, "", "do not determine all parameters"),
]


@pytest.mark.parametrize(("options", "text", "printed", "warned"), SAID)
def test_what_is_not_stated_is_said(options, text, printed, warned, tmp_path):
    found, out, err = noise(tmp_path, options, text)
    assert printed in out
    assert warned in " ".join(err.split())
    assert found["second_moment"] is None
    if "--terms" in options:
        assert found["frequencies"][0]["fitted_density"]["value"] == pytest.approx(AT_DOUBLE, rel=1e-3)


FILE, SEA = "m.csv --sided one", "--named jonswap --of stiffness --scale 1 --frequency 0.1 --parameters"
RECORD = np.random.default_rng(0).normal(size=512)
RECORD *= NOISE.standard_deviation / RECORD.std()
GIVEN = {
    "m.csv": EXACT,
    "peaks.csv": spectrum(G=lambda f: 1 / (1 + (f - 4) ** 2) + 1 / (1 + (f - 12) ** 2)),
    "record.csv": "t (s),x (1)\n" + "".join(f"{k / 64},{each}\n" for k, each in enumerate(RECORD)),
    "my": MY_CASE,
    "laws": MY_CASE + 'vary."oscillator.impact" = ["delta", "restitution"]',
    "names": TWICE.replace("c*v", "first*v").replace("c = 0.5", "first = 0.5"),
    "modes": (ROOT / "cases/systems/coupled.toml").read_text(encoding="utf-8"),
    "named.csv": spectrum("f (Hz),G"),
}
REFUSED = {
    "": "name a file",
    FILE: "state the natural frequency by --frequency",
    "m.csv --frequency 2": "one-sided",
    f"{FILE} --frequency 40": "near 2ω = 502.7 rad/time (80 cycles)",
    f"{AT_2} --of damping --noise-in stiffness": "leave one out",
    f"{AT_2} --of height": "metacentric height in m by --gm",
    f"{AT_2} --gm 1": "--gm belongs to --of height",
    f"{FILE} --length 2": "is for --of acceleration",
    f"{FILE} --of acceleration --length 2 --frequency 2": "--length 0.3524 Hz",
    f"{AT_2} --of acceleration": 'has the unit "1/Hz"',
    f"{AT_2} --damping-ratio 1": "0.01 is 1 %",
    f"{AT_2} --damping-ratio nan": "got --damping-ratio nan",
    f"{AT_2} --restitution 0.9": "state --damping-ratio",
    f"{AT_2} --terms 3": "from 1 to 2",
    f"{AT_2} --kind non-gaussian": "name a record",
    f"{AT_2} --column g": 'no column "g"; did you mean "G"?',
    f"{AT_2} --frequency 3 --frequency 4": "got 3 natural frequencies; state one or two",
    f"{AT_2} --by rows": "--by is for a record",
    "named.csv --sided one --frequency 2": "states no unit of the column G; state --unit, such as 1/Hz",
    f"{AT_2} --averages 0": "from 1 to 1e+12",
    f"{AT_2} --averages 1e300": "from 1 to 1e+12",
    f"{AT_2} --rate 10": "--rate is for a record",
    "--record record.csv --sided one --frequency 2": "is for a spectrum",
    "m.csv --sided two --frequency 2 --record record.csv": "a spectrum and a record; leave out one",
    f"{FILE} --case my.toml": "has its noise in the damping",
    f"{FILE} --case my.toml --damping-ratio 0.1": "which --case states; leave it out",
    f"{FILE} --of damping --case laws.toml --terms 2": "leave out [vary] of the impact law",
    f"{FILE} --case names.toml --terms 2": "got the name first twice",
    f"{FILE} --case modes.toml --terms 2": "has one noise; write the system as an equation",
    "peaks.csv --sided one --frequency 2 --frequency 6": "take another kind, such as filter",
    f"{GROUND} --record record.csv": "in place of a file",
    f"{GROUND} --scale nan": "got --scale nan; must be finite",
    f"{GROUND} --sided two": "--sided is for a file, and a density was named; leave it out",
    f"{GROUND} --unit g": "--unit is for a file",
    f"{SEA} Hs=2": "jonswap lacks Tp; its parameters are Hs: significant wave height, in m",
    f"{SEA} Hs=2,Tp=9,U=1": "has no U",
    f"{SEA} Hs=2,Tp=9,gamma=0.5": "got gamma = 0.5; must be from 1 to 7",
    f"{SEA} Hs=-2,Tp=9": "got Hs = -2; must be > 0",
}


@pytest.mark.parametrize("options", REFUSED)
def test_options_of_noise_that_do_not_fit_are_refused_in_one_sentence(options, tmp_path):
    found = run(tmp_path, "noise", *options.split(), **GIVEN)
    assert (found.code, found.out) == (2, "")
    assert REFUSED[options] in found.err
    assert found.err.count("\n") == 1
    assert len(files(tmp_path)) == len(GIVEN)


def test_results_of_noise_stay_in_their_folder_and_no_old_case_is_left(tmp_path):
    """A file called ...csv does not lead out of --out, nor a file into the folder of a case."""
    for name in ("...csv", "m.csv"):
        noise(tmp_path, f"{SURE.replace('m.csv', name)} --frequency 2 --damping-ratio 0.01", **{"...csv": EXACT})
        assert (tmp_path / "results" / name / "noise.toml").is_file()
    noise(tmp_path, f"{SURE} --frequency 2")
    assert not (tmp_path / "results/m.csv/noise.toml").exists()
    assert {path.name for path in tmp_path.iterdir()} == {"...csv", "m.csv", "results"}


@pytest.mark.slow
def test_page_of_the_docs_about_measurements_prints_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cases").symlink_to(ROOT / "cases")
    page, names, printed = (ROOT / "docs/guide/measurement.md").read_text(encoding="utf-8"), {}, ""
    for language, block in re.findall(r"^```(python|sh|text)\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        if language == "python" and "fit_noise" not in block:
            exec(block, names)
        for line in block.splitlines() if language != "python" else ():
            if language == "sh":
                ended = run(tmp_path, *shlex.split(line)[1:])
                assert ended.code == 0, line
                printed += " ".join(f"{ended.out} {ended.err} ".split())
            else:
                assert " ".join(line.split()) in printed, line
