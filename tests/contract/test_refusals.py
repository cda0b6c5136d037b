"""What is said of input that is refused, word by word in refusals/*.txt; see tests/snapshots.py."""

import os
import re
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fpsolve import CaseError, load_case
from tests import snapshots
from tests.conftest import sampled
from tests.kit import case_in, files, run

GOOD = snapshots.good("quick")


@pytest.mark.parametrize("entry", snapshots.entries(), ids=lambda entry: entry.id)
def test_refusal(entry, tmp_path):
    assert entry.outcome(tmp_path) == entry.said


PIPE = "is a pipe or a device, not a file; write the case into a file and name that"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nowhere.toml", "nowhere.toml: no such file; look in FOLDER or give the full path"),
        (".", ".: is a directory; name a case file in it, such as fig1.toml"),
        ("/dev/zero", f"/dev/zero: {PIPE}"),
        ("pipe.toml", f"pipe.toml: {PIPE}"),
        ("huge.toml", f"has {2**40} bytes, and a case file has at most {2**22}; name another, such as fig1.toml"),
        ("good.toml/case.toml", "cannot be read (Not a directory); check its name and permissions"),
        *(
            (f"{name}.toml", "must have no control characters")
            for name in (".", "..", "a\x1b[31m", "a\u202eb", "mi\nne")
        ),
        (
            "piped.toml",
            "vary.file: pipe.toml: is a pipe or a device, not a file; write the sets into a file and name that",
        ),
        ("folder.toml", "vary.file: .: is a directory; name a file of sets in it, such as sets.csv"),
    ],
)
def test_what_is_no_case_file_is_refused(tmp_path, name, words):
    """Reading a pipe might never end, and the results of `..toml` would be in the folder of all results."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "huge.toml").touch()
    os.truncate(tmp_path / "huge.toml", 2**40)
    texts = {"good.toml": GOOD, "piped.toml": f"{GOOD}vary.file = 'pipe.toml'", "folder.toml": f"{GOOD}vary.file = '.'"}
    texts |= {name: GOOD} if "must" in words else {}
    texts = {key: text.replace("vary.", "[vary]\n") for key, text in texts.items()}
    done = run(tmp_path, "run", name, **texts)
    assert (done.code, done.out) == (2, "")
    assert words in done.err.replace(str(tmp_path), "FOLDER")
    assert {each.name for each in tmp_path.iterdir()} == {*texts, "pipe.toml", "huge.toml"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "--paths", "2.5"], 'Invalid value for --paths: got "2.5"; must be a whole number'),
        (["simulate", "--out", "case.toml"], "choose another --out"),
        (["run", "--out", "case.toml"], "choose another --out"),
        (["run", "--monte-carlo", "--set", "noise.tau0=1e-8"], "monte_carlo.step: one transient, 6.28, takes 2.6e+09"),
        (["run", "--set", f"title={'1' * 5000}"], "integer string conversion"),
        (["run", "--set", "a=1\nb=2"], "--set a=1\nb=2: must be one key=value, but there are 2 here"),
        (["chart"], "chart: missing"),
    ],
)
def test_refused_arguments_of_a_command(tmp_path, arguments, words):
    done = run(tmp_path, *arguments, "case.toml", case=GOOD)
    assert (done.code, done.out) == (2, "")
    assert words in done.err
    assert files(tmp_path) == {"case.toml"}


def test_a_number_of_processors_that_is_none_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("FPSOLVE_PROCESSORS", "many")
    done = run(tmp_path, "simulate", "case.toml", case=GOOD)
    assert (done.code, done.err.strip()) == (
        2,
        'FPSOLVE_PROCESSORS, in the environment: got "many"; must be a whole number >= 1; set it to one, or unset it',
    )


@pytest.mark.parametrize("override", [[], None])
def test_an_override_that_is_no_text_is_refused(tmp_path, override):
    with pytest.raises(CaseError, match=r"is no text; write it as in --set oscillator\.omega=2\.0"):
        case_in(tmp_path, GOOD, [override])
    with pytest.raises(TypeError, match="got path = 5; must be the path of a case file"):
        load_case(5)


@pytest.mark.parametrize(("count", "last"), sampled((51, ": and 1 more"), (1000, ": and 950 more")))
def test_of_many_faults_the_first_fifty_are_told_with_their_lines(tmp_path, count, last):
    lines = run(
        tmp_path, "run", "case.toml", case="".join(f"wrong{i} = 1\n" for i in range(count)) + GOOD
    ).err.splitlines()
    assert len(lines) == min(count, 51)
    assert [line.split(": ")[:2] for line in lines[:50]] == [[f"case.toml:{i + 1}", f"wrong{i}"] for i in range(50)]
    assert last in lines[-1]


@pytest.mark.parametrize("override", sampled(f"title={'[' * 5000}", f"vary{'.a' * 3000}=1"))
def test_deep_nesting_is_refused_within_a_second(tmp_path, override):
    started = time.process_time()
    assert run(tmp_path, "run", "case.toml", "--set", override, case=GOOD).code == 2
    assert time.process_time() - started < 1


def powers(low, high):
    """Numbers of any size between these."""
    return st.sampled_from([10.0**low, 10.0**high]) | st.floats(low, high).map(lambda power: 10.0**power)


def signed(low, high):
    return st.tuples(st.sampled_from([-1, 1]), powers(low, high)).map(lambda pair: pair[0] * pair[1])


@pytest.mark.slow
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    numbers=st.fixed_dictionaries(
        {name: powers(-15, 15) for name in ("omega", "D0", "tau0")}
        | {"epsilon": powers(-12, 6), "c1": signed(-300, 15), "restitution": powers(-300, 0)}
        | {"r0": st.floats(-1e6, 1.66) | signed(-16, -0.3).map(lambda part: 1 - part), "p": signed(-300, 308)}
    ),
    treatment=st.sampled_from(["exact", "ou-reduction"]),
)
def test_any_parameters_in_their_ranges_give_a_case_or_a_refusal(tmp_path, numbers, treatment):
    text = GOOD.replace("ou-reduction", treatment)
    for key, value in numbers.items():
        stated = f"[{value!r}]" if key == "p" else repr(value)
        text, count = re.subn(rf"^{key} = .*", f"{key} = {stated}", text, flags=re.MULTILINE)
        assert count == 1
    try:
        [parameter_set] = case_in(tmp_path, text).sets()
        found = {"moments"} if parameter_set.problem else set()
    except CaseError as error:
        found = {fault.key for fault in error.faults}
    assert set() < found <= {"oscillator", "moments"}
