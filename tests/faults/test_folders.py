"""What lies in the folder of a case: files of other parameters go, and what is none of fpsolve's harms nothing."""

import os
import shutil

import pytest

from tests.kit import LIST, case_text, files, put, run

SECTIONS = "[moments]\np = [2.0]\n[output]\nfigure = false\nquantities = ['lyapunov_exponent']\n"
CASE = case_text(SECTIONS + "[monte_carlo]\npaths = 6400\ntime = 20.0\n")
OF_RUN = {"summary.json", "moments.csv", "sets.csv", "results.nc"}
OF_COMMAND = {"run": OF_RUN, "simulate": {"monte_carlo.json"}}
OTHERS = {"chart.json", "chart.csv", "chart.png", "proof.json", "design.json"}
ALL = OF_RUN | OF_COMMAND["simulate"] | OTHERS
DRAWN = "figure.png", "eigenfunctions/p+2.0.vtu"


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A folder with a file of each kind, which agree with the case."""
    place = tmp_path_factory.mktemp("good")
    for command in ("run", "simulate"):
        ended = run(place, command, "case.toml", case=CASE)
        assert ended.code == 0, ended.err
    folder = place / "results/case"
    put(folder, "chart", *OTHERS)
    put(folder, "run", *DRAWN)
    return place


@pytest.fixture
def place(good, tmp_path):
    return shutil.copytree(good, tmp_path / "place", symlinks=True)


def after(place, command, *options):
    """The names of the files beside records that a command leaves, which goes on with what is known."""
    ended = run(place, command, "case.toml", *options)
    assert ended.code == 0, ended.err
    return {name for name in files(place / "results/case") if not name.startswith("records/")}


@pytest.mark.parametrize("command", OF_COMMAND)
def test_files_of_the_parameters_of_a_case_stay(place, command):
    assert after(place, command) >= ALL


@pytest.mark.parametrize("command", OF_COMMAND)
def test_files_that_no_list_names_are_nobodys_and_stay(place, command):
    """As those of a user do, of other parameters too; those that are written then are known from now on."""
    (place / "results/case" / LIST).unlink()
    assert after(place, command, "--set", "noise.r0=0.9") >= ALL
    assert ALL - after(place, "simulate", "--set", "noise.r0=0.8") == OF_COMMAND[command] - OF_COMMAND["simulate"]


@pytest.mark.parametrize("command", OF_COMMAND)
def test_files_of_an_earlier_run_with_other_parameters_are_removed(place, command):
    left = after(place, command, "--set", "noise.r0=0.9")
    assert left & ALL == OF_COMMAND[command]


def test_run_removes_the_responses_of_an_earlier_one_also_unfinished_and_no_file_of_another(place):
    folder = place / "results/case"
    stale = {"response.csv", "response.png", "response-10.pdf", "response.vtu", "response_3d-2.vtu"}
    own = {"response.txt", "my_response.csv", ".fpsolve-notes", "monte_carlo.png"}
    put(folder, "run", *stale)
    for name in (*own, ".fpsolve-response.csv"):
        (folder / name).touch()
    left = after(place, "run")
    assert not left & {*stale, ".fpsolve-response.csv"}
    assert left > own


def as_folder(path):
    path.unlink(missing_ok=True)
    path.mkdir(parents=True)


def as_link_to_elsewhere(path):
    path.parent.mkdir(exist_ok=True)
    shutil.rmtree(path, ignore_errors=True)
    elsewhere = path.parents[len(path.parts) - path.parts.index("place") - 2] / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "p+2.0.vtu").write_text("mine", encoding="utf-8")
    path.symlink_to(elsewhere)


def as_file(path):
    shutil.rmtree(path, ignore_errors=True)
    path.parent.mkdir(exist_ok=True)
    path.write_text("", encoding="utf-8")


IN_THE_WAY = [
    *[
        (name, as_folder, "cannot be written: Is a directory; choose another --out")
        for name in ("summary.json", "results.nc", *DRAWN)
    ],
    *[
        (name, block, f"{name} cannot be written to: it is no folder, or a link to one; choose")
        for name in ("records", "eigenfunctions", "eigenfunctions-2")
        for block in (as_link_to_elsewhere, as_file)
    ],
]


@pytest.mark.parametrize(("name", "block", "said"), IN_THE_WAY)
def test_what_is_in_the_way_of_a_file_or_a_folder_is_refused_before_anything_is_removed(place, name, block, said):
    block(place / "results/case" / name)
    before = files(place)
    ended = run(place, "run", "case.toml")
    assert ended.code == 2
    assert said in ended.err
    assert files(place) == before


@pytest.fixture
def nobody(place):
    """Whom the rights of files hold for, as they do not for root; the folder is theirs."""
    if os.geteuid():
        yield
        return
    for each in (place, *place.rglob("*")):
        os.chown(each, 65534, 65534)
    for each in place.parents[: len(place.parents) - 2]:
        each.chmod(0o755)
    os.seteuid(65534)
    yield
    os.seteuid(0)


@pytest.mark.usefixtures("nobody")
@pytest.mark.parametrize(("name", "mode", "code"), [("case/private", 0o000, 0), ("case", 0o555, 2)])
def test_folder_that_may_not_be_read_is_left_alone_and_a_read_only_one_is_refused(place, name, mode, code):
    folder = place / "results" / name
    folder.mkdir(exist_ok=True)
    folder.chmod(mode)
    ended = run(place, "run", "case.toml")
    folder.chmod(0o755)
    assert (ended.code, "cannot be written" in ended.err) == (code, bool(code))
    assert folder.exists()
