"""A file of proofs is accepted only if every claim in it follows from its certificates, and refused if it is none."""

import copy
import json
import re

import pytest

from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT, CHECK_FAILED
from fpsolve.proofs import claims
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


def test_bounds_may_be_wider_and_printed_with_other_digits(data):
    (moment,) = only(data, "moments")["moments"]
    lower, upper = moment["lower"], moment["upper"]
    text = json.dumps(data)
    for low, high in ((f"{lower:.30f}", f"{upper:.30e}"), ("-1e300", "1e300"), ("0", "1")):
        assert objections(text.replace(repr(lower), low, 1).replace(repr(upper), high, 1)) == []


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


def test_the_float_that_a_bound_is_read_as_must_hold_too(data):
    """Λ(0) = 0 is within 1 of 2⁻⁶⁰, but a program that reads 1 + 10⁻¹⁸ has 1, which is below 1 + 2⁻⁶⁰."""
    curve = data["curves"][0]
    curve.update(moments=curve["moments"][:1], lyapunov_exponent=None, stability_index=None, verdicts=[])
    curve["moments"][0].update(lower=-1.0, upper="UPPER")
    change_certificate(curve["moments"][0]["certificate"], {"mu": 2.0**-60, "delta": 1.0})
    text = json.dumps(data)
    assert objections(text.replace('"UPPER"', "1.0000000000000003")) == []
    assert "closer" in objections(text.replace('"UPPER"', "1.000000000000000001"))[0]


def test_certificates_of_something_else(data):
    curve = data["curves"][0]
    zero, second = curve["moments"]
    exponent = curve["lyapunov_exponent"]
    curve.update(stability_index=None, verdicts=[], moments=[zero | {"p": 2.0}, exponent | {"p": 2.0}])
    curve["lyapunov_exponent"] = {name: value for name, value in second.items() if name != "p"}
    assert objections(data) == [
        "curves.0.moments.0: the certificate is of another p",
        "curves.0.moments.1: the certificate is of another quantity",
        "curves.0.lyapunov_exponent: the certificate is of another quantity",
    ]


@pytest.mark.parametrize(
    "change",
    [
        {"noise.D0": 1.1},
        {"oscillator.omega": 1.2000000000000002},
        {"oscillator.impact": "restitution"},
        {"noise.treatment": "exact"},
        {"oscillator.damping": 0.1},
        {"noise.alpha": 1.0, "noise.sigma": 1.0},
        {"noise.r0": "0.9"},
    ],
)
def test_parameters_that_the_certificate_does_not_have(data, change):
    only(data, "moments")["parameters"].update(change)
    assert objections(data) == ["curves.0.moments.0: the certificate is of other parameters"]


def test_numbers_with_more_digits_than_floats_are_other_numbers(data):
    """p and parameters are the decimals that stand there."""
    only(data, "moments")
    text = json.dumps(data)
    for old, new, words in (
        ('"p": 2.0,', '"p": 2.00000000000000000001,', "another p"),
        ('"p": "2.0"', '"p": "2.00000000000000000001"', "another p"),
        ('"noise.r0": 0.9', '"noise.r0": 0.90000000000000000001', "other parameters"),
        ('"noise.r0": "0.9"', '"noise.r0": "0.90000000000000000001"', "other parameters"),
    ):
        assert text.count(old) == 1
        (objection,) = objections(text.replace(old, new))
        assert words in objection
    assert objections(text.replace('"p": 2.0,', '"p": 2,').replace('"noise.D0": 1.0', '"noise.D0": 1')) == []


def test_nonlinear_parameters_do_not_matter(data):
    only(data, "moments")["parameters"].update({"oscillator.c2": 3.0, "oscillator.c3": -1.0})
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
    assert verdicts([("2.0000001", 1), ("0.0", 0), ("-0.50", -1), ("1", 0)], -1) == [
        "almost every path decays",
        "the moment of order 2.0000001 grows",
        "the moment of order -0.5 decays",
    ]
    assert [plain(p) for p in ("10.0", "1e-09", "1.23456789e-09")] == ["10", "1e-09", "1.23456789E-9"]


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


NUMBERS = (
    *("1e999999999", "1e99999999999999999999999", "9" * 5000, "9" * 400),
    *("NaN", "Infinity", "-Infinity", "true", "[]"),
)
PLACES = (r'"lower": ', r'"p": ', r'"mu": ', r'"delta": ', r'"phases": ', r'"parameters": \{"oscillator.omega": ')


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("number", NUMBERS, ids=lambda text: text[:8])
def test_what_is_no_number_makes_a_file_malformed(proof, place, number):
    text, count = re.subn(rf"({place})[-+\d.e]+", rf"\g<1>{number}", proof, count=1)
    assert count == 1
    with pytest.raises(MalformedProof) as refused:
        claims_from(text)
    assert len(str(refused.value)) < 250
    assert not re.search("Input should|Value error|Decimal", str(refused.value))


@pytest.mark.parametrize(
    "text",
    [
        *("1", "null", "true", '"a"', "[]", "{}", "{", "NaN", "title = 1"),
        *("[" * 100_000, "[" * 100_000 + "]" * 100_000, '{"a":' * 50_000),
        '{"fpsolve": "0", "case": "a", "complete": true, "curves": []}',
    ],
    ids=lambda text: f"{text[:12]} {len(text)}",
)
def test_json_that_is_no_proof(text):
    with pytest.raises(MalformedProof):
        claims_from(text)


def test_keys_that_are_missing_too_many_or_double(proof, data):
    with pytest.raises(MalformedProof, match="'lower' stands twice"):
        claims_from(proof.replace('"lower": ', '"lower": 0.0, "lower": ', 1))
    places = ((), ("curves", 0), ("curves", 0, "moments", 1), ("curves", 0, "moments", 1, "certificate"))
    for path in places:
        for name in [*_at(data, path), "more"]:
            changed = copy.deepcopy(data)
            table = _at(changed, path)
            if table.pop(name, None) is None:
                table[name] = 1
            with pytest.raises(MalformedProof, match=r"is missing|no key of a proof|nothing else has"):
                claims_from(json.dumps(changed))


def _at(data, path):
    for part in path:
        data = data[part]
    return data


def test_a_file_of_many_certificates_is_refused_by_its_work(data, monkeypatch):
    monkeypatch.setattr(claims, "MOST_WORK", 10**5)
    with pytest.raises(MalformedProof, match=r"certificates ask for .* operations; at most 1e\+05 are done"):
        claims_from(json.dumps(data))


MUCH = {
    **{"nodes": [float(i) for i in range(10_000)], "values": [0.0] * 10_000, "phases": 800},
    **{"cosine": [[0.0] * 100] * 100, "sine": [[0.0] * 100] * 100},
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nodes": [0.0, -1.0], "values": [0.0, 0.0]}, "nodes must increase"),
        ({"nodes": [0.0, 0.0], "values": [0.0, 0.0]}, "nodes must increase"),
        ({"values": [0.0, 0.0]}, "one of values for each"),
        ({"cosine": [[1.0]]}, "tables of one shape"),
        ({"cosine": [[1.0, 2.0], [1.0]], "sine": [[1.0, 2.0], [1.0]]}, "tables of one shape"),
        ({"cosine": [], "sine": []}, "must have at least 1 item"),
        ({"cosine": [[0.0] * 401], "sine": [[0.0] * 401]}, "must have at most 400 items"),
        ({"phases": 10**9}, "must be less than or equal to 8192"),
        ({"nodes": [float(i) for i in range(20_000)], "values": [0.0] * 20_000, "phases": 8192}, "too many together"),
        (MUCH, "asks for 1.4e+09 operations; at most 2e+08 are done"),
        ({"tails": None}, "a core its tails"),
        ({"tails": None, "basis": {"kind": "whole"}}, "only bounded noise has a whole support"),
        ({"p": "1e9999"}, "must be a decimal number"),
        ({"p": "nan"}, "must be a decimal number"),
        ({"p": "\uff12.0"}, "must be a decimal number"),
        ({"p": " 2.0"}, "must be a decimal number"),
        ({"delta": -1e-9}, "must be greater than or equal to 0"),
        ({"parameters": {}}, "parameters must be"),
    ],
)
def test_certificates_that_do_not_fit_together(data, change, words):
    change_certificate(data["curves"][0]["moments"][1]["certificate"], change)
    with pytest.raises(MalformedProof, match=re.escape(words)):
        claims_from(json.dumps(data))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"ou-reduction"', '"exactly"', "'exact' or 'ou-reduction'"),
        ('"oscillator.impact": "delta"', '"oscillator.impact": "hard"', "'delta' or 'restitution'"),
        ('"noise.r0": "0.9"', '"noise.r0": "1.7"', "r0: must be less than 1.666666"),
        ('"oscillator.omega": "1.2"', '"oscillator.omega": "-1.2"', "omega"),
    ],
)
def test_certificates_of_no_oscillator(proof, old, new, words):
    with pytest.raises(MalformedProof, match=words):
        claims_from(proof.replace(old, new))


def test_no_bound_holds_for_algebraic_tails(proof):
    text = proof.replace('"ou-reduction"', '"exact"').replace(
        '"noise.r0": "0.9"', '"noise.r0": "1.0000000000000000001"'
    )
    with pytest.raises(MalformedProof, match=r"got noise\.r0 = 1\.0000000000000000001; for r0 > 1"):
        claims_from(text)


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
    assert capsys.readouterr().out == "accepted: a.json (bounds on 1 number follow from their certificates)\n"
    assert written(json.dumps(data | {"complete": False})) == 0
    assert capsys.readouterr().out.endswith("certificates; what proved them was interrupted)\n")
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
        (b"[]", "must be a table"),
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
