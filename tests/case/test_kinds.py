"""Cases of systems and noises of any kind: plane systems, chains, and a noise that another package registers."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import pytest

from fpsolve.case.case import load_case
from fpsolve.case.vary import legend
from fpsolve.cli import main
from fpsolve.errors import CaseError
from fpsolve.model.kinds import noise_kind, source_of, version_of
from fpsolve.model.noises.markov_chain import MarkovChain, Telegraph
from fpsolve.model.noises.non_gaussian import NonGaussianNoise, ReducedNoise
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.output.records import set_key
from fpsolve.output.tables import facts_of
from fpsolve.simulation.setup import simulated_parts
from fpsolve.workflow.prove import refuse_unprovable_case

OSCILLATOR = """\
title = "kinds"
[oscillator]
omega = 1.0
restitution = 0.8
c1 = 0.1
epsilon = 0.1
"""
PLANE = """\
title = "plane"
[system]
kind = "plane"
damping = 0.1
terms = [
    { matrix = [[0, 1], [-1, 0]] },
    { matrix = [[0, 0], [0, -2]], factor = "damping" },
    { ORDER, matrix = [[0, 0], [-1, 0]], noise = true },
]
"""
MOMENTS = "[moments]\np = [2.0]\n"
ONLY = '[output]\nquantities = ["moment", "lyapunov_exponent"]\n'
MODULE = """\
from typing import Annotated, ClassVar
import math
from pydantic.dataclasses import dataclass
from fpsolve.model.noise import Noise
from fpsolve.model.noises.ornstein_uhlenbeck import GaussianNoise
from fpsolve.model.parameters import SIZE, STRICT, parameter

@dataclass(frozen=True, config=STRICT)
class Wind(GaussianNoise):
    gust: Annotated[float, parameter("size of the gusts", "gust = 0.5", "$g$", "1/time", **SIZE)]
    memory: Annotated[float, parameter("duration of the gusts", "memory = 2.0", "$m$", "time", **SIZE)]

    kind: ClassVar[str] = "wind"

    @property
    def alpha(self):
        return 1 / self.memory

    @property
    def sigma(self):
        return self.gust * math.sqrt(2 / self.memory)

    def derivative(self, name):
        return self.by_logarithms(1 / self.gust, 0.0) if name == "gust" else self.by_logarithms(
            -0.5 / self.memory, -1 / self.memory
        )

class NoNoise:
    kind = "no-noise"
"""
ENTRIES = (
    "[fpsolve.noises]\nwind = windy:Wind\nno-noise = windy:NoNoise\nlost = nowhere:Lost\nou-reduction = windy:Wind\n"
)


@pytest.fixture
def windy(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that registers a noise."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "windy.py").write_text(MODULE, encoding="utf-8")
    about = folder / "windy-1.5.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: windy\nVersion: 1.5\n", encoding="utf-8")
    (about / "entry_points.txt").write_text(ENTRIES, encoding="utf-8")
    monkeypatch.syspath_prepend(str(folder))


REDUCED = "[noise]\nD0 = 1.0\ntau0 = 0.5\nr0 = 0.95\n"
WIND = '[noise]\nkind = "wind"\ngust = 0.5\nmemory = 2.0\n'
UHLENBECK = '[noise]\nkind = "ornstein-uhlenbeck"\nalpha = 0.5\nsigma = 0.5\n'
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


def test_the_system_has_two_names(tmp_path: Path) -> None:
    usual = load_case(write(tmp_path, OSCILLATOR, REDUCED, MOMENTS))
    named = OSCILLATOR.replace("[oscillator]", '[system]\nkind = "vibro-impact"')
    again = load_case(write(tmp_path, named, REDUCED.replace("D0", 'kind = "ou-reduction"\nD0'), MOMENTS))
    assert again.problem == usual.problem == Problem(usual.oscillator, ReducedNoise(D0=1.0, tau0=0.5, r0=0.95))
    assert again.curve({"oscillator.omega": 2.0}).parameters["oscillator.omega"] == 2.0
    exact = load_case(write(tmp_path, OSCILLATOR, REDUCED.replace("D0", 'kind = "non-gaussian"\nD0'), MOMENTS))
    assert exact.noise == NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)
    [text] = said(tmp_path, OSCILLATOR, named.partition("\n")[2], REDUCED, MOMENTS)
    assert text.endswith("oscillator: stands beside [system], but a case has one system; remove one of the two")
    [text] = said(tmp_path, OSCILLATOR, 'kind = "markov-chain"\n', REDUCED, MOMENTS)
    assert text.startswith('7: oscillator.kind: got "markov-chain"; must be one of vibro-impact, plane, ')


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        ('kind = "wond"', '8: noise.kind: got "wond"; must be one of non-gaussian, '),
        ('kind = "wond"', '; did you mean "wind"? write, for example, kind = "non-gaussian"'),
        ("kind = 3", "8: noise.kind: got 3 (a number); must be one of "),
        ('kind = "no-noise"', "must be a subclass of Noise with kind"),
        ('kind = "lost"', 'kind = "lost" of windy cannot be loaded (ModuleNotFoundError'),
        (
            'kind = "wind"\ngust = 1.0',
            "7: noise.memory: missing; must be a finite number >= 1e-15 and <= 1e15 (duration",
        ),
        ('kind = "wind"\ngust = 1.0\nmemry = 1.0', '10: noise.memry: unknown key; did you mean "memory"? known keys: '),
        ('kind = "wind"\ngust = 1.0\nmemory = -1.0', "10: noise.memory: got -1.0; must be a finite number >= 1e-15"),
        ('kind = "ou-reduction"\nD0 = 1.0\ntau0 = 1.0\nr0 = 1.0\ntreatment = "exact"', "12: noise.treatment: unknown"),
        ('kind = "markov-chain"\nstates = [1.0]\nrates = [[1.0]]', "got (1,) states and (1, 1) rates; must be"),
        (
            'kind = "markov-chain"\nstates = 1.0\nrates = [[1.0]]',
            "9: noise.states: got 1.0 (a number); must be a list ",
        ),
        ('kind = "markov-chain"\nstates = [1.0]', "7: noise.rates: missing; must be a list of lists of finite numbers"),
    ],
)
def test_one_message_for_what_is_wrong_with_a_kind(windy: None, tmp_path: Path, noise: str, words: str) -> None:
    [text] = said(tmp_path, OSCILLATOR, f"[noise]\n{noise}\n", MOMENTS, '[vary]\n"noise.x" = [1.0]\n' * ("wo" in noise))
    assert words in text


def test_a_noise_of_another_package(windy: None, tmp_path: Path) -> None:
    """Its keys may be varied, drawn over, and be the axes of a chart; its numbers are those of the same law."""
    rest = '[vary]\n"noise.gust" = [0.5, 1.0]\n[figure]\nx = "noise.gust"\ny = { moment = 2.0 }\n'
    frame = '[chart]\nzero = ["lyapunov_exponent"]\nx = { key = "noise.gust", start = 0.1, stop = 2.0 }\n'
    frame += 'y = { key = "noise.memory", start = 0.1, stop = 9.0 }\n'
    case = load_case(write(tmp_path, OSCILLATOR, WIND, MOMENTS, ONLY, rest, frame))
    kind = type(case.noise)
    assert (kind, version_of(kind)) == (noise_kind("wind"), "windy 1.5")  # type: ignore[arg-type]
    assert case.parameters["noise.gust"].quantity.unit == "1/time"
    values = solved(write(tmp_path, OSCILLATOR, WIND, MOMENTS, ONLY, rest), tmp_path / "out")
    same = write(tmp_path, OSCILLATOR, UHLENBECK, MOMENTS, ONLY, "figure = false\n")
    assert load_case(same).noise == OrnsteinUhlenbeck(alpha=0.5, sigma=0.5)
    [expected] = solved(same, tmp_path / "out2").values()
    assert next(iter(values.values())) == pytest.approx(expected, rel=1e-10)
    text = said(tmp_path, OSCILLATOR, WIND, MOMENTS, rest.replace("noise.gust", "noise.D0"))[0]
    assert text.startswith('14: vary."noise.D0": cannot be varied; ')
    assert "noise.gust, noise.memory" in text
    text = said(tmp_path, OSCILLATOR, WIND, MOMENTS, frame.replace("noise.gust", "noise.D0"))[0]
    assert text.startswith('15: chart.x.key: got "noise.D0"; did you mean "noise.gust"? must be one of ')


def test_records_depend_on_the_kind_and_its_version(
    windy: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = set()
    for version in ("windy 1.5", "windy 1.6"):
        monkeypatch.setattr("fpsolve.model.problem.version_of", lambda _, version=version: version)
        case = load_case(write(tmp_path, OSCILLATOR, WIND, MOMENTS))
        keys.add(set_key(case.curve({})))
    assert len(keys) == 2


def test_records_depend_on_the_file_of_a_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A noise that is corrected without a new version, itself or its base, is solved anew."""
    monkeypatch.syspath_prepend(tmp_path)
    base, own = tmp_path / "breeze.py", tmp_path / "squall.py"
    base.write_text("from fpsolve import OrnsteinUhlenbeck\n\nclass Breeze(OrnsteinUhlenbeck):\n    pass\n")
    own.write_text("from breeze import Breeze\n\nclass Squall(Breeze):\n    pass\n")
    kind = importlib.import_module("squall").Squall
    found = [source_of(kind)]
    for file in (own, base):
        file.write_text(file.read_text() + "    half = 0.5\n")
        found.append(source_of(kind))
    assert len({"", *found}) == 4
    assert source_of(kind) == found[-1]
    assert source_of(OrnsteinUhlenbeck) == ""  # type: ignore[arg-type]


def test_records_of_a_changed_kind_are_others(windy: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = set()
    for source in ("a", "b"):
        monkeypatch.setattr("fpsolve.model.problem.source_of", lambda _, source=source: source)
        case = load_case(write(tmp_path, OSCILLATOR, WIND, MOMENTS))
        keys.add(set_key(case.curve({})))
    assert len(keys) == 2
    assert facts_of(case, datetime.now(UTC), 0.0)["versions"]["windy"] == "1.5"


def test_figures_speak_of_the_parameters_of_the_case(tmp_path: Path) -> None:
    """Two kinds may have a parameter of one name."""
    case = load_case(write(tmp_path, OSCILLATOR, SINE, MOMENTS, '[units]\ntime = "s"\n'))
    quantities = {key: each.quantity for key, each in case.parameters.items()}
    assert case.about("noise.sigma").latex == quantities["noise.sigma"].latex == r"$\sigma$"
    assert "time" not in case.about("noise.amplitude").unit
    assert legend({"noise.amplitude": 2.0}, case.about) == "$A$ = 2/s"


def test_check_tells_the_faults_of_a_kind_of_others(
    windy: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run keeps Λ, and has no sensitivities where the derivative is wrong."""
    path = write(tmp_path, OSCILLATOR, WIND, MOMENTS, '[output]\nquantities = ["moment", "sensitivities"]\n')
    assert main(["check", str(path)]) == 0
    kind = noise_kind("wind")
    right = kind.derivative
    monkeypatch.setattr(kind, "derivative", lambda self, name: right(self, "gust"))
    capsys.readouterr()
    assert main(["check", str(path)]) == 1
    said = capsys.readouterr().err
    assert 'kinds: derivative("memory").log_diffusion at xi = -' in said
    assert solved(path, tmp_path / "out")
    [curve] = json.loads((tmp_path / "out/kinds/summary.json").read_text(encoding="utf-8"))["curves"]
    assert any(each.startswith("no sensitivities under wind noise: derivative") for each in curve["warnings"])


def test_ours_cannot_be_replaced(windy: None) -> None:
    assert noise_kind("ou-reduction") is ReducedNoise
    assert version_of(ReducedNoise) == ""  # type: ignore[arg-type]


@pytest.mark.parametrize(("order", "has_theory"), [("order = 1", True), ("order = 0", False)])
def test_a_plane_system_from_a_file(tmp_path: Path, order: str, has_theory: bool) -> None:
    """ẍ + 0.2ẋ + (1 + ξ)x = 0 under sine-Wiener noise, against the moment hierarchy; noise of order 0 has no theory."""
    rest = '[vary]\n"system.damping" = [0.1, 0.2]\n'
    path = write(tmp_path, PLANE.replace("ORDER", order), SINE, MOMENTS, ONLY, rest)
    first, second = solved(path, tmp_path / "out").values()
    assert first == pytest.approx(-0.0773243898649, abs=1e-10)
    assert second < first
    summary = json.loads((tmp_path / "out/kinds/summary.json").read_text(encoding="utf-8"))
    assert (summary["curves"][0]["moments"][0]["moment_perturbation"] is not None) == has_theory
    case = load_case(path)
    refuse_unprovable_case(case, None)  # it can be proven, and simulated
    assert simulated_parts(case.problem)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("noise = true", "nois = true", 'system.terms[2].nois: unknown key; did you mean "noise"?'),
        ("damping = 0.1", "damping = true", "got damping = True; must be a finite number"),
        ("damping = 0.1", "stiffness = 0.1", "got values of ['stiffness']; must be of ['damping']"),
        ("[[0, 1], [-1, 0]]", "[[0, 1], [-1]]", "system.terms[0].matrix[1][1]: missing"),
        ("terms =", "term =", "system.terms: missing; must be a non-empty list of tables with the keys matrix"),
    ],
)
def test_what_is_wrong_with_a_plane_system(tmp_path: Path, old: str, new: str, words: str) -> None:
    texts = said(tmp_path, PLANE.replace("ORDER", "order = 1").replace(old, new), REDUCED, MOMENTS)
    assert any(words in text for text in texts)


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
