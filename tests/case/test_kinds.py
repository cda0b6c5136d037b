"""Cases of systems and noises of any kind."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from fpsolve import moment_lyapunov
from fpsolve.case.case import load_case
from fpsolve.case.vary import legend
from fpsolve.cli import main
from fpsolve.errors import CaseError
from fpsolve.model.noises.markov_chain import MarkovChain, Telegraph
from fpsolve.model.noises.non_gaussian import NonGaussianNoise, ReducedNoise
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from tests.oracles import fourier_hermite, kronecker

OSCILLATOR = """\
title = "kinds"
[oscillator]
omega = 1.0
restitution = 0.8
c1 = 0.1
epsilon = 0.1
"""
MOMENTS = "[moments]\np = [2.0]\n"
ONLY = '[output]\nquantities = ["moment", "lyapunov_exponent"]\n'
REDUCED = '[noise]\nD0 = 1.0\ntau0 = 0.5\nr0 = 0.95\ntreatment = "ou-reduction"\n'
EXACT, NON_GAUSSIAN = 'treatment = "exact"\n', 'kind = "non-gaussian"\n'
PARAMETRIC = """\
title = "kinds"
[system]
variables = ["x", "v"]
drift = ["v", "-x - 0.2*v - xi*x"]
[noise]
D0 = 0.3
tau0 = 0.7
r0 = 0.42
"""
SINE = '[noise]\nkind = "sine-wiener"\namplitude = 1.0\nsigma = 1.0\n'


def write(folder: Path, *parts: str) -> Path:
    path = folder / "kinds.toml"
    path.write_text("".join(parts), encoding="utf-8")
    return path


def said(folder: Path, *parts: str) -> list[str]:
    with pytest.raises(CaseError) as raised:
        load_case(write(folder, *parts))
    return [f"{fault.line}: {fault.key}: {fault.sentence}" for fault in raised.value.faults]


def solved(path: Path, out: Path) -> dict[str, float]:
    """Λ(2) of the curves by their labels."""
    assert main(["run", str(path), "--out", str(out)]) == 0
    curves = json.loads((out / "kinds/summary.json").read_text(encoding="utf-8"))["curves"]
    return {str(curve["parameters"]): curve["moments"][0]["moment"] for curve in curves}


@pytest.mark.parametrize("keys", ["", EXACT, NON_GAUSSIAN, NON_GAUSSIAN + EXACT])
def test_the_noise_of_eq_7_is_taken_as_it_stands_however_it_is_named(
    tmp_path: Path, keys: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """E x xᵀ and polynomials of the noise tell Λ(2)."""
    text = write(tmp_path, PARAMETRIC, keys, MOMENTS)
    driven = [[0.0, 0.0], [-1.0, 0.0]]
    own, xi = (each.toarray() for each in fourier_hermite.bounded_noise(0.3, 0.7, 0.42, 40))
    expected = kronecker.several([[0.0, 1.0], [-1.0, -0.2]], [(driven, own, xi)], [], [], 2, 0.0)
    assert expected == pytest.approx(-0.1412, abs=5e-5)
    problem = Problem(load_case(text).system, NonGaussianNoise(D0=0.3, tau0=0.7, r0=0.42))
    assert moment_lyapunov(problem, 2.0).value[0] == pytest.approx(expected, abs=1e-9)
    [(parameters, value)] = solved(text, tmp_path).items()
    assert "'noise.treatment': 'exact'" in parameters
    assert value == pytest.approx(expected, abs=1e-9)
    assert capsys.readouterr().out.startswith(
        'kinds\nnoise.treatment = "exact": the noise is that of Eq. (7) as it stands.\n'
    )


@pytest.mark.parametrize("keys", ["", NON_GAUSSIAN, 'kind = "ou-reduction"\n'])
def test_the_reduction_is_taken_where_a_case_states_it(tmp_path: Path, keys: str) -> None:
    stated = PARAMETRIC + 'treatment = "ou-reduction"\n'
    problem = load_case(write(tmp_path, stated, keys, MOMENTS)).problem
    assert problem.noise == ReducedNoise(D0=0.3, tau0=0.7, r0=0.42)
    assert moment_lyapunov(problem, 2.0).value[0] == pytest.approx(-0.0833449128, abs=1e-9)
    [text] = said(tmp_path, stated.replace("0.42", "1.8"), keys, MOMENTS)
    assert "< 5/3" in text


def test_the_system_has_two_names(tmp_path: Path) -> None:
    usual = load_case(write(tmp_path, OSCILLATOR, REDUCED, MOMENTS))
    named = OSCILLATOR.replace("[oscillator]", '[system]\nkind = "vibro-impact"')
    again = load_case(write(tmp_path, named, REDUCED.replace("D0", 'kind = "ou-reduction"\nD0'), MOMENTS))
    assert again.problem == usual.problem == Problem(usual.oscillator, ReducedNoise(D0=1.0, tau0=0.5, r0=0.95))
    assert again.curve({"oscillator.omega": 2.0}).parameters["oscillator.omega"] == 2.0
    [text] = said(tmp_path, OSCILLATOR, named.partition("\n")[2], REDUCED, MOMENTS)
    assert text.endswith("oscillator: stands beside [system], but a case has one system; remove one of the two")
    [text] = said(tmp_path, OSCILLATOR, 'kind = "markov-chain"\n', REDUCED, MOMENTS)
    assert text.startswith('7: oscillator.kind: got "markov-chain"; must be one of vibro-impact, parametric, ')


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        ('kind = "whit"', '8: noise.kind: got "whit"; must be one of non-gaussian, '),
        ('kind = "whit"', '; did you mean "white"? write, for example, kind = "non-gaussian"'),
        ("kind = 3", "8: noise.kind: got 3 (a number); must be one of "),
        ('kind = "telegraph"\na = 1.0', "7: noise.k: missing; must be a finite number >= 1e-15 and <= 1e15 (rate"),
        (
            'kind = "sine-wiener"\nsigma = 1.0\namplitud = 1.0',
            '10: noise.amplitud: unknown key; did you mean "amplitude"?',
        ),
        ('kind = "telegraph"\na = 1.0\nk = -1.0', "10: noise.k: got -1.0; must be a finite number >= 1e-15"),
        (
            'kind = "ou-reduction"\nD0 = 1.0\ntau0 = 1.0\nr0 = 1.0\ntreatment = "exact"',
            '12: noise.treatment: got "exact" beside kind = "ou-reduction"; remove one of the two',
        ),
        ('kind = "markov-chain"\nstates = [1.0]\nrates = [[1.0]]', "got (1,) states and (1, 1) rates; must be"),
        (
            'kind = "markov-chain"\nstates = 1.0\nrates = [[1.0]]',
            "9: noise.states: got 1.0 (a number); must be a list ",
        ),
        ('kind = "markov-chain"\nstates = [1.0]', "7: noise.rates: missing; must be a list of lists of finite numbers"),
    ],
)
def test_one_message_for_what_is_wrong_with_a_kind(tmp_path: Path, noise: str, words: str) -> None:
    rest = '[vary]\n"noise.x" = [1.0]\n' * ("whit" in noise)
    [text] = said(tmp_path, OSCILLATOR, f"[noise]\n{noise}\n", MOMENTS, rest)
    assert words in text


def test_figures_speak_of_the_parameters_of_the_case(tmp_path: Path) -> None:
    """Two kinds may have a parameter of one name."""
    case = load_case(write(tmp_path, OSCILLATOR, SINE, MOMENTS, '[units]\ntime = "s"\n'))
    quantities = {key: each.quantity for key, each in case.parameters.items()}
    assert case.about("noise.sigma").latex == quantities["noise.sigma"].latex == r"$\sigma$"
    assert "time" not in case.about("noise.amplitude").unit
    assert legend({"noise.amplitude": 2.0}, case.about) == "$A$ = 2/s"


def test_a_system_by_matrices_is_written_as_equations(tmp_path: Path) -> None:
    [text] = said(tmp_path, 'title = "plane"\n[system]\nkind = "plane"\nterms = []\n', REDUCED, MOMENTS)
    assert 'system.kind: got "plane"; must be one of vibro-impact, parametric, equations, modes;' in text
    assert 'write the matrices as equations, for example variables = ["x", "v"], drift = ' in text


def test_a_chain_from_a_file(tmp_path: Path) -> None:
    """Its eigenfunctions are strips over φ, one for each state."""
    noise = '[noise]\nkind = "markov-chain"\nstates = [-0.5, 0.5]\nrates = [[-1, 1], [1, -1]]\n'
    path = write(tmp_path, OSCILLATOR, noise, MOMENTS)
    case = load_case(path)
    assert case.noise == MarkovChain.telegraph(0.5, 1.0)
    assert case.oscillator == VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
    assert solved(path, tmp_path / "out")
    assert (tmp_path / "out/kinds/eigenfunctions.pvd").is_file()


@pytest.mark.parametrize(
    ("keys", "values"),
    [
        ("alpha = 0.5\nsigma = 0.5", {"alpha": 0.5, "sigma": 0.5}),
        ("alpha = 0.5\nstandard_deviation = 0.5", {"alpha": 0.5, "standard_deviation": 0.5}),
        ("tau0 = 2.0\nD0 = 0.5", {"D0": 0.5, "tau0": 2.0}),
    ],
)
def test_ornstein_uhlenbeck_noise_is_stated_by_either_pair(
    tmp_path: Path, keys: str, values: Mapping[str, float]
) -> None:
    """All of these are one law; its charts and sensitivities are in the keys that were stated."""
    rest = '[chart]\nzero = ["lyapunov_exponent"]\n'
    rest += f'x = {{ key = "noise.{next(iter(values))}", start = 0.1, stop = 2.0 }}\n'
    rest += 'y = { key = "oscillator.c1", start = 0.1, stop = 0.9 }\n'
    case = load_case(write(tmp_path, OSCILLATOR, f'[noise]\nkind = "ornstein-uhlenbeck"\n{keys}\n', MOMENTS, rest))
    assert case.noise.values == values
    assert case.noise.kind == "ornstein-uhlenbeck"
    assert case.noise.alpha == 0.5  # type: ignore[attr-defined]
    assert case.noise.sigma == pytest.approx(0.5)  # type: ignore[attr-defined]
    assert case.noise.standard_deviation == pytest.approx(0.5)
    assert set(case.problem.differentiable) >= {f"noise.{name}" for name in values}


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("alpha = 0.5", "noise.sigma: missing; must be"),
        ("D0 = 0.5", "noise.tau0: missing; must be"),
        ("standard_deviation = 0.5", "noise.alpha: missing; must be"),
        ("standard_deviation = 0.5\nalpha = 0.0", "noise.alpha: got 0.0; must be a finite number >= 1e-15"),
    ],
)
def test_half_of_a_pair_names_the_other_half(tmp_path: Path, keys: str, words: str) -> None:
    [text] = said(tmp_path, OSCILLATOR, f'[noise]\nkind = "ornstein-uhlenbeck"\n{keys}\n', MOMENTS)
    assert words in text


def test_a_chain_by_rates_with_and_without_their_diagonal(tmp_path: Path) -> None:
    """Row i holds the rates at which state i is left; a telegraph is one of them."""
    chain = '[noise]\nkind = "markov-chain"\nstates = [-0.5, 0.5]\nrates = [[DIAGONAL, 1.0], [1.0, DIAGONAL]]\n'
    found = [load_case(write(tmp_path, OSCILLATOR, chain.replace("DIAGONAL", each), MOMENTS)).noise for each in
             ("0.0", "-1.0")]  # fmt: skip
    assert found[0] == found[1] == MarkovChain.telegraph(0.5, 1.0)
    case = load_case(write(tmp_path, OSCILLATOR, '[noise]\nkind = "telegraph"\na = 0.5\nk = 1.0\n', MOMENTS))
    assert case.noise == Telegraph(a=0.5, k=1.0)
    [text] = said(tmp_path, OSCILLATOR, chain.replace("DIAGONAL", "1.0"), MOMENTS)
    assert "each diagonal entry 0 or minus the sum of its row" in text
