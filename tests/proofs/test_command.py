"""`fpsolve prove`: what it writes and says, its exit codes, and that what is proven holds."""

import json
import math
import os
import re
import shutil
import signal
import sys
import time
from dataclasses import replace

import pytest

import fpsolve
from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT, NOT_CONVERGED
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.output.records import Records, append
from fpsolve.page.terminal import print_blocks
from fpsolve.proofs import Certificate, Enclosure
from fpsolve.workflow import prove as command
from fpsolve.workflow.prove import CurveProof, Plan, check_proof, prove_case, show
from tests.conftest import sampled, started
from tests.kit import case_in, read_json
from tests.oracles import fourier_hermite
from tests.proofs.case import CASE

MOMENTS = CASE + '[output]\nquantities = ["moment"]\nfigure = false\n'
LOOSE = ["--width", "0.01"]


@pytest.fixture
def case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "proven.toml"
    path.write_text(MOMENTS, encoding="utf-8")
    return str(path)


@pytest.fixture
def no_proving(monkeypatch):
    """Nothing is proven in less than no time."""
    monkeypatch.setattr("fpsolve.proofs.questions.ExponentSolver", lambda *_, **__: pytest.fail("proves"))


def read(folder):
    return read_json(folder / "results/proven/proof.json")


def test_bounds_and_verdicts_are_told_and_written(case, tmp_path, capsys):
    assert main(["prove", case, *LOOSE]) == 0
    out, err = capsys.readouterr()
    assert not err
    assert re.search(r"│ +Λ\(0\) │ +0 │ +0 │ +0 │ +is constant │", out)
    assert "Proven: the moment of order 2 grows." in out
    assert "λ" not in out
    assert re.search(r"written: results/proven \(1 curve, [\d.]+ s\)", out)
    proof = read(tmp_path)
    assert set(proof) == {"fpsolve", "case", "complete", "curves"}
    assert proof["complete"] is True
    (curve,) = proof["curves"]
    assert set(curve) == {"parameters", "moments", "lyapunov_exponent", "stability_index", "verdicts"}
    assert curve["lyapunov_exponent"] is curve["stability_index"] is None
    zero, second = curve["moments"]
    assert [zero[key] for key in ("p", "lower", "upper")] == [0.0, 0.0, 0.0]
    assert 0 < second["upper"] - second["lower"] <= 0.01
    (solved,) = fpsolve.moment_lyapunov(next(load_case(case).curves()).problem, [2.0]).value
    assert second["lower"] < solved < second["upper"]
    assert main(["prove", "--check", "results/proven/proof.json"]) == 0


@pytest.mark.slow
def test_several_processes_write_the_same_file(case, tmp_path):
    varied = ["--set", 'vary."noise.D0"=[0.5, 1.0]', *LOOSE, "--quiet"]
    assert main(["prove", case, *varied, "--jobs", "1"]) == 0
    assert main(["prove", case, *varied, "--jobs", "2", "--out", "others"]) == 0
    first, second = (tmp_path / name / "proven/proof.json" for name in ("results", "others"))
    assert first.read_bytes() == second.read_bytes()
    assert [curve["parameters"]["noise.D0"] for curve in read(tmp_path)["curves"]] == [0.5, 1.0]


@pytest.mark.slow
def test_a_width_that_is_not_met_is_told_and_the_bounds_are_kept(case, tmp_path, capsys):
    weak = ["oscillator.epsilon=0.05", "noise.D0=0.1", "moments.p=[1.0]"]
    assert main(["prove", case, "--width", "1e-30", *(f"--set={each}" for each in weak), "--quiet"]) == NOT_CONVERGED
    assert "(1 curve, 1 not as close as wanted, " in capsys.readouterr().out
    (moment,) = read(tmp_path)["curves"][0]["moments"]
    assert moment["lower"] < moment["upper"]
    assert moment["upper"] - moment["lower"] > 1e-30


@pytest.mark.usefixtures("no_proving")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--width", "0"], "--width: got width = 0.0; must be a positive number"),
        (["--width=-1"], "--width: got width = -1.0; must be a positive number"),
        (["--width", "nan"], "--width: got width = nan; must be a positive number"),
        (["--width", "inf"], "--width: got width = inf; must be a positive number"),
        (["--width", "small"], 'unable to convert "small" into float'),
        (["--jobs", "0"], "got 0; must be a whole number"),
        (["--check", "proof.json"], "name either cases to prove, or with --check a proof.json"),
        (["--out", "proven.toml"], "cannot be made"),
        (["proven.toml"], 'several cases are called "proven"'),
        (["--set", 'vary."noise.r0"=[0.9,1.5]', "--set", "noise.treatment=exact"], "algebraic tails"),
    ],
)
def test_bad_input_is_refused_before_anything_is_written(case, tmp_path, capsys, arguments, words):
    assert main(["prove", case, *arguments]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert words in " ".join(err.split())
    assert not out
    assert [path.name for path in tmp_path.iterdir()] == ["proven.toml"]


@pytest.mark.usefixtures("no_proving")
@pytest.mark.parametrize("r0", ["1.5", "1.0000000001"])
def test_algebraic_tails_are_refused_also_where_the_moments_are_finite(case, tmp_path, capsys, r0):
    tails = [f"--set=noise.r0={r0}", "--set=noise.treatment=exact", "--set=moments.p=[-0.5]"]
    assert main(["prove", case, *tails]) == BAD_INPUT
    err = capsys.readouterr().err
    assert "has algebraic tails" in err
    assert "choose r0 <= 1" in err
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name either cases to prove, or with --check a proof.json"),
        (["--check", "nothing.json"], "nothing.json: no such file"),
        (["--check", "."], ".: is a directory; name a proof in it, such as proof.json"),
        (["--check", os.devnull], "is a pipe or a device"),
        (["--check", "a.json", "--width", "1"], "--check takes a proof.json and nothing else"),
        (["--check", "a.json", "--set", "noise.D0=1.0"], "--check takes a proof.json and nothing else"),
        (["--check", "a.json", "--jobs", "2"], "--check takes a proof.json and nothing else"),
        (["--check", "a.json", "--out", "other"], "--check takes a proof.json and nothing else"),
    ],
)
def test_what_cannot_be_checked(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["prove", *arguments]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert words in err
    assert not out
    assert err.count("\n") == 1


def test_without_flint_the_package_to_install_is_named(case, tmp_path, monkeypatch, capsys):
    assert main(["prove", case, *LOOSE, "--quiet"]) == 0
    kept = (tmp_path / "results/proven/proof.json").rename(tmp_path / "kept.json")
    capsys.readouterr()
    monkeypatch.setitem(sys.modules, "flint", None)
    for arguments in ([case, "--out", "others"], ["--check", str(kept)]):
        assert main(["prove", *arguments]) == BAD_INPUT
        out, err = capsys.readouterr()
        assert err == "proofs need python-flint; install it with: pip install 'fpsolve[proof]'\n"
        assert not out
    assert not (tmp_path / "others").exists()


@pytest.mark.slow
def test_a_folder_holds_proofs_of_its_parameters_only(case, tmp_path):
    proof = tmp_path / "results/proven/proof.json"
    shorter = ["--quiet", "--set", "moments.p=[1.0]"]
    assert main(["prove", case, *LOOSE, "--quiet"]) == 0
    before = proof.read_bytes()
    assert main(["run", case, *shorter]) == 0
    assert proof.read_bytes() == before
    assert main(["run", case, *shorter, "--set", "noise.D0=0.9"]) == 0
    assert not proof.exists()
    assert main(["prove", case, *LOOSE, "--quiet"]) == 0
    assert not (proof.parent / "summary.json").exists()
    assert read(tmp_path)["curves"][0]["parameters"]["noise.D0"] == 1.0


def test_p_of_a_range_is_the_float_as_it_stands(case):
    plan = Plan(load_case(case, ["moments.p={start=-0.1, stop=0.5, num=4}"]), None)
    assert [each.args[2] for each in plan.questions()] == plan.case.p.tolist()


def enclosure(lower, upper, p):
    """Bounds that are as good as proven."""
    return Enclosure(lower, upper, Certificate.model_construct(p=p))


def proofs(case, count, orders):
    """Of several curves, the moment of order p being bounded by p ± 1/4, and λ by ± 1/8."""
    loaded = load_case(case, [f'vary."noise.D0"={json.dumps([1.0 + i for i in range(count)])}'])
    moments = tuple((p, enclosure(p - 0.25, p + 0.25, p)) for p in orders)
    return loaded, [
        CurveProof(replace(each, number=1), moments, enclosure(-0.125, 0.125, None)) for each in loaded.curves()
    ]


def test_the_sentence_tells_few_moments_and_counts_many(case, capsys):
    few, many = [-1.0, 2.0000001], [float(n) for n in range(-1, 30)]
    print_blocks(show(*proofs(case, 1, few)))
    out = capsys.readouterr().out
    assert "Proven: the moment of order -1 decays; the moment of order 2.0000001 grows.\n" in out
    assert "│ Λ(2.0000001) │" in out
    print_blocks(show(*proofs(case, 1, many)))
    assert "Proven: of 31 moments 29 grow, 1 decays.\n" in capsys.readouterr().out


def test_many_curves_have_a_row_each(case, capsys):
    print_blocks(show(*proofs(case, 11, [-1.0, 2.5])))
    out = capsys.readouterr().out
    heading = next(line for line in out.splitlines() if "proven" in line)
    assert re.sub(r"[┃ ]+", " ", heading).split() == ["D0", "proven", "λ", "paths", "p", "=", "-1", "p", "=", "2.5"]
    assert len(re.findall(r"2 of 2 │ in \[-0\.13, 0\.13\] │ +open │ decays │ +grows", out)) == 11


CODE = "from fpsolve.cli import main; print('begun', flush=True); raise SystemExit(main())"


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(("kind", "code"), sampled((signal.SIGINT, 130), (signal.SIGTERM, 143)))
def test_what_an_interrupted_run_has_proven_is_kept(case, tmp_path, kind, code):
    """Of p = 0, which needs no time, and another, which takes longer than anybody waits."""
    slow = CODE.replace(
        "print(",
        "import fpsolve.proofs.questions as questions, time; "
        "questions.ExponentSolver = lambda *_, **__: (print('slow', flush=True), time.sleep(60)); print(",
    )
    process = started(slow, "prove", case, "--jobs", "1")
    assert [process.stdout.readline() for _ in range(2)] == ["begun\n", "slow\n"]
    time.sleep(0.1)
    process.send_signal(kind)
    _, said = process.communicate(timeout=30)
    assert process.returncode == code
    assert "interrupted after 1 of 2 bounds; what was done is kept in results/proven" in said
    proof = read(tmp_path)
    assert proof["complete"] is False
    zero, second = proof["curves"][0]["moments"]
    assert zero["certificate"] is not None
    assert second == {"p": 2.0, "lower": None, "upper": None, "certificate": None}
    assert main(["prove", "--check", "results/proven/proof.json"]) == 0


def forged(record):
    """Closer bounds than follow."""
    record["enclosure"]["upper"] -= 1e-3


def noting(asked, most=None):
    """`prove_bounds` that notes each p it is asked for, up to so many: then comes an interrupt."""
    prove_one = command.prove_bounds

    def prove_bounds(problem, stated, p, width, *, budget):
        if len(asked) == most:
            raise KeyboardInterrupt
        asked.append(p)
        return prove_one(problem, stated, p, width, budget=budget)

    return prove_bounds


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """A folder with a case whose run was interrupted after two bounds, and the case."""
    folder, asked = tmp_path_factory.mktemp("interrupted"), []
    sets = ["moments.p=[0.0, 1.0, 2.0]", "output={ quantities = ['moment', 'lyapunov_exponent'] }", "figure.mark=[]"]
    case = case_in(folder, MOMENTS, sets, "proven")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "prove_bounds", noting(asked, 2))
        with pytest.raises(KeyboardInterrupt, match="run it again to go on"):
            prove_case(case, folder, width=1e-2)
    assert asked == [0.0, 1.0]
    return folder, case


@pytest.mark.slow
@pytest.mark.parametrize("change", [None, forged, lambda record: record.clear()])
def test_an_interrupted_run_goes_on_with_the_bounds_that_follow(interrupted, tmp_path, monkeypatch, change):
    """What is proven is not proven again, but verified; δ_p and what was forged are."""
    (folder, case), asked = interrupted, []
    shutil.copytree(folder / "proven", tmp_path / "proven")
    if change is not None:
        [path] = (tmp_path / "proven/records/proven").glob("*.jsonl")
        records = Records(path.parent).look()
        places = [(key, records.read(place)) for key, (*_, place) in records._addresses.items()]
        for key, record in places:
            change(record)
            append(path.parent, key, record)
    monkeypatch.setattr(command, "prove_bounds", noting(asked))
    [proof] = prove_case(case, tmp_path, width=1e-2)
    assert asked == ([2.0, None] if change is None else [0.0, 1.0, 2.0, None])
    assert all(found.is_proven for _, found in proof.moments)
    assert proof.exponent.is_proven
    assert not check_proof(tmp_path / "proven/proof.json").objections


ORACLE = VibroImpactOscillator(omega=1.3, restitution=1.0, c1=-0.2, epsilon=0.6)
ORACLE_NOISE = NonGaussianNoise(D0=0.7, tau0=0.4, r0=0.5)


def second_moment(treatment, count=40):
    """Λ(2) without loss: 1, cos 2φ and sin 2φ carry it, so that with polynomials of the noise moments close."""
    D0, tau0, r0 = ORACLE_NOISE.D0, ORACLE_NOISE.tau0, ORACLE_NOISE.r0
    motion = {name: getattr(ORACLE, name) for name in ("omega", "epsilon", "c1")}
    motion |= {"log_R": 0.0, "p": 2.0, "harmonics": 1}
    if treatment == "exact":
        return fourier_hermite.moment_lyapunov_bounded_noise(D0=D0, tau0=tau0, r0=r0, gegenbauer=count, **motion)
    alpha, sigma = (5 - 3 * r0) / (2 * (2 - r0) * tau0), math.sqrt(2 * D0) / tau0
    return fourier_hermite.moment_lyapunov(alpha=alpha, sigma=sigma, hermite=count, **motion)


@pytest.mark.slow
@pytest.mark.parametrize(("treatment", "error"), [("exact", 1e-10), ("ou-reduction", 1e-13)])
def test_the_moment_hierarchy_lies_within_the_bounds(case, tmp_path, treatment, error):
    value = second_moment(treatment)
    assert abs(value - second_moment(treatment, 30)) < 0.1 * error
    names = {name: getattr(ORACLE, name) for name in ("omega", "restitution", "c1", "epsilon")}
    sets = [f"--set=oscillator.{name}={number}" for name, number in names.items()]
    sets += [f"--set=noise.{name}={getattr(ORACLE_NOISE, name)}" for name in ("D0", "tau0", "r0")]
    sets += [f"--set=noise.treatment={treatment}", "--set=moments.p=[2.0]", "--quiet"]
    assert main(["prove", case, *sets]) == 0
    (moment,) = read(tmp_path)["curves"][0]["moments"]
    assert moment["lower"] < value - error < value + error < moment["upper"]
    assert moment["upper"] - moment["lower"] < 1e-6


@pytest.mark.slow
def test_curves_that_are_done_are_written_before_the_end(case, monkeypatch):
    """So that a run that is killed keeps them."""
    kept = []

    def write(case, proofs, folder, *, is_whole):
        kept.append((len(proofs), is_whole))

    monkeypatch.setattr("fpsolve.workflow.prove.EVERY", 0.0)
    monkeypatch.setattr("fpsolve.workflow.prove.write_proof", write)
    overrides = [
        "--set=vary.noise.r0=[0.9,0.95]",
        "--set=moments.p=[1.0]",
        '--set=output.quantities=["moment"]',
        "--quiet",
    ]
    assert main(["prove", case, *LOOSE, *overrides]) == 0
    assert kept == [(1, False), (2, True), (2, True)]
