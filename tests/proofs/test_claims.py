"""A file of proofs is accepted only if every claim in it follows from its certificates, and refused if it is none."""

import copy
import json
import re

import pytest

from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT, CHECK_FAILED
from fpsolve.proofs.certificate import MalformedProof
from fpsolve.proofs.claims import claims_from, plain, verdicts
from fpsolve.workflow.prove import prove_case
from tests.kit import case_in
from tests.proofs.case import CASE


@pytest.fixture(scope="module")
def proof(tmp_path_factory):
    """The text of a proof.json."""
    folder = tmp_path_factory.mktemp("claims")
    prove_case(case_in(folder, CASE, name="proven"), folder, width=1e-3)
    return (folder / "proven/proof.json").read_text(encoding="utf-8")


@pytest.fixture
def data(proof):
    """A proof to be changed, with one curve."""
    return json.loads(proof)


def only(data, key):
    """A proof of which all is left out but one quantity, so that little is to be verified."""
    (curve,) = data["curves"]
    moments = [each for each in curve["moments"] if key == "moments" and each["p"]]
    others = {name: curve[name] if name == key else None for name in ("lyapunov_exponent", "stability_index")}
    curve.update(others, moments=moments, verdicts=[])
    return curve


def change_certificate(certificate, change):
    """Change keys of a certificate, or of both of its bounds."""
    for key, value in change.items():
        for part in (certificate["upper"], certificate["lower"]) if key in certificate["upper"] else (certificate,):
            part[key] = value


def objections(data):
    return list(claims_from(data if isinstance(data, str) else json.dumps(data)).objections())


def test_a_proof_follows_from_its_certificates(proof):
    claims = claims_from(proof)
    assert list(claims.objections()) == []
    assert claims.count == 4
    assert claims.complete
    (curve,) = claims.curves
    assert curve.verdicts == ["almost every path grows", "the moment of order 2 grows"]


def test_bounds_may_be_wider(data):
    (moment,) = only(data, "moments")["moments"]
    moment.update(lower=-1e300, upper=1e300)
    assert objections(data) == []


@pytest.mark.parametrize("kind", ["moments", "lyapunov_exponent"])
def test_bounds_that_claim_too_much(data, kind):
    curve = only(data, kind)
    entry = curve["moments"][0] if kind == "moments" else curve[kind]
    lower, upper = entry["lower"], entry["upper"]
    for low, high, words in (
        (lower + 0.1 * (upper - lower), upper, "closer"),
        (lower, upper - 0.1 * (upper - lower), "closer"),
        (upper, lower, "closer"),
        (lower, lower, "closer"),
    ):
        entry.update(lower=low, upper=high)
        (objection,) = objections(data)
        assert words in objection
        assert objection.startswith(f"curves.0.{kind}")
    for low, high in ((None, upper), (lower, None), (None, None)):  # claim less
        entry.update(lower=low, upper=high)
        assert not [text for text in objections(data) if kind in text]
    one_sided = entry["certificate"] | {"upper": None}
    entry.update(lower=lower, upper=upper, certificate=one_sided)
    assert "closer" in objections(data)[0]
    entry.update(upper=None)
    assert not [text for text in objections(data) if kind in text]
    entry.update(lower=lower, upper=upper, certificate=None)
    assert "no certificate" in objections(data)[0]
    entry.update(lower=None, upper=None)
    assert objections(data) == []


def test_certificates_of_something_else(data):
    curve = data["curves"][0]
    zero, second = curve["moments"]
    exponent = curve["lyapunov_exponent"]
    curve.update(stability_index=None, verdicts=[], moments=[zero | {"p": 2.0}, exponent | {"p": 2.0}])
    curve["lyapunov_exponent"] = {name: value for name, value in second.items() if name != "p"}
    assert objections(data) == [
        "curves.0.moments.0: the certificate is of another p",
        "curves.0.moments.1: the certificate is of another p",
        "curves.0.lyapunov_exponent: the certificate is of another p",
    ]


def test_parameters_are_labels(data):
    only(data, "moments")["parameters"].update({"noise.D0": 1.1, "oscillator.c2": 3.0})
    assert objections(data) == []


@pytest.mark.parametrize(
    "text",
    ["almost every path decays", "the moment of order 2 decays", "the moment of order 3 grows", "the solution is well"],
)
def test_verdicts_that_do_not_follow(data, text):
    """Nor do those of an entry that is open."""
    curve = data["curves"][0]
    curve.update(moments=[], lyapunov_exponent=None, stability_index=None, verdicts=[text])
    assert objections(data) == [f"curves.0.verdicts: {text!r} does not follow"]


def test_verdicts_follow_from_signs_only_and_name_p_in_full(data):
    curve = only(data, "moments")
    curve["moments"][0]["lower"] = -1.0
    curve["verdicts"] = ["the moment of order 2 grows"]
    assert objections(data) == ["curves.0.verdicts: 'the moment of order 2 grows' does not follow"]
    assert verdicts([(2.0000001, 1), (0.0, 0), (-0.50, -1), (1.0, 0)], -1) == [
        "almost every path decays",
        "the moment of order 2.0000001 grows",
        "the moment of order -0.5 decays",
    ]
    assert [plain(p) for p in (10.0, 1e-09, 1.23456789e-09)] == ["10", "1e-09", "1.23456789e-09"]


def test_a_stability_index_needs_a_change_of_sign_between_two_p_of_one_sign(data, monkeypatch):
    monkeypatch.setattr("fpsolve.proofs.claims.objection", lambda _: "")  # the certificates hold
    index = only(data, "stability_index")["stability_index"]
    assert objections(data) == []
    whole = copy.deepcopy(index)
    low, high = whole["moments"]
    assert low["lower"] > 0 > high["upper"]
    assert low["p"] < high["p"] < 0
    for change, words in (
        ({"moments": [high, low]}, "does not change its sign"),
        ({"moments": [low, low]}, "does not change its sign"),
        ({"moments": [low | {"lower": -1.0}, high]}, "does not change its sign"),
        ({"moments": [low]}, "needs both bounds"),
        ({"moments": [low, high, high]}, "needs both bounds"),
        ({"moments": []}, "needs both bounds"),
        ({"lower": None}, "needs both bounds"),
        ({"lower": (low["p"] + high["p"]) / 2}, "closer than the two p"),
        ({"upper": low["p"]}, "closer than the two p"),
        ({"moments": [low, high | {"p": 1.0}]}, "another p"),
    ):
        index.clear()
        index.update(whole | change)
        assert words in objections(data)[0]
    index.update(lower=None, upper=None, moments=[])
    assert objections(data) == []


@pytest.mark.parametrize("place", ["lower", "p", "mu", "delta", "phases"])
@pytest.mark.parametrize("number", ["1e999999999", "NaN", "-Infinity", "true", "[]", '"1.0"'])
def test_what_is_no_number_makes_a_file_malformed(proof, place, number):
    text, count = re.subn(rf'("{place}": ?)[-+\d.e]+', rf"\g<1>{number}", proof, count=1)
    assert count == 1
    with pytest.raises(MalformedProof) as refused:
        claims_from(text)
    assert len(str(refused.value)) < 250


@pytest.mark.parametrize(
    "text",
    [
        *("1", "null", "true", '"a"', "[]", "{}", "{", "NaN", "title = 1"),
        '{"fpsolve": "0", "case": "a", "complete": true, "curves": []}',
    ],
    ids=lambda text: f"{text[:12]} {len(text)}",
)
def test_json_that_is_no_proof(text):
    with pytest.raises(MalformedProof):
        claims_from(text)


def test_keys_that_are_missing_or_too_many(data):
    places = ((), ("curves", 0), ("curves", 0, "moments", 1), ("curves", 0, "moments", 1, "certificate"))
    for path in places:
        for name in [*_at(data, path), "more"]:
            changed = copy.deepcopy(data)
            table = _at(changed, path)
            if table.pop(name, None) is None:
                table[name] = 1
            with pytest.raises(MalformedProof, match=r"Field required|not permitted|nothing else has"):
                claims_from(json.dumps(changed))


def _at(data, path):
    for part in path:
        data = data[part]
    return data


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nodes": [0.0, -1.0], "values": [0.0, 0.0]}, "nodes must increase"),
        ({"nodes": [0.0, 0.0], "values": [0.0, 0.0]}, "nodes must increase"),
        ({"values": [0.0, 0.0]}, "one of values for each"),
        ({"cosine": [[1.0]]}, "tables of one shape"),
        ({"cosine": [[1.0, 2.0], [1.0]], "sine": [[1.0, 2.0], [1.0]]}, "tables of one shape"),
        ({"cosine": [], "sine": []}, "should have at least 1 item"),
        ({"phases": 0}, "should be greater than 0"),
        ({"tails": None}, "a core has tails"),
        ({"tails": None, "basis": {"kind": "whole"}}, "the basis whole is of other noise"),
        ({"delta": -1e-9}, "should be greater than or equal to 0"),
        ({"stated": {}}, "Field required"),
    ],
)
def test_certificates_that_do_not_fit_together(data, change, words):
    change_certificate(data["curves"][0]["moments"][1]["certificate"], change)
    with pytest.raises(MalformedProof, match=re.escape(words)):
        claims_from(json.dumps(data))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "change",
    [
        {"cosine": [[1e308] * 5] * 5, "sine": [[1e308] * 5] * 5},
        {"cosine": [[0.0]], "sine": [[0.0]]},
        {"cosine": [[1.0]], "sine": [[0.0]]},
        {"basis": {"kind": "core", "centre": 1e308, "scale": 1.0, "gauge": 0.0}},
        {"basis": {"kind": "core", "centre": 0.0, "scale": 5e-324, "gauge": 0.0}},
        {"basis": {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": -1e308}},
        {"phases": 4},
        {"tails": [-1e308, 1e308]},
    ],
    ids=str,
)
def test_numbers_that_overflow_prove_nothing(data, change):
    change_certificate(only(data, "moments")["moments"][0]["certificate"], change)
    (objection,) = objections(data)
    assert re.search("u > 0 is not certain|is not made up for|does not serve beyond", objection)


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Writes a file and checks it."""
    monkeypatch.chdir(tmp_path)

    def check(content):
        (tmp_path / "a.json").write_bytes(content if isinstance(content, bytes) else content.encode())
        return main(["prove", "--check", "a.json"])

    return check


def test_what_the_command_says_of_a_file(written, data, capsys):
    only(data, "moments")
    assert written(json.dumps(data)) == 0
    accepted, note = capsys.readouterr().out.splitlines()
    assert accepted == "accepted: a.json (bounds on 1 number follow from their certificates)"
    assert note.startswith("note: parameters are labels")
    assert written(json.dumps(data | {"complete": False})) == 0
    assert "certificates; what proved them was interrupted)\n" in capsys.readouterr().out
    data["curves"][0]["moments"][0]["upper"] = 0.0
    assert written(json.dumps(data)) == CHECK_FAILED
    out, err = capsys.readouterr()
    assert out == "rejected: a.json (1 objection, bounds on 1 number)\n"
    assert err == "a.json: curves.0.moments.0: the bounds are closer than those of the certificate\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"\0\1", "is binary"),
        (b'{"a": "\xff"}', "is not UTF-8"),
        (b"[]", "should be a valid dictionary"),
        (b"{", "is no JSON"),
    ],
)
def test_files_that_are_no_proof_are_told_in_one_line(written, capsys, content, words):
    assert written(content) == BAD_INPUT
    out, err = capsys.readouterr()
    assert not out
    assert err.startswith("a.json: ")
    assert words in err
    assert "make one with `fpsolve prove`" in err or "save it as UTF-8" in err
    assert err.count("\n") == 1
