"""The command line: what is typed, the exit code, the words on both streams, and the files."""

import io
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.conftest import heed_signals, sampled, started
from tests.kit import HOPELESS, LEAN, TABLES, TEXT, files, read_json, records_in, run, sets

FAST = f'--set "{LEAN}"'
SMALL = f'--set "output={{ figure=false, quantities=[\'moment\'] }}" --set moments.p=[2.0] --set "{HOPELESS}"'
ALONE = "--set vary={} --set output.eigenfunctions=[]"
FAILING = f"{SMALL} --set oscillator.epsilon=1.5"
EXPECTED = '[[expect]]\nquantity = "moment"\np = 0.0\nvalue = 0.0\natol = 1e-12\nsource = "in [/x] of [vary]"\n'
IMPACTS = TEXT.replace('[vary]\n"noise.D0" = [0.1, 1.0]\n', "") + "".join(
    f'[[expect]]\nquantity = "{name}"\nvalue = {value}\nrtol = 5e-3\nsource = "Eq. (39)"\n'
    for name, value in {
        "impact_rate": 0.31831,
        "critical_impact_factor": 0.9964999,
        "critical_restitution": 0.6494,
    }.items()
)
TEXTS = {
    "case.toml": TEXT,
    "bad.toml": TEXT.replace("omega = 1.0", "omega = -1.0"),
    "good.toml": TEXT.replace("A test", "see [/b] of [vary]") + EXPECTED,
    "differs.toml": TEXT + EXPECTED.replace("value = 0.0", "value = 1.0"),
    "impacts.toml": IMPACTS,
    "where.toml": TEXT + EXPECTED.replace("0.0\n", "1.0\n") + 'where = { "noise.D0" = 1.0 }\n',
    "a=1.toml": "title = 1",
    "title.toml": TEXT.replace("A test", "Another\\n test"),
    "a\x1b[31mb.toml": TEXT,
}
"""The files of each folder in which a command is typed; all their parameter sets are solved at once."""
UNITS = "Units: omega in rad/time … c1 in 1/time … D0 in 1/time … tau0 in time"
QUANTITIES = "moment, lyapunov_exponent, stability_index … impact_rate … eigenfunctions"
JOBS = "must be a whole number from 1 to 1000"
ROWS = [
    ("--version", 0, f"fpsolve {version('fpsolve')}", ""),
    (
        "--help",
        0,
        "linear systems under random loads … [system] … 0 success … 1 a checked value differs or a design is out of "
        "reach … 2 bad input … 3 not converged … 130 interrupted … 143 terminated",
        "",
    ),
    *((f"{name} --help", 0, f"Example: fpsolve {name} … {UNITS}", "") for name in ("run", "check")),
    ("mesh --help", 0, "Example: fpsolve mesh", ""),
    ("run --help", 0, QUANTITIES, ""),
    # what a run prints and writes
    (
        f"run case.toml {FAST}",
        0,
        "noise.D0 = 0.1: almost every path decays, halving in a time of 47900 … λ ┃ … 1 │ 0.001087570 │ … written: "
        "results/case (2 parameter sets, ",
        "",
    ),
    (f"run case.toml {FAST} --out elsewhere", 0, "written: elsewhere/case", ""),
    (
        f"run case.toml {FAST} --set oscillator.omega=2.0 --set budget.seconds=9.0",
        0,
        'A test with oscillator.omega = 2.0 noise.treatment = "ou-reduction": Ornstein-Uhlenbeck noise, Eqs. '
        "(12)-(14), replaces the noise of Eq. (7).",
        "",
    ),
    (
        "run case.toml --set moments.p=[1.5] --set output={figure=false}",
        0,
        "R_c",
        "note: case: fpsolve also computes rate_function, variance_rate, critical_restitution, excursions, "
        "sensitivities, "
        "eigenfunctions: name them in [output] quantities, or add --all",
    ),
    (f"run case.toml {FAST} --quiet", 0, "written: results/case (2 parameter sets, ", None),
    (
        "run case.toml " + FAILING,
        3,
        "0.1 │ │ failed … written: results/case",
        "not converged: case, noise.D0 = 0.1 … use more cells",
    ),
    (
        f"run case.toml {FAILING} --quiet",
        3,
        "written: results/case (2 parameter sets, 2 not converged, ",
        "not converged: case",
    ),
    (
        f"run case.toml {ALONE} --set noise.treatment=exact --table",
        0,
        "Eq. (37)* … * for the noise reduced by Eqs. (12)-(14)",
        "",
    ),
    (
        f"run case.toml {ALONE} --set noise.D0=0.1 --set oscillator.c1=-0.8 --all",
        0,
        "r_c │ none │",
        "note: case: there is no r_c: almost surely stable for every r in (0, 1]",
    ),
    (
        f"run case.toml {ALONE} --set noise.D0=0.1 --set oscillator.c1=0.7 --all",
        0,
        "r_c │ none │",
        "note: case: there is no r_c: unstable",
    ),
    (
        f"run case.toml {FAST} --set \"figure={{ x = 'noise.D0', y = 'lyapunov_exponent' }}\"",
        0,
        "D0 ┃ λ ┃ … Eq. (39) … 0.0010839",
        "",
    ),
    (
        f"run case.toml {ALONE} --set moments.p=[2.0] --set oscillator.epsilon=1.0 --set noise.r0=0.7 --set "
        f"noise.D0=1.0 --set moments.rtol=1e-6",
        0,
        "",
        "the Ornstein-Uhlenbeck reduction is meant for r0 near 1, but |r0 - 1| = 0.3 > 0.1 … perturbation theory, "
        "Eq. (37), is for weak noise",
    ),
    (
        f"run case.toml {ALONE} --set moments.p=[2.0] --set oscillator.epsilon=1.0 --set noise.D0=1.0 --set "
        f"moments.rtol=1e-12 --set budget.unknowns=1000",
        3,
        "",
        "not converged: case: Λ(2) was not found: it needs … the limit is 1,000 (try … The best value 3.429 … has "
        "an estimated error of",
    ),
    (
        f"run case.toml {FAST} --set mesh={{xi_min=-4.0,xi_max=4.0}}",
        0,
        "",
        "warning: case, noise.D0 = 0.1 and noise.D0 = 1: rtol = 1e-08 is not met … [mesh] phi_cells, xi_cells",
    ),
    # what a check prints
    ("check case.toml", 0, "the case expects no value; add [[expect]]", ""),
    ("check good.toml", 0, "see [/b] of [vary] … in [/x] of [vary] … ok", ""),
    ("check good.toml differs.toml", 1, "differs", ""),
    ("check good.toml --quiet", 0, "good: 2 of 2 ok", None),
    ("check impacts.toml", 0, "3 of 3 ok", ""),
    (
        "check where.toml --set moments.p=[1.0] --set output.eigenfunctions=[]",
        1,
        "differs … noise.D0 = 1 … 0 of 1 ok",
        "",
    ),
    ("check impacts.toml --set oscillator.c1=-0.8", 1, "none", "no r_c: almost surely stable"),
    ("check case.toml --set oscillator.c1=-0.2", 0, "", ""),
    # meshes
    (
        "mesh sub/graded.vtu --phi-cells 3 --xi-cells 6 --grading 2 --xi-min -7",
        0,
        "written: sub/graded.vtu (18 cells, 1815 unknowns)",
        "",
    ),
    *(
        (f"mesh {words}", 2, "", "")
        for words in ("a.vtu --phi-cells 0", "a.stl", "a.vtu --xi-min 1", "a.vtu --phi-cells x")
    ),
    # what is refused
    *((words, 2, "", "Error") for words in ("run", "bogus", "run a.toml --no-such-option")),
    ("run case.toml bad.toml missing.toml", 2, "", "bad.toml:5: oscillator.omega: got -1.0 … missing.toml"),
    ("run case.toml other/case.toml", 2, "", 'several cases are called "case"'),
    ("run case.toml --out /proc/none", 2, "", "choose another --out"),
    ("run case.toml --set noise.treatment='exact' --set noise.r0=1.1 --set vary={}", 2, "", "Λ(2) is not computed"),
    ("run case.toml --set noise.D0=7", 2, "", "--set noise.D0=7: noise.D0: has no effect, as the case varies noise.D0"),
    ("check a=1.toml", 2, "", "a=1.toml:1: title: got 1"),
    (
        "check case.toml --set oscillator.omega=2 --set noise.tau0=0.3 noise.D0=0.2",
        2,
        "",
        "noise.D0=0.2: no such file; each --set takes one assignment: write --set oscillator.omega=2 --set "
        "noise.tau0=0.3 --set noise.D0=0.2",
    ),
    (
        "check case.toml --set oscillator.omega=2 'vary.noise.D0=[1, 2]'",
        2,
        "",
        "write --set oscillator.omega=2 --set 'vary.noise.D0=[1, 2]'",
    ),
    (
        "check good.toml --set moments.p=[1.5]",
        2,
        "",
        "or remove it by --set 'output.eigenfunctions=[]' … or remove it by --set 'expect=[]'",
    ),
    ("check good.toml --set moments.p=[1.5] --set expect=[] --set output.eigenfunctions=[]", 0, "", ""),
    ("run missing.toml --traceback", 2, "", "Traceback … missing.toml"),
    *((f"{name} case.toml --jobs 0", 2, "", f"jobs: got 0; {JOBS}") for name in ("run", "check", "simulate")),
    ("run case.toml --jobs 2.5", 2, "", 'got "2.5"; must be a whole number'),
    ("run case.toml --jobs 2 --scheduler tcp://host:8786", 2, "", "name one of them"),
    ("run case.toml --scheduler host", 2, "", "scheduler: got 'host'; must be an address such as tcp://host:8786"),
    # letters that would steer a terminal
    (f"run case.toml {FAST} --out 'a\x1bb'", 0, r"written: a\x1bb/case", ""),
    ("run 'a\x1b[31mb.toml'", 2, "", r"a\x1b[31mb.toml"),
    ("check '\x1b[31m.toml'", 2, "", r"\x1b"),
    ("check case.toml --set 'oscillator.\x1bomega=2.0'", 2, "", r"\x1b"),
    ("check case.toml --set 'oscillator.omega=2.0 # \u202e'", 2, "", r"\u202e"),
    ("check case.toml '--\x9b'", 2, "", r"\x9b"),
    ("prove --check '\x1b.json'", 2, "", r"\x1b"),
    ("mesh '\x1b.vut'", 2, "", r"\x1b"),
    ("'ru\x1b'", 2, "", r"\x1b"),
]


def told(text):
    """A pattern of words in this order, with anything for each …"""
    return ".*".join(map(re.escape, text.split(" … ")))


def plain(text):
    return " ".join(re.sub("[╭╮╰╯─]|^│|│$", " ", text, flags=re.MULTILINE).split())


@pytest.mark.parametrize(("arguments", "code", "out", "err"), ROWS, ids=[row[0] for row in ROWS])
def test_command_has_its_exit_code_and_its_words(tmp_path, arguments, code, out, err):
    """Of err = None nothing at all is said; one of exit code 2 does nothing, and no letter steers a terminal."""
    (tmp_path / "other").mkdir()
    (tmp_path / "other/case.toml").write_text(TEXT, encoding="utf-8")
    done = run(tmp_path, *shlex.split(arguments), **TEXTS)
    assert done.code == code, done
    assert re.search(told(out), plain(done.out)), done.out
    assert re.search(told(err or "") + "$" * (err is None), plain(done.err)), done.err
    assert ("Traceback" in done.err) == ("--traceback" in arguments)
    assert (done.out + done.err).replace("\n", "").isprintable()
    if code == 2:
        assert done.out == ""
        assert files(tmp_path) == {*TEXTS, "other/case.toml"}
    if "--quiet" in arguments:
        assert done.out.count("\n") == 1


def test_json_is_a_line_for_each_case_with_what_summary_json_holds(tmp_path):
    done = run(tmp_path, *shlex.split(f"run case.toml title.toml --json --quiet {FAILING}"), **TEXTS)
    first, second = map(json.loads, done.out.splitlines())
    assert first == read_json(tmp_path / "results/case/summary.json")
    assert (done.code, first["title"], second["title"]) == (3, "A test", "Another\n test")
    assert "not converged: title" in done.err


class Ascii(io.TextIOWrapper):
    """A stream of a terminal that knows no Greek."""

    def __init__(self):
        super().__init__(io.BytesIO(), encoding="ascii")

    def getvalue(self):
        self.flush()
        return self.buffer.getvalue().decode()


def test_an_output_in_ascii_has_question_marks_for_greek(tmp_path):
    done = run(tmp_path, *shlex.split(f"run case.toml {FAST}"), to=Ascii, case=TEXT)
    assert (done.code, done.err) == (0, "")
    assert "?: largest Lyapunov exponent" in done.out


MAIN = "import sys; from fpsolve.cli import main; sys.exit(main(sys.argv[1:]))"
FULL = "the output cannot be written: No space left on device; send it to another place\n"


@pytest.mark.parametrize(
    ("arguments", "stdout", "left"),
    sampled(
        (f"run case.toml {FAST}", "full", (2, FULL)),
        ("check case.toml", "closed", (141, "")),
        ("--help", "full", (2, FULL)),
        ("mesh a.vtu", "full", (2, FULL)),
        ("--version", "closed", (141, "")),
    ),
)
@pytest.mark.parametrize("unbuffered", sampled("", "1"))
def test_an_output_that_cannot_be_written_is_one_sentence(tmp_path, arguments, stdout, left, unbuffered):
    (tmp_path / "case.toml").write_text(TEXT, encoding="utf-8")
    read, write = os.pipe()
    os.close(read)
    with Path("/dev/full" if stdout == "full" else f"/dev/fd/{write}").open("w", encoding="utf-8") as stream:
        done = subprocess.run(
            [sys.executable, "-c", MAIN, *shlex.split(arguments)], stdout=stream,
            stderr=subprocess.PIPE, text=True, check=False, cwd=tmp_path, timeout=100,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )  # fmt: skip
    assert (done.returncode, done.stderr) == left
    if arguments.startswith("run"):
        assert files(tmp_path / "results/case") >= TABLES - {"summary.json"}  # which many sets have not


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "code"), [("bogus", 2), (f"run case.toml {FAST}", 0)])
def test_errors_that_cannot_be_written_keep_the_exit_code(tmp_path, arguments, code):
    (tmp_path / "case.toml").write_text(TEXT, encoding="utf-8")
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = started(MAIN, *shlex.split(arguments), stderr=full, cwd=tmp_path)
        done.communicate(timeout=100)
    assert done.returncode == code
    assert (tmp_path / "results/case/results.nc").exists() == (code == 0)


@pytest.mark.parametrize("before", sampled(heed_signals, lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN), keep=0))
def test_a_sigterm_ends_a_run_that_keeps_what_it_has(tmp_path, before):
    """As Ctrl-C does; a SIGHUP that nohup has it ignore does not end it."""
    (tmp_path / "case.toml").write_text(TEXT, encoding="utf-8")
    many = f"run case.toml {FAST} --jobs 1 --set vary.noise.D0={{start=0.1,stop=1.0,num=5000}}"
    with started(MAIN, *shlex.split(many), before=before, cwd=tmp_path) as process:
        try:
            while len(sets(records_in(tmp_path / "results/case"))) < 3 and process.poll() is None:
                time.sleep(0.05)
            if before is not heed_signals:
                process.send_signal(signal.SIGHUP)
                with pytest.raises(subprocess.TimeoutExpired):
                    process.wait(timeout=0.5)
            process.send_signal(signal.SIGTERM)
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 143
    assert re.search(
        r"^interrupted after [1-9]\d* of 5000 parameter sets; what was done is kept in results/case; run", err, re.M
    )
    assert "Traceback" not in err
    assert files(tmp_path / "results/case") >= TABLES - {"summary.json"}  # which many sets have not


START = """
import sys
import fpsolve, fpsolve.cli
fpsolve.VibroImpactOscillator, fpsolve.ExponentSolver, fpsolve.tilted_density, fpsolve.sensitivities, fpsolve.boundary
slow = {"xarray", "pandas", "matplotlib", "IPython", "numba", "pyvista"}
print(sorted(({*slow, "h5netcdf", "h5py"} - {"pyvista"}) & set(sys.modules)))
assert fpsolve.cli.main(sys.argv[1:]) == 0
print(sorted(slow & set(sys.modules)))
"""


def test_nothing_that_takes_long_is_imported_at_the_start_nor_by_a_run_without_figures(tmp_path):
    (tmp_path / "case.toml").write_text(TEXT, encoding="utf-8")
    out, err = started(START, *shlex.split(f"run case.toml {FAST} --quiet"), cwd=tmp_path).communicate(timeout=100)
    before, written, after = out.splitlines()
    assert (before, after, err) == ("[]", "[]", "")
    assert written.startswith("written: ")
