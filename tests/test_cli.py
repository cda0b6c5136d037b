"""The command line: exit codes, messages, and where they go."""

import errno
import io
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import pytest

from fpsolve import cli, run
from fpsolve.case.case import load_case
from fpsolve.case.sections import QUANTITY_NAMES
from fpsolve.cli import CLOSED_PIPE, INTERRUPTED, main
from fpsolve.commands.options import BAD_INPUT, CHECK_FAILED, NOT_CONVERGED
from fpsolve.exponent.error import digits
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.files import alone
from fpsolve.model.problem import Problem
from fpsolve.output import figures, tables
from fpsolve.study import solve
from tests.conftest import FIG1, FIG1_NOISE, heed_signals, sampled, started
from tests.kit import COSTLY, DRAWN, HOPELESS, LEAN, TABLES, TEXT, files, read_json

CASES = Path(__file__).parents[1] / "cases"
BARE = ["--set", "output.eigenfunctions=[]"]
NO_FIGURE = "output.figure=false"
WITH_FIGURE = ["--set", "output={ figure = true, eigenfunctions = [] }"]
COMMANDS = [["--help"], ["run", "test.toml", *WITH_FIGURE], ["mesh", "a.vtu"], ["check", "test.toml"], ["--version"]]


@pytest.fixture
def case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "test.toml"
    path.write_text(TEXT, encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """What a run prints and writes that is made once."""
    folder, out, err = tmp_path_factory.mktemp("shown"), io.StringIO(), io.StringIO()
    (folder / "test.toml").write_text(DRAWN, encoding="utf-8")
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        assert main(["run", "test.toml", "--all", "--table"]) == 0
    return SimpleNamespace(out=out.getvalue(), err=err.getvalue(), folder=folder / "results/test")


def test_run_prints_a_table_and_writes_the_results(shown):
    out, err = shown.out, shown.err
    for text in (
        "Λ(p)",
        "Eq. (37)",
        "difference",
        "noise.D0 = 0.1",
        "0.01416314365",
        "0.0141494",
        "written: results/test",
    ):
        assert text in out
    assert "\x1b" not in out
    assert "warning" not in err
    assert "summary.json" in files(shown.folder)


@pytest.mark.parametrize("wall", ["0.8", "1.0"])
def test_what_is_computed_unasked_is_cheap_and_the_rest_is_told_in_one_line(case, tmp_path, capsys, monkeypatch, wall):
    """One eigenfunction, of the first curve at the p next to 2, and nothing that takes a finer discretisation."""
    for place in COSTLY:
        monkeypatch.setattr(place, lambda *_, **__: pytest.fail("nobody has asked for it"))
    monkeypatch.setattr(ExponentSolver, "variance_rate", lambda _: pytest.fail("nobody has asked for it"))
    Path(case).write_text(TEXT.replace("eigenfunctions = [2.0]", ""), encoding="utf-8")
    assert (
        main(["run", case, "--set", f"oscillator.restitution={wall}", "--set", "moments.p=[-1.0, 1.5]", "--table"]) == 0
    )
    out, err = capsys.readouterr()
    assert all(f"│ {each} │" in out for each in ("     λ", "   δ_p", "     N", "   R_c"))
    told = [line for line in " ".join(err.split()).split("note: ") if "there are also" in line]
    names = "rate_function, variance_rate, critical_restitution, excursions, sensitivities, eigenfunctions"
    assert told == [f"test: there are also {names}: name them in [output] quantities, or --all"]
    written = files(tmp_path / "results/test")
    assert {name for name in written if name.endswith((".vtu", ".pvd"))} == {
        "eigenfunctions.pvd",
        "eigenfunctions/p+1.5.vtu",
    }


@pytest.mark.parametrize(
    ("sets", "more"),
    [
        (["expect=[{quantity='variance_rate', value=1.0, atol=1.0, source='x'}]"], ["variance_rate"]),
        (["output.sensitivities=true"], ["sensitivities"]),
        (["excursions={}"], ["excursions"]),
        (["output.eigenfunctions=[]"], []),
        (["oscillator.c2=0.1"], ["response"]),
        (["expect=[{quantity='response.energy', value=1.0, atol=1.0, source='x'}]"], ["response"]),
        (["uncertain={'noise.D0'=0.1}", "vary={}"], []),
    ],
)
def test_other_sections_name_quantities(case, sets, more):
    loaded = load_case(case, sets)
    cheap = {"moment", "lyapunov_exponent", "stability_index", "impact_rate", "critical_impact_factor"}
    pictures = [] if "output.eigenfunctions=[]" in sets else ["eigenfunctions"]
    assert {*loaded.asked} == cheap | {*more, *pictures}
    wanted = solve.everything(loaded)
    assert ("sensitivities" in wanted) == ("sensitivities" in more or bool(loaded.uncertain))
    assert ("excursions" in wanted) == ("excursions" in more)
    assert ("response" in wanted) == ("response" in more)


def test_out_and_set(case, tmp_path, capsys):
    assert (
        main(["run", case, "--out", "elsewhere", "--set", "moments.p=[1.0]", "--set", "output.eigenfunctions=[]"]) == 0
    )
    assert "summary.json" in files(tmp_path / "elsewhere/test")
    assert not (tmp_path / "results").exists()
    assert " 0.0002850955" in capsys.readouterr().out


def test_what_is_set_is_told_above_the_results(case, capsys, monkeypatch):
    drawn, make = [], figures.figure_for
    monkeypatch.setattr(figures, "figure_for", lambda _, title, *more: drawn.append(title) or make([], title, *more))
    sets = ["oscillator.omega = 2.0", "moments.p=[1.0]", "budget.seconds=9.0"]
    assert main(["run", case, *(f"--set={text}" for text in sets), *WITH_FIGURE]) == 0
    assert drawn == ["A test\nwith oscillator.omega = 2.0"]  # its values of p are on the axis
    told = " ".join(capsys.readouterr().out.split())
    assert told.startswith('A test with oscillator.omega = 2.0 noise.treatment = "ou-reduction": the noise is ')
    assert ", as Eqs. (12)-(14) reduce it. noise.D0 = 0.1: almost every path " in told
    assert main(["run", case, *WITH_FIGURE]) == 0
    assert drawn[1:] == ["A test"]


def test_each_index_has_a_row_with_its_error_and_perturbation_theory(shown):
    for symbol in ("λ", "δ_p", "Λ″(0)", "N", "R_c", "r_c"):
        number = r"-?\d+\.\d+(e-\d+)? │ +\de-\d+"
        row = rf"(?m)^│ \w[\w =]+ │ +{re.escape(symbol)} │ +{number} │ .* │ +-?\d\S*, Eq\. \(3\d\) │$"
        assert len(re.findall(row, shown.out)) == 2


@pytest.mark.parametrize(("c1", "words"), [("-0.8", "almost surely stable for every r in (0, 1]"), ("0.7", "unstable")])
def test_why_there_is_no_critical_restitution_is_a_note(case, tmp_path, capsys, c1, words):
    sets = [f"oscillator.c1={c1}", "noise.D0=0.1", "vary={}", "output.eigenfunctions=[]"]
    assert main(["run", case, "--all", *(f"--set={text}" for text in sets)]) == 0
    out, err = capsys.readouterr()
    assert re.search("r_c │ +none │", out)
    assert f"note: test: no r_c: {words}" in err
    assert "warning" not in err
    (curve,) = read_json(tmp_path / "results/test/summary.json")["curves"]
    assert curve["critical_restitution"] is None
    assert curve["critical_impact_factor"] > 0
    assert any(text.startswith(f"no r_c: {words}") for text in curve["notes"])


def test_impacts_can_be_expected(case, tmp_path, capsys):
    """Values of Eq. (39), and the sentence for one that does not exist."""
    expected = {"impact_rate": 0.31831, "critical_impact_factor": 0.9964999, "critical_restitution": 0.6494}
    text = TEXT.replace('[vary]\n"noise.D0" = [0.1, 1.0]\n', "")
    for name, value in expected.items():
        text += f'[[expect]]\nquantity = "{name}"\nvalue = {value}\nrtol = 5e-3\nsource = "Eq. (39)"\n'
    (tmp_path / "impacts.toml").write_text(text, encoding="utf-8")
    assert main(["check", "impacts.toml"]) == 0
    assert "3 of 3 ok" in capsys.readouterr().out
    assert main(["check", "impacts.toml", "--set", "oscillator.c1=-0.8"]) == CHECK_FAILED
    out, err = capsys.readouterr()
    assert "none" in out
    assert "no r_c: almost surely stable" in err


@pytest.mark.parametrize("word", ["noise.D0=0.2", "mesh.file=a/b.vtu", "vary.noise.D0=[1, 2]", f"title={'x' * 400}"])
def test_set_takes_one_assignment(case, word, capsys):
    assert main(["check", case, "--set", "oscillator.omega=2", word]) == BAD_INPUT
    said = capsys.readouterr().err.strip()
    shown = f"'{word}'" if "[" in word else word
    remedy = f"each --set takes one assignment: write --set oscillator.omega=2 --set {shown}"
    assert said == f"{word}: no such file; {remedy}"


def test_a_stray_assignment_is_told_with_all_others(case, capsys):
    stated = ["--set", "oscillator.omega=2", "--set", "noise.tau0=0.3"]
    assert main(["check", case, *stated, "noise.D0=0.2"]) == BAD_INPUT
    assert capsys.readouterr().err.strip().endswith(f"write {' '.join(stated)} --set noise.D0=0.2")


def test_a_case_may_have_an_equals_sign_in_its_name(case, tmp_path, capsys):
    (tmp_path / "a=1.toml").write_text("title = 1", encoding="utf-8")
    assert main(["check", "a=1.toml"]) == BAD_INPUT
    assert "a=1.toml:1: title: got 1" in capsys.readouterr().err


def test_what_refers_to_other_p_can_be_left_out(capsys):
    """As the messages say."""
    command = ["check", str(CASES / "fig1.toml"), "--set", "moments.p=[1.5]", "--set", "vary={}"]
    assert main(command) == BAD_INPUT
    err = capsys.readouterr().err
    remedies = set(re.findall(r"or remove it by --set '(.+)'", err))
    assert remedies == {"output.eigenfunctions=[]", "expect=[]"}
    assert all("or remove it by" in line for line in err.splitlines())
    assert main([*command, *(f"--set={remedy}" for remedy in remedies)]) == 0


def test_the_help_tells_of_every_linear_system(capsys):
    assert main(["--help"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "linear systems under random loads" in told
    assert "[system]" in told


@pytest.mark.parametrize("command", ["run", "check", "simulate"])
def test_the_help_names_the_units(command, capsys):
    assert main([command, "--help"]) == 0
    told = " ".join(re.sub("[│╭╮╰╯─]", " ", capsys.readouterr().out).split())
    units = dict(re.findall(r"(\w+) in ([\w/]+)", told.partition("Units: ")[2].partition(".")[0]))
    keys = {"omega": "oscillator", "c1": "oscillator", "D0": "noise", "tau0": "noise"}
    known = Problem(FIG1, FIG1_NOISE).parameters
    assert units == {key: known[f"{section}.{key}"].quantity.unit for key, section in keys.items()}


def test_set_takes_negative_values(case):
    assert main(["check", case, "--set", "oscillator.c1=-0.2"]) == 0


def test_a_figure_over_a_parameter_prints_one_row_a_curve(case, capsys):
    overrides = ['figure={ x = "noise.D0", y = "lyapunov_exponent" }', "output.eigenfunctions=[]"]
    assert main(["run", case, "--set", overrides[0], "--set", overrides[1]]) == 0
    out = capsys.readouterr().out
    assert "…" not in out
    for text in ("D0", "λ", "Eq. (39)", "δ_p", "Eq. (38)", "0.0010839"):
        assert text in out


def test_check_exits_1_when_a_value_differs(case, tmp_path, capsys):
    good = '[[expect]]\nquantity = "moment"\np = 0.0\nvalue = 0.0\natol = 1e-12\nsource = "conservation"\n'
    (tmp_path / "good.toml").write_text(TEXT + good, encoding="utf-8")
    (tmp_path / "bad.toml").write_text(TEXT + good.replace("value = 0.0", "value = 1.0"), encoding="utf-8")
    assert main(["check", "good.toml"]) == 0
    assert "ok" in capsys.readouterr().out
    assert main(["check", "good.toml", "bad.toml"]) == CHECK_FAILED
    out = capsys.readouterr().out
    assert "differs" in out
    assert "conservation" in out
    assert not (tmp_path / "results").exists()


def test_titles_and_sources_are_plain_text(tmp_path, capsys):
    expect = "[[expect]]\nquantity = 'moment'\np = 0.0\nvalue = 0.0\natol = 1e-12\nsource = 'in [/x] of [vary]'\n"
    (tmp_path / "plain.toml").write_text(TEXT.replace("A test", "see [/b] of [vary]") + expect, encoding="utf-8")
    assert main(["check", str(tmp_path / "plain.toml")]) == 0
    out = capsys.readouterr().out
    assert "see [/b] of [vary]" in out
    assert "in [/x] of [vary]" in out


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "a\x1b[31mb.toml"],
        ["check", "\x1b[31m.toml"],
        ["check", "test.toml", "--set", "oscillator.\x1bomega=2.0"],
        ["check", "test.toml", "--set", "omega\x9b=2.0"],
        ["check", "test.toml", "--set", "oscillator.omega=2.0 # \u202e"],
        ["check", "test.toml", "--\x1b"],
        ["prove", "--check", "\x1b.json"],
        ["mesh", "\x1b.vut"],
        ["ru\x1b"],
        ["mesh", "\x1b.vtu"],
    ],
)
def test_control_characters_are_shown_and_not_printed(case, capsys, arguments):
    Path("a\x1b[31mb.toml").write_text(TEXT, encoding="utf-8")
    code, printed = main(arguments), "".join(capsys.readouterr())
    assert code == (0 if arguments[-1] == "\x1b.vtu" else BAD_INPUT)
    assert any(text in printed for text in (r"\x1b", r"\x9b", r"\u202e"))
    assert printed.replace("\n", "").isprintable()


def test_a_folder_with_control_characters_is_shown(case, capsys):
    assert main(["run", case, "--out", "a\x1bb", "--set", LEAN]) == 0
    printed = "".join(capsys.readouterr())
    assert r"written: a\x1bb" in printed
    assert printed.replace("\n", "").isprintable()


def test_check_says_when_a_case_expects_nothing(case, capsys):
    assert main(["check", case]) == 0
    assert "nothing is expected; add [[expect]]" in capsys.readouterr().out


def test_faults_of_all_cases_are_listed_and_nothing_is_written(case, tmp_path, capsys):
    (tmp_path / "bad.toml").write_text(TEXT.replace("omega = 1.0", "omega = -1.0"), encoding="utf-8")
    assert main(["run", case, "bad.toml", "missing.toml"]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert "bad.toml:5: oscillator.omega: got -1.0" in err
    assert "missing.toml" in err
    assert "Traceback" not in err
    assert out == ""
    assert not (tmp_path / "results").exists()


def test_namesakes_are_refused(case, tmp_path, capsys):
    (tmp_path / "other").mkdir()
    (tmp_path / "other/test.toml").write_text(TEXT, encoding="utf-8")
    assert main(["run", case, "other/test.toml"]) == BAD_INPUT
    assert 'several cases are called "test"' in capsys.readouterr().err


def test_not_converged_exits_3_with_the_partial_results(case, capsys):
    assert main(["run", case, "--set", "oscillator.epsilon=1.5", "--set", HOPELESS]) == NOT_CONVERGED
    out, err = capsys.readouterr()
    assert "use more cells" in err
    assert "written: results/test" in out


def test_infinite_moments_exit_2(case, tmp_path, capsys):
    assert (
        main(["run", case, "--set", "noise.treatment='exact'", "--set", "noise.r0=1.1", "--set", "vary={}"])
        == BAD_INPUT
    )
    assert "Λ(2) is not computed" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


def test_unwritable_output_exits_2(case, capsys):
    assert main(["run", case, "--out", "/proc/none"]) == BAD_INPUT
    assert "choose another --out" in capsys.readouterr().err


def test_a_folder_in_use_exits_2(case, tmp_path, capsys):
    with alone(tmp_path / "results/test"):
        assert main(["run", case]) == BAD_INPUT
    out, err = capsys.readouterr()
    message = "results/test is being written by another run; wait for it, or choose another --out"
    assert err == f"{message}\n"
    assert out == ""


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (1, "interrupted after 0 of 2 curves; what was done is kept in results/test; run it again to go on"),
        (2, "interrupted after 1 of 2 curves; what was done is kept in results/test; run it again to go on"),
    ],
)
def test_an_interrupted_run_says_what_is_kept(case, tmp_path, capsys, monkeypatch, number, message):
    original = solve.solve_curve

    def interrupted(curve, wanted, numerics, _, *more):
        def progress():
            if curve.number == number:
                raise KeyboardInterrupt

        return original(curve, wanted, numerics, progress, *more)

    monkeypatch.setattr(solve, "solve_curve", interrupted)
    assert main(["run", case, "--jobs", "1"]) == INTERRUPTED
    assert capsys.readouterr().err.strip() == message
    assert "summary.json" in files(tmp_path / "results/test")


def raising(failure):
    def fail(*_, **__):
        raise failure

    return fail


LONG = """
import sys
from fpsolve.cli import main
from fpsolve.study import solve

def wait(*_):
    print("begun", flush=True)
    sys.stdin.read()

solve.solve_curve = wait
sys.exit(main(sys.argv[1:]))
"""


def begin(case, prepare=heed_signals):
    """A run in another process, which solves its first curve for as long as one likes."""
    process = started(LONG, "run", case, before=prepare, stdin=subprocess.PIPE)
    try:
        assert process.stdout.readline() == "begun\n"
    except BaseException:
        process.kill()
        raise
    return process


@pytest.mark.parametrize("name", sampled("SIGTERM", "SIGHUP"))
def test_signals_end_a_run_as_ctrl_c_does(case, tmp_path, name):
    with begin(case) as process:
        try:
            process.send_signal(getattr(signal, name))
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 128 + getattr(signal, name)
    assert "interrupted" in err
    assert "Traceback" not in err
    assert files(tmp_path / "results/test") == TABLES


def test_a_second_signal_does_not_hinder_the_message(case, capsys, monkeypatch):
    original = cli.print_error

    def interrupted(text):
        signal.raise_signal(signal.SIGHUP)
        original(text)

    monkeypatch.setattr(solve, "solve_curve", lambda *_: signal.raise_signal(signal.SIGTERM))
    monkeypatch.setattr(cli, "print_error", interrupted)
    assert main(["run", case]) == 128 + signal.SIGTERM
    assert capsys.readouterr().err == "interrupted after 0 of 2 curves; run it again to go on\n"


SIGNAL_IN_VTK = """
import signal, sys
from fpsolve.cli import main

def interrupt(frame, *_):
    if "/vtkmodules/" in frame.f_code.co_filename and frame.f_code.co_name == "on_vtk_module_init":
        sys.setprofile(None)
        signal.raise_signal(int(sys.argv[1]))

sys.setprofile(interrupt)
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGTERM"])
def test_a_signal_while_vtk_is_loaded_ends_a_run_in_order(case, tmp_path, name):
    """Its compiled modules crash where a signal raises an exception in their initialisation."""
    number = getattr(signal, name)
    command = [sys.executable, "-c", SIGNAL_IN_VTK, str(int(number)), "run", case]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, preexec_fn=heed_signals)
    assert done.returncode == 128 + number
    assert done.stderr == "interrupted after 0 of 2 curves; run it again to go on\n"
    assert files(tmp_path / "results/test") == TABLES


@pytest.mark.slow
def test_an_ignored_signal_stays_ignored(case):
    """So that nohup works."""
    with begin(case, lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)) as process:
        try:
            process.send_signal(signal.SIGHUP)
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=1)
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 128 + signal.SIGTERM


def test_handlers_are_restored():
    before = [signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGTERM)]
    assert main(["--version"]) == 0
    assert [signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGTERM)] == before


def command_line(arguments, unbuffered="", stderr=subprocess.PIPE, **options):
    """The program in another process."""
    command, environment = (
        [sys.executable, "-m", "fpsolve.cli", *arguments],
        os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )
    return subprocess.run(command, env=environment, stderr=stderr, text=True, check=False, timeout=100, **options)


@pytest.mark.parametrize(
    ("arguments", "unbuffered"),
    sampled(*((command, "") for command in COMMANDS), (COMMANDS[3], "1")),
)
def test_a_full_output_is_said_in_one_sentence(case, tmp_path, arguments, unbuffered):
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = command_line(arguments, unbuffered, stdout=full)
    assert done.returncode == BAD_INPUT
    assert done.stderr == "the output cannot be written: No space left on device; send it to another place\n"
    if arguments[0] == "run":
        assert {"summary.json", "figure.png", "figure.pdf"} <= files(tmp_path / "results/test")


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (
            OSError(errno.ENOSPC, "No space left on device", "cache/a.nbi"),
            "cache/a.nbi cannot be written: No space left",
        ),
        (OSError("encoder error"), "the output cannot be written: encoder error; send it to another place\n"),
    ],
)
def test_any_failure_to_write_is_said_in_one_sentence(case, capsys, monkeypatch, failure, said):
    monkeypatch.setattr(solve, "solve_curve", raising(failure))
    assert main(["check", case]) == BAD_INPUT
    err = capsys.readouterr().err
    assert err.startswith(said)
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "unbuffered"),
    sampled((["--version"], ""), (["--help"], "1"), (["check", "test.toml"], ""), (["check", "test.toml"], "1")),
)
def test_a_closed_pipe_ends_a_command_quietly(case, arguments, unbuffered):
    read, write = os.pipe()
    os.close(read)
    try:
        done = command_line(arguments, unbuffered, stdout=write)
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (CLOSED_PIPE, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code"),
    sampled((["nonsense"], BAD_INPUT), (["run", "test.toml", "--set", LEAN], 0), (["run", "none.toml"], BAD_INPUT)),
)
def test_full_errors_keep_the_exit_code(case, tmp_path, arguments, code):
    """A run goes on without them."""
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = command_line(arguments, stderr=full, stdout=subprocess.DEVNULL)
    assert done.returncode == code
    assert (tmp_path / "results/test/results.nc").exists() == (code == 0)


def test_a_lost_working_folder_exits_2(case, tmp_path):
    code = f"import os, sys; os.rmdir(os.getcwd()); from fpsolve.cli import main; sys.exit(main(['check', {case!r}]))"
    (tmp_path / "gone").mkdir()
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path / "gone", capture_output=True, text=True, check=False
    )
    assert done.returncode == BAD_INPUT
    assert done.stderr == "the working folder does not exist any more; change to another folder\n"


@pytest.mark.slow
def test_a_short_interval_gives_a_warning(case, capsys):
    assert main(["run", case, "--set", "mesh={ xi_min = -4.0, xi_max = 4.0 }"]) == NOT_CONVERGED
    err = capsys.readouterr().err
    assert "not converged: test, noise.D0 = 0.1: no δ_p" in err  # whose error leaves it no digit
    assert "warning: test, noise.D0 = 1: rtol = 1e-08 is not met" in err
    assert "[mesh] phi_cells, xi_cells" in err


def test_mesh_writes_a_file_that_a_case_can_name(case, tmp_path, capsys):
    assert (
        main(["mesh", "sub/graded.vtu", "--phi-cells", "3", "--xi-cells", "6", "--grading", "2", "--xi-min", "-7"]) == 0
    )
    assert "written: sub/graded.vtu (18 cells, 1815 unknowns)" in capsys.readouterr().out
    assert main(["check", case, "--set", 'mesh.file="sub/graded.vtu"']) == 0


def test_exact_noise_says_that_the_theory_is_for_the_reduced_one(case, capsys):
    assert main(["run", case, "--set", "noise.treatment=exact", "--table", *BARE]) == 0
    out = capsys.readouterr().out
    assert "Eq. (37)*" in out
    assert "* for the noise reduced by Eqs. (12)-(14)" in out


def test_impossible_meshes_exit_2(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for arguments in (["mesh", "a.vtu", "--phi-cells", "0"], ["mesh", "a.stl"], ["mesh", "a.vtu", "--xi-min", "1"]):
        assert main(arguments) == BAD_INPUT
        assert "Traceback" not in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments", [["run"], ["bogus"], ["run", "a.toml", "--no-such-option"], ["mesh", "a.vtu", "--phi-cells", "x"]]
)
def test_wrong_usage_exits_2(arguments, capsys):
    assert main(arguments) == BAD_INPUT
    assert "Error" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["run", "check", "mesh"])
def test_help_shows_an_example(command, capsys):
    assert main([command, "--help"]) == 0
    assert f"Example: fpsolve {command} " in capsys.readouterr().out


def test_help_and_reference_name_all_quantities(capsys):
    assert main(["run", "--help"]) == 0
    words = capsys.readouterr().out.split()
    page = (CASES.parent / "docs/reference/cases.md").read_text(encoding="utf-8")
    assert {*QUANTITY_NAMES} <= {word.strip(",.") for word in words}
    assert {*QUANTITY_NAMES, "all"} == {*re.findall(r'"(\w+)"', re.search(r"(?ms)^quantities = \[.*?^\]", page)[0])}


def test_help_names_the_exit_codes(capsys):
    assert main(["--help"]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert all(
        f"{code}" in words
        for code in (
            "0 success",
            "1 a checked value differs or a design is out of reach",
            "2 bad input",
            "3 not converged",
        )
    )
    assert "130 interrupted" in words


def test_version(capsys):
    from importlib.metadata import version

    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == f"fpsolve {version('fpsolve')}"


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.0141631436533, 9e-13, "0.0141631436533"),
        (0.0141631436533, 1e-6, "0.014163"),
        (-123.456, 0.1, "-123.5"),
        (1e-17, 1e-15, "0"),
        (2.0, 0.0, "2.000000000000"),
    ],
)
def test_digits_are_those_that_the_error_leaves(value, error, text):
    assert digits(value, error) == text


IMPOSSIBLE = [
    "oscillator.epsilon=1.0", "noise.D0=1.0", "moments.p=[2.0]", "moments.rtol=1e-12", "budget.unknowns=1000",
]  # fmt: skip


def test_an_exhausted_budget_exits_3_with_the_best_value(tmp_path, capsys):
    sets = [word for text in (*IMPOSSIBLE, "expect=[]", NO_FIGURE) for word in ("--set", text)]
    assert main(["run", str(CASES / "minimal.toml"), *sets, "--out", str(tmp_path)]) == NOT_CONVERGED
    err = capsys.readouterr().err
    assert "not converged: minimal: Λ(2) did not converge: the next mesh has" in err
    assert "more than budget.unknowns = 1000; best value 3.429" in err
    assert "an estimated error of" in err


def test_theories_outside_their_range_are_noted(tmp_path, capsys):
    stated = ("oscillator.epsilon=1.0", "noise.r0=0.7", "noise.D0=1.0", "moments.rtol=1e-6", NO_FIGURE)
    sets = [f"--set={text}" for text in stated]
    assert main(["run", str(CASES / "minimal.toml"), *sets, "--out", str(tmp_path)]) == 0
    err = " ".join(capsys.readouterr().err.split())
    assert "note: minimal: the Ornstein-Uhlenbeck reduction is meant for r0 near 1, but |r0 - 1| = 0.3 > 0.1" in err
    assert "note: minimal: perturbation theory, Eq. (37), is for weak noise" in err
    capsys.readouterr()
    assert main(["check", str(CASES / "minimal.toml"), *sets]) == CHECK_FAILED
    assert (
        "perturbation theory, Eq. (37), is for weak noise" not in capsys.readouterr().err
    )  # a check shows no Eq. (37)


def test_json_prints_the_summary_and_nothing_else(case, tmp_path, capsys):
    assert main(["run", case, "--json", "--set", LEAN]) == 0
    out, err = capsys.readouterr()
    assert out.count("\n") == 1
    assert json.loads(out) == read_json(tmp_path / "results/test/summary.json")
    assert err == ""


def test_traceback_shows_where_an_error_was_raised(tmp_path, capsys):
    command = ["run", str(tmp_path / "nothing.toml")]
    assert main(command) == BAD_INPUT
    plain = capsys.readouterr().err
    assert "Traceback" not in plain
    assert main([*command, "--traceback"]) == BAD_INPUT
    traced = capsys.readouterr().err
    assert traced.startswith("Traceback")
    assert traced.endswith(plain)


def test_a_run_where_there_is_no_command_line(tmp_path, monkeypatch):
    """As where Python is embedded."""
    monkeypatch.setattr(sys, "argv", [])
    run(CASES / "minimal.toml", tmp_path)
    assert read_json(tmp_path / "minimal/summary.json")["complete"]


def test_many_curves_leave_their_numbers_to_results_nc(case, tmp_path, monkeypatch, capsys):
    """summary.json has state and messages of each; the next command still knows whose files these are."""
    sets = ["--set", 'vary={ "noise.treatment" = ["ou-reduction", "exact"], "oscillator.epsilon" = [0.1, 0.2] }']
    sets += ["--set", "output={ figure = false, quantities = ['moment', 'sensitivities'] }"]
    sets += ["--set", "moments={ p = [2.0], rtol = 1e-3 }"]
    command = ["run", case, "--json", *sets]
    assert main(command) == 0
    few = json.loads(capsys.readouterr().out)
    monkeypatch.setattr(tables, "MOST_SUMMARISED", 3)
    assert main(command) == 0
    many = json.loads(capsys.readouterr().out)
    known = {"command", "started", "wall_seconds"}
    assert {**few, **dict.fromkeys(known)} == {**many, **dict.fromkeys(known)}
    written = read_json(tmp_path / "results/test/summary.json")
    told = {"varied", "status", "sensitivities", "warnings", "notes"}
    assert written["curves"] == [{key: each[key] for key in told} for each in few["curves"]]
    assert any(each["notes"] for each in written["curves"])
    for short, each in zip(written["curves"], few["curves"], strict=True):
        assert written["parameters"] | short["varied"] == each["parameters"]
    assert main(["simulate", case, *sets, "--paths", "64", "--time", "20"]) == 0
    assert "summary.json" in files(tmp_path / "results/test")
    assert main(["simulate", case, *sets, "--paths", "64", "--time", "20", "--set", "noise.tau0=0.6"]) == 0
    assert "summary.json" not in files(tmp_path / "results/test")


def test_json_of_several_cases_is_a_line_each_and_warnings_are_apart(case, tmp_path, capsys):
    (tmp_path / "other.toml").write_text(TEXT.replace("A test", "Another\\n test"), encoding="utf-8")
    sets = ["--set", "output.quantities=['moment', 'lyapunov_exponent']", "--set", "output.eigenfunctions=[]"]
    hopeless = ["--set", HOPELESS, "--set", "oscillator.epsilon=1.5"]
    assert main(["run", case, "other.toml", "--json", *sets, *hopeless]) == NOT_CONVERGED
    out, err = capsys.readouterr()
    assert [json.loads(line)["title"] for line in out.splitlines()] == ["A test", "Another\n test"]
    assert "not converged: other" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--jobs", "0"], "jobs: got 0; must be a whole number from 1 to 1000"),
        (["--jobs", "-3"], "jobs: got -3; must be a whole number from 1 to 1000"),
        (["--jobs", "2", "--scheduler", "tcp://host:8786"], "name one of them"),
        (["--scheduler", "host"], "scheduler: got 'host'; must be an address such as tcp://host:8786"),
        (["--jobs", "2.5"], 'got "2.5"; must be a whole number'),
    ],
)
@pytest.mark.parametrize("command", ["run", "check", "simulate"])
def test_bad_workers(case, tmp_path, capsys, command, options, message):
    assert main([command, case, *options]) == BAD_INPUT
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "results").exists()


LAST = re.compile(r"written: results/test \(2 curves, [\d.]+ s(; \d of 2 known from an earlier run)?\)")


def test_the_last_line_tells_the_folder_the_time_and_what_was_known(case, capsys):
    known = []
    for arguments in ([], [], ["--fresh"]):
        assert main(["run", case, "--set", LEAN, *arguments]) == 0
        last = capsys.readouterr().out.splitlines()[-1]
        known.append(LAST.fullmatch(last)[1])
    assert known == [None, "; 2 of 2 known from an earlier run", None]


@pytest.mark.parametrize(
    ("command", "last"),
    [
        (["run"], "written: results/test (2 curves, "),
        (["simulate", "--paths", "32", "--time", "60"], "written: results/test (2 curves, "),
        (["check"], "test: 0 of 0 ok"),
    ],
)
def test_quiet_prints_the_last_line_alone(case, capsys, command, last):
    sets = ["--set", "oscillator.epsilon=1.0", "--set", LEAN]
    assert main([command[0], case, *command[1:], *sets, "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(last)
    assert (out.count("\n"), err) == (1, "")


def test_quiet_tells_what_is_not_converged(case, capsys):
    assert main(["run", case, "--quiet", "--set", "oscillator.epsilon=1.5", "--set", HOPELESS]) == NOT_CONVERGED
    out, err = capsys.readouterr()
    assert re.fullmatch(r"written: results/test \(2 curves, \d not converged, [\d.]+ s\)\n", out)
    assert err
    assert all(line.startswith("not converged: test") for line in err.splitlines())


def test_quiet_with_json_prints_json_alone(case, capsys):
    assert main(["run", case, "--quiet", "--json", "--set", "oscillator.epsilon=1.0", "--set", LEAN]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["done"] == 2
    assert err == ""


@pytest.mark.parametrize("command", ["run", "check"])
def test_an_output_in_ascii_has_question_marks_for_greek(case, command, monkeypatch):
    streams = {name: io.TextIOWrapper(io.BytesIO(), encoding="ascii") for name in ("stdout", "stderr")}
    for name, stream in streams.items():
        monkeypatch.setattr(sys, name, stream)
    assert main([command, case, *BARE, *["--table"] * (command == "run")]) == 0
    monkeypatch.undo()
    out, err = (streams[name].buffer.getvalue() for name in ("stdout", "stderr"))
    assert b"Traceback" not in err
    if command == "run":
        assert b"| ? | 0.0010875697504 | " in b" ".join(out.split())
        assert b"?(p)" in out


@pytest.mark.parametrize(
    ("module", "name", "message"),
    [
        ("fpsolve.workflow.cases", "Sweep", "interrupted before the first curve"),
        (
            "fpsolve.workflow.sets",
            "write_dataset",
            "interrupted after 2 of 2 curves; what was done is kept in results/test",
        ),
        ("fpsolve.page.terminal", "print_blocks", "interrupted; what was solved is kept in results/test"),
        ("fpsolve.show.results", "write_figures", "interrupted; what was solved is kept in results/test"),
    ],
)
def test_an_interrupt_says_what_is_kept_in_every_phase(case, capsys, monkeypatch, module, name, message):
    monkeypatch.setattr(f"{module}.{name}", raising(KeyboardInterrupt))
    assert main(["run", case, "--jobs", "1", *BARE]) == INTERRUPTED
    assert capsys.readouterr().err.splitlines()[-1] == f"{message}; run it again to go on"


def test_an_interrupted_check_starts_over(case, capsys, monkeypatch):
    monkeypatch.setattr(solve, "solve_curve", raising(KeyboardInterrupt))
    assert main(["check", case, "--jobs", "1"]) == INTERRUPTED
    assert capsys.readouterr().err == "interrupted after 0 of 2 curves; run it again to start over\n"
