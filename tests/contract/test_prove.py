"""`fpsolve prove`: what it writes and says, and which claims of a file it accepts, rejects and refuses to read."""

import copy
import json
import math
import os
import re
import signal
import sys
import time

import pytest

from fpsolve import load_case, moment_lyapunov
from tests.conftest import sampled, started
from tests.kit import case_text, read_json, run
from tests.oracles import certificate_checker

REJECTED, REFUSED, NOT_CONVERGED = 1, 2, 3
SYSTEM = """
title = "beam"
[system]
variables = ["x", "v"]
drift = ["v", "-omega**2 * x - 2*zeta*omega * v - load * x"]
parameters = { omega = 1.0, zeta = 0.05 }
noises = { load = "noise.axial" }
walls = [{ at = "x = 0", restitution = 0.8 }]
[noise.axial]
kind = "telegraph"
a = 0.5
k = 1.0
[moments]
p = [0.0, 2.0]
[output]
quantities = ["moment", "lyapunov_exponent"]
"""
GAUSSIAN = case_text('[moments]\np = [0.0, 2.0]\n[output]\nquantities = ["moment"]\nfigure = false\n', "Proofs")
LOOSE = "--width", "0.01"


def proof_in(folder):
    return folder / "results/case/proof.json"


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    """A run of `fpsolve prove` of a beam."""
    return run(tmp_path_factory.mktemp("proven"), "prove", "case.toml", "--width", "1e-3", case=SYSTEM)


@pytest.fixture
def data(proven):
    """Its proof, to be changed."""
    return read_json(proof_in(proven.folder))


def check(folder, data):
    """`fpsolve prove --check` of a file of these data, or of this text."""
    text = data if isinstance(data, str | bytes) else json.dumps(data)
    return run(folder, "prove", "--check", "a.json", **{"a.json": text})


def objections(folder, data):
    """What it says of claims that do not follow."""
    checked = check(folder, data)
    assert checked.code in (0, REJECTED), checked.err
    return [line.removeprefix("a.json: ") for line in checked.err.splitlines()]


def test_bounds_and_verdicts_of_a_case_are_told_written_and_accepted(proven, data, tmp_path):
    assert (proven.code, proven.err) == (0, "")
    assert re.search(r"│ +Λ\(0\) │ +0 │ +0 │ +0 │ +is constant │", proven.out)
    assert "Proven: almost every path decays; the moment of order 2 decays." in proven.out
    assert re.search(r"written: results/case \(1 parameter set, [\d.]+ s\)", proven.out)
    assert set(data) == {"fpsolve", "case", "complete", "sets"}
    assert data["complete"] is True
    (parameter_set,) = data["sets"]
    assert set(parameter_set) == {"parameters", "moments", "lyapunov_exponent", "stability_index", "verdicts"}
    assert parameter_set["parameters"]["system.zeta"] == 0.05
    assert parameter_set["stability_index"] is None
    assert parameter_set["verdicts"] == ["almost every path decays", "the moment of order 2 decays"]
    zero, second = parameter_set["moments"]
    assert [zero[key] for key in ("p", "lower", "upper")] == [0.0, 0.0, 0.0]
    assert second["upper"] - second["lower"] <= 1e-3
    (solved,) = moment_lyapunov(next(load_case(proven.folder / "case.toml").sets()).problem, [2.0]).value
    assert second["lower"] < solved < second["upper"]
    entries = [zero, second, {**parameter_set["lyapunov_exponent"], "p": None}]
    assert [certificate_checker.check(each) for each in entries] == 3 * [""]
    accepted, note = check(tmp_path, data).out.splitlines()
    assert accepted == "accepted: a.json (bounds on 3 numbers follow from their certificates)"
    assert note == ("note: the parameters are labels; the bounds hold for the matrices and rates in the certificates")


def set_moment(**change):
    """A claim of Λ(2) and its certificate; a number is moved by so many times the distance of the bounds."""

    def changed(parameter_set):
        moment = parameter_set["moments"][1]
        size = moment["upper"] - moment["lower"]
        moment.update({key: moment[key] + by * size if isinstance(by, float) else by for key, by in change.items()})

    return changed


def put(*places):
    """A change of what stands at a place of a parameter set."""
    *above, last, value = places

    def changed(parameter_set):
        for place in above:
            parameter_set = parameter_set[place]
        parameter_set[last] = value

    return changed


def of_other_p(parameter_set):
    zero, second = parameter_set["moments"]
    exponent = parameter_set["lyapunov_exponent"]
    parameter_set.update(verdicts=[], moments=[zero | {"p": 2.0}, exponent | {"p": 2.0}])
    parameter_set["lyapunov_exponent"] = {name: value for name, value in second.items() if name != "p"}


def of_other_system(parameter_set):
    parameter_set["moments"][0] = json.loads(json.dumps(parameter_set["moments"][0]).replace("-0.1]", "-0.2]"))


def one_sided(parameter_set):
    parameter_set["moments"][1]["certificate"]["upper"] = None


def open_above(parameter_set):
    one_sided(parameter_set)
    parameter_set["moments"][1]["upper"] = None


BOUNDS = "moments.0", "moments.1", "lyapunov_exponent"
CLOSER = ["moments.1: the bounds are closer than those of the certificate"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_moment(lower=-1e9, upper=0.5), []),
        (set_moment(lower=0.1), CLOSER),
        (set_moment(upper=-0.1), CLOSER),
        (set_moment(lower=1.0, upper=-1.0), CLOSER),
        (put("lyapunov_exponent", "upper", -0.2), [CLOSER[0].replace("moments.1", "lyapunov_exponent")]),
        (set_moment(lower=None), []),
        (set_moment(certificate=None), ["moments.1: there is no certificate"]),
        (one_sided, CLOSER),
        (open_above, ["verdicts: 'the moment of order 2 decays' does not follow"]),
        (of_other_p, [f"{place}: the certificate is of another p" for place in BOUNDS]),
        (of_other_system, ["its certificates are of several systems"]),
        (put("parameters", "system.omega", 2.0), []),
        *(
            (put("verdicts", [text]), [f"verdicts: {text!r} does not follow"])
            for text in (
                "almost every path grows",
                "the moment of order 2 grows",
                "the moment of order 3 decays",
                "well",
            )
        ),
        (put("lyapunov_exponent", None), ["verdicts: 'almost every path decays' does not follow"]),
        (put("moments", 1, "certificate", "mu", -0.2), None),
        (put("moments", 1, "certificate", "cosine", 1, 0, 9.0), None),
    ],
)
def test_claims_of_a_file_are_accepted_only_where_they_follow(data, tmp_path, change, words):
    """None is any objection."""
    change(data["sets"][0])
    found = objections(tmp_path, data)
    assert found if words is None else found == [f"sets.0.{each}" for each in words]


LOW, HIGH = ({"p": p, "lower": v, "upper": v + 0.1, "certificate": None} for p, v in ((-1.2, 0.1), (-1.0, -0.2)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, ""),
        ({"moments": [HIGH, LOW]}, "does not change its sign"),
        ({"moments": [LOW, LOW]}, "does not change its sign"),
        ({"moments": [LOW | {"lower": -1.0}, HIGH]}, "does not change its sign"),
        ({"moments": [LOW, HIGH | {"p": 1.0}]}, "does not change its sign"),
        ({"moments": [LOW]}, "needs both bounds"),
        ({"moments": [LOW, HIGH, HIGH]}, "needs both bounds"),
        ({"moments": []}, "needs both bounds"),
        ({"lower": None}, "needs both bounds"),
        ({"lower": -1.1}, "closer than the two p"),
        ({"upper": -1.2}, "closer than the two p"),
    ],
)
def test_a_stability_index_needs_a_change_of_sign_between_two_p_of_one_sign(data, tmp_path, change, words):
    """Each Λ is without a certificate here, of which the objections tell, too."""
    index = {"lower": -1.2, "upper": -1.0, "moments": [LOW, HIGH]} | change
    data["sets"] = [{**data["sets"][0], "moments": [], "lyapunov_exponent": None, "verdicts": []}]
    data["sets"][0]["stability_index"] = index
    found = [text for text in objections(tmp_path, data) if "there is no certificate" not in text]
    assert words in found[0] if words else not found


RESTING = {
    "p": 1.5,
    "stated": {
        "still": [[0.0, 1.3], [-1.3, 0.0]],
        "driven": [[0.0, 0.0], [0.0, 0.0]],
        "jumps": [{"ray": [0.0, -1.0], "log_factor": 0.0}],
        "coordinates": [[1.0, 0.0], [0.0, 1.0]],
        "noise": {"kind": "gaussian", "unit": 0.5, "nu": 3.4, "slope": 0.5, "states": [], "rates": []},
    },
    "mu": 0.0,
    "phases": 64,
    "basis": {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0},
    "cosine": [[1.0, 0.0]],
    "sine": [[0.0, 0.0]],
    **{
        side: {"delta": 1e-12, "nodes": [-0.5, 0.75], "values": [-1e-59, 1e-59], "tails": [-1e-60, 1e-60]}
        for side in ("upper", "lower")
    },
}
"""Λ(1.5) = 0 of an oscillator without damping, noise and loss, by hand: u = 1."""


def by_hand(change):
    """A proof of this certificate with changes, of both of its sides where they have them."""
    certificate = copy.deepcopy(RESTING)
    for key, value in change.items():
        for part in (certificate["upper"], certificate["lower"]) if key in certificate["upper"] else (certificate,):
            part[key] = value
    moment = {"p": 1.5, "lower": -1e-9, "upper": 1e-9, "certificate": certificate}
    parameter_set = {"parameters": {}, "moments": [moment], "lyapunov_exponent": None, "stability_index": None}
    return {"fpsolve": "0", "case": "a", "complete": True, "sets": [{**parameter_set, "verdicts": []}]}


POSITIVE = "u > 0 is not certain"
OVERFLOWN = f"{POSITIVE}|is not made up for|does not serve beyond"


def core(**more):
    return {"basis": {**RESTING["basis"], **more}}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, ""),
        ({"mu": 9e-10, "delta": 1e-11}, "is not made up for"),
        ({"cosine": [[1e308] * 5] * 5, "sine": [[1e308] * 5] * 5}, POSITIVE),
        ({"cosine": [[0.0, 0.0]]}, POSITIVE),
        ({"cosine": [[-1.0, 0.0]]}, POSITIVE),
        ({"cosine": [[1.0, 0.01]]}, "is not made up for"),
        (core(centre=1e308), OVERFLOWN),
        (core(scale=5e-324), OVERFLOWN),
        (core(gauge=-1e308), OVERFLOWN),
        ({"tails": [-1e308, 1e308]}, "does not serve beyond"),
        ({"tails": [1e-60, -1e-60]}, "does not serve beyond"),
    ],
    ids=str,
)
def test_certificates_written_by_hand_are_accepted_only_where_they_prove(tmp_path, change, words):
    """Numbers that overflow prove nothing."""
    found = objections(tmp_path, by_hand(change))
    assert re.search(words, found[0]) if words else not found


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nodes": [0.0, -1.0], "values": [0.0, 0.0]}, "nodes must increase"),
        ({"nodes": [0.0, 0.0], "values": [0.0, 0.0]}, "nodes must increase"),
        ({"values": [0.0]}, "one of values for each"),
        ({"cosine": [[1.0]]}, "tables of one shape"),
        ({"cosine": [[1.0, 2.0], [1.0]], "sine": [[1.0, 2.0], [1.0]]}, "tables of one shape"),
        ({"cosine": [], "sine": []}, "should have at least 1 item"),
        ({"phases": 0}, "should be greater than 0"),
        ({"tails": None}, "a core has tails"),
        ({"tails": None, "basis": {"kind": "whole"}}, "the basis whole is of other noise"),
        ({"delta": -1e-9}, "should be greater than or equal to 0"),
        ({"stated": {}}, "Field required"),
        *(({"mu": number}, "mu: Input should be a") for number in (True, [], "1.0", math.nan, -math.inf)),
    ],
)
def test_certificates_whose_parts_do_not_fit_together_are_malformed(tmp_path, change, words):
    checked = check(tmp_path, by_hand(change))
    assert checked.code == REFUSED
    assert words in checked.err
    assert len(checked.err) < 300


def test_keys_that_are_missing_or_too_many_make_a_proof_malformed(data, tmp_path):
    for path in ((), ("sets", 0), ("sets", 0, "moments", 1), ("sets", 0, "moments", 1, "certificate")):
        table = data
        for part in path:
            table = table[part]
        for name in [*table, "more"]:
            before = dict(table)
            if name in table:
                del table[name]
            else:
                table[name] = 1
            checked = check(tmp_path, data)
            assert checked.code == REFUSED
            assert re.search(r"Field required|not permitted|nothing else has", checked.err)
            table.clear()
            table.update(before)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"\0\1", "is binary"),
        (b'{"a": "\xff"}', "is not UTF-8"),
        *((text, "should be a valid dictionary") for text in (b"[]", b"1", b"null", b"true", b'"a"')),
        *((text, "is no JSON") for text in (b"{", b"title = 1")),
        (b"{}", "Field required"),
        (b'{"fpsolve": "0", "case": "a", "complete": true, "sets": []}', "at least 1 item"),
        (b'{"fpsolve": "0", "case": 1e999999999, "complete": true, "sets": []}', "case: "),
    ],
)
def test_files_that_are_no_proof_are_refused_in_one_line(tmp_path, content, words):
    checked = check(tmp_path, content)
    assert (checked.code, checked.out, checked.err.count("\n")) == (REFUSED, "", 1)
    assert checked.err.startswith("a.json: ")
    assert words in checked.err
    assert "make one with `fpsolve prove`" in checked.err or "save it as UTF-8" in checked.err


def test_the_check_tells_how_many_bounds_follow_and_what_does_not(tmp_path):
    proof = by_hand({})
    assert check(tmp_path, proof).out.startswith(
        "accepted: a.json (bounds on 1 number follow from their certificates)\n"
    )
    told = check(tmp_path, proof | {"complete": False})
    assert "certificates; the run that proved them was interrupted)\n" in told.out
    proof["sets"][0]["moments"][0]["upper"] = 0.0
    told = check(tmp_path, proof)
    assert (told.code, told.out) == (REJECTED, "rejected: a.json (1 objection, bounds on 1 number)\n")
    assert told.err == "a.json: sets.0.moments.0: the bounds are closer than those of the certificate\n"


TAILS = "--set", "noise.treatment=exact", "--set", "moments.p=[-0.5]"
NOTHING_ELSE = "--check takes a proof.json and no other option"


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
        (["--out", "case.toml"], "cannot be made"),
        (["case.toml"], 'several cases are called "case"'),
        (["--set", 'vary."noise.r0"=[0.9,1.5]', *TAILS], "algebraic tails"),
        (["--set", "noise.r0=1.5", *TAILS], "choose r0 <= 1"),
        (["--set", "noise.r0=1.0000000001", *TAILS], "has algebraic tails"),
    ],
)
def test_cases_that_cannot_be_proven_are_refused_before_anything_is_written(tmp_path, arguments, words):
    done = run(tmp_path, "prove", "case.toml", *arguments, case=GAUSSIAN)
    assert (done.code, done.out) == (REFUSED, "")
    assert words in " ".join(done.err.split())
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name either cases to prove, or with --check a proof.json"),
        (["--check", "nothing.json"], "nothing.json: no such file"),
        (["--check", "."], ".: is a directory; name a proof in it, such as proof.json"),
        (["--check", os.devnull], "is a pipe or a device"),
        (["--check", "a.json", "--width", "1"], NOTHING_ELSE),
        (["--check", "a.json", "--set", "noise.D0=1.0"], NOTHING_ELSE),
        (["--check", "a.json", "--jobs", "2"], NOTHING_ELSE),
        (["--check", "a.json", "--out", "other"], NOTHING_ELSE),
    ],
)
def test_arguments_that_name_no_proof_to_check_are_refused(tmp_path, arguments, words):
    done = run(tmp_path, "prove", *arguments)
    assert (done.code, done.out, done.err.count("\n")) == (REFUSED, "", 1)
    assert words in done.err


def test_without_flint_the_package_to_install_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "flint", None)
    proof = {"a.json": json.dumps(by_hand({}))}
    for arguments in (["case.toml"], ["--check", "a.json"]):
        done = run(tmp_path, "prove", *arguments, case=SYSTEM, **proof)
        assert (done.code, done.out) == (REFUSED, "")
        assert done.err == "proofs need python-flint; install it with: pip install 'fpsolve[proof]'\n"
    assert not (tmp_path / "results").exists()


@pytest.mark.slow
def test_a_width_that_is_not_met_is_told_and_the_bounds_are_kept(tmp_path):
    weak = [
        f"--set={each}" for each in ("oscillator.epsilon=0.05", "noise.D0=0.1", "moments.p=[1.0]", "budget.seconds=2")
    ]
    done = run(tmp_path, "prove", "case.toml", "--width", "1e-30", *weak, "--quiet", case=GAUSSIAN)
    assert done.code == NOT_CONVERGED
    assert "(1 parameter set, 1 not as close as wanted, " in done.out
    (moment,) = read_json(proof_in(tmp_path))["sets"][0]["moments"]
    assert moment["upper"] - moment["lower"] > 1e-30


@pytest.mark.slow
def test_several_processes_write_the_same_proof(tmp_path):
    varied = ["--set", 'vary."noise.axial.a"=[0.4, 0.5]', *LOOSE, "--quiet"]
    for jobs, out in (("1", "results"), ("2", "others")):
        assert run(tmp_path, "prove", "case.toml", *varied, "--jobs", jobs, "--out", out, case=SYSTEM).code == 0
    assert proof_in(tmp_path).read_bytes() == (tmp_path / "others/case/proof.json").read_bytes()
    sets = read_json(proof_in(tmp_path))["sets"]
    assert [parameter_set["parameters"]["noise.axial.a"] for parameter_set in sets] == [0.4, 0.5]


@pytest.mark.slow
def test_many_moments_are_counted_and_many_sets_have_a_row_each(tmp_path):
    """And p of a range is the float as it stands."""
    many = "--set", "moments.p={start=-0.1, stop=0.5, num=7}"
    done = run(tmp_path, "prove", "case.toml", *LOOSE, *many, "--set", "output.quantities=['moment']", case=SYSTEM)
    assert re.search(r"Proven: of 7 moments 1 grows, 5 decay\.\n", done.out)
    found = read_json(proof_in(tmp_path))["sets"][0]["moments"]
    assert [each["p"] for each in found] == load_case(tmp_path / "case.toml", [many[1]]).p.tolist()
    varied = f'vary."noise.axial.a"={[0.05 * k for k in range(4, 15)]}'
    done = run(tmp_path, "prove", "case.toml", *LOOSE, "--set", varied, "--set", "moments.p=[0.0]")
    heading = next(line for line in done.out.splitlines() if "proven" in line)
    assert re.sub(r"[┃ ]+", " ", heading).split() == ["a", "proven", "λ", "paths", "p", "=", "0"]
    assert len(re.findall(r"1 of 1 │ +in \[-0\.\d+, -0\.\d+\] │ +decays │ +is constant", done.out)) == 11


@pytest.mark.slow
def test_a_folder_holds_proofs_of_its_parameters_only(tmp_path):
    proof, shorter = proof_in(tmp_path), ["--quiet", "--set", "moments.p=[1.0]"]
    assert run(tmp_path, "prove", "case.toml", *LOOSE, "--quiet", case=GAUSSIAN).code == 0
    before = proof.read_bytes()
    assert run(tmp_path, "run", "case.toml", *shorter).code == 0
    assert proof.read_bytes() == before
    assert run(tmp_path, "run", "case.toml", *shorter, "--set", "noise.D0=0.4").code == 0
    assert not proof.exists()
    assert run(tmp_path, "prove", "case.toml", *LOOSE, "--quiet").code == 0
    assert not (proof.parent / "summary.json").exists()
    assert read_json(proof)["sets"][0]["parameters"]["noise.D0"] == 0.5


def forged(line):
    """Closer bounds than follow."""
    return re.sub(r'("upper": ?)(-[\d.e-]+)', lambda found: f"{found[1]}{float(found[2]) - 1e-4!r}", line, count=1)


def broken(line):
    return line[: len(line) // 2]


@pytest.mark.parametrize("change", [str, forged, broken])
def test_a_run_goes_on_with_records_of_bounds_that_follow(proven, tmp_path, change):
    """What is forged or broken is proven anew."""
    [records] = proof_in(proven.folder).parent.glob("records/*.jsonl")
    lines = records.read_text(encoding="utf-8").splitlines()
    changed = [change(line) for line in lines]
    assert (changed == lines) == (change is str)
    folder = proof_in(tmp_path).parent / "records"
    folder.mkdir(parents=True)
    (folder / records.name).write_text("\n".join(changed) + "\n", encoding="utf-8")
    assert run(tmp_path, "prove", "case.toml", "--width", "1e-3", "--quiet", case=SYSTEM).code == 0
    assert proof_in(tmp_path).read_bytes() == proof_in(proven.folder).read_bytes()


CODE = "from fpsolve.cli import main; raise SystemExit(main())"


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(("kind", "code"), sampled((signal.SIGINT, 130), (signal.SIGTERM, 143)))
def test_an_interrupted_run_keeps_what_it_has_proven(tmp_path, kind, code):
    """Of p = 0, which needs no time, and another, whose width is beyond reach."""
    (tmp_path / "case.toml").write_text(GAUSSIAN, encoding="utf-8")
    process = started(CODE, "prove", "case.toml", "--jobs", "1", "--width", "1e-30", cwd=tmp_path)
    kept = proof_in(tmp_path).parent / "records"
    while not [*kept.glob("*.jsonl")]:
        time.sleep(0.05)
        assert process.poll() is None
    process.send_signal(kind)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code
    assert "interrupted after 1 of 2 bounds; what was done is kept in results/case" in said
    proof = read_json(proof_in(tmp_path))
    assert proof["complete"] is False
    zero, second = proof["sets"][0]["moments"]
    assert zero["certificate"] is not None
    assert second == {"p": 2.0, "lower": None, "upper": None, "certificate": None}
    assert check(tmp_path, proof).code == 0
