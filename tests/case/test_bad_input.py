"""Case files that are wrong: one message for each fault, with file, line, key, value, range and remedy."""

from __future__ import annotations

import itertools
import math
import os
import re
import time
import tracemalloc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fpsolve.case.case import load_case
from fpsolve.case.toml import Scanner
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT
from fpsolve.errors import CaseError
from fpsolve.fem.mesh import make_mesh, write_mesh
from fpsolve.simulation.setup import default_step, obstacles, transient
from tests.conftest import sampled
from tests.snapshots import good

GOOD = good("bad")


def refused(path: Path, overrides: Sequence[str] = ()) -> CaseError:
    with pytest.raises(CaseError) as raised:
        load_case(path, overrides)
    assert raised.value.file == str(path)
    return raised.value


def only_message(path: Path, overrides: Sequence[str] = ()) -> str:
    error = refused(path, overrides)
    assert len(error.faults) == 1, str(error)
    return str(error)


def edited(old: str, new: str) -> str:
    assert f"\n{GOOD}".count(f"\n{old}\n") == 1, old
    return f"\n{GOOD}".replace(f"\n{old}\n", f"\n{new}\n")[1:]


def line_of(text: str, key: str) -> int:
    """Where a key like expect[0].p stands, or else its section."""
    section, *names = re.findall(r'"[^"]+"|\w+', re.sub(r"\[\d+\]", "", key))
    lines = text.splitlines()
    header = next(i for i, line in enumerate(lines) if re.match(rf"\[*{section}\b", line))
    for i, line in enumerate(itertools.takewhile(lambda line: line[:1] != "[", lines[header + 1 :])):
        if names and line.startswith(f"{names[0]} ="):
            return header + 2 + i
    return header + 1


def write(folder: Path, text: str) -> Path:
    path = folder / "bad.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("omega = 1.0", f"omega = 0x{'f' * 9000}", ":4: oscillator.omega: got a value too long to show"),
        ('title = "good"', "title = " + "[" * 5000, "nested too deeply"),
        ('title = "good"', "title = " + "1" * 5000, "integer string conversion"),
    ],
    ids=["hexadecimal", "nested", "decimal"],
)
def test_what_is_too_long_to_show(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert words in only_message(write(tmp_path, edited(old, new)))


@pytest.mark.slow
def test_blanks_are_passed_without_memory() -> None:
    tracemalloc.start()
    Scanner("\n" * 10**6).scan()
    assert tracemalloc.get_traced_memory()[1] < 10**8  # the places of line ends; it was twice that
    tracemalloc.stop()


def test_an_override_of_two_lines(tmp_path: Path) -> None:
    message = only_message(write(tmp_path, GOOD), ["noise.tau0=0.4", "a=1\nb=2"])
    assert message.startswith(f"{tmp_path / 'bad.toml'}: --set a=1\nb=2: must be one key=value, but there are 2 here")


@pytest.mark.parametrize(
    "lines",
    [
        'title = "Mine"\nwidth = "single column"\nxlim = [-1, 2.5]\nylim = [-1e-3, 1e-3]\nmark = []',
        'mark = ["lyapunov_exponent", "stability_index"]\nmap = false',
    ],
)
def test_a_good_case_and_its_figure(tmp_path: Path, lines: str) -> None:
    assert load_case(write(tmp_path, GOOD)).title == "good"
    figure = load_case(write(tmp_path, edited('y = "moment"', f'y = "moment"\n{lines}'))).figure
    assert set(figure.model_fields_set) == {"x", "y", *re.findall(r"^(\w+) = ", lines, re.MULTILINE)}


def without(section: str) -> str:
    before, _, rest = GOOD.partition("[[expect]]" if section == "expect" else f"[{section}]")
    return before + rest[rest.find("\n[") + 1 :] if "\n[" in rest else before


TOO_MANY = f"[{', '.join(f'0.{i:06}' for i in range(1, 100_002))}]"


@pytest.mark.slow
def test_too_long_lists(tmp_path: Path) -> None:
    text = GOOD + f"[monte_carlo]\np = {TOO_MANY}\n"
    text = text.replace('"noise.D0" = [0.1, 0.5]', f'"noise.D0" = {TOO_MANY}')
    faults = {fault.key: fault for fault in refused(write(tmp_path, text)).faults}
    assert faults.keys() == {'vary."noise.D0"', "monte_carlo.p"}
    for fault in faults.values():
        assert fault.sentence == "lists 100001 numbers; must be at most 100000; list fewer"
        assert fault.line


@pytest.mark.slow
def test_the_longest_lists_take_no_longer_than_reading_them(tmp_path: Path) -> None:
    """Within seconds; comparing all pairs would take minutes."""
    longest = TOO_MANY.replace(", 0.100001", "")
    text = GOOD[: GOOD.index("[vary]")].replace("p = [-1.0, 1.0, 2.0]", f"p = {longest}")
    started = time.process_time()
    case = load_case(write(tmp_path, f"{text}[output]\neigenfunctions = {longest}\n"))
    assert time.process_time() - started < 20
    assert case.p.size == len(case.output.eigenfunctions or ()) == 100_000


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Log-uniformly, and the ends."""
    inner = st.floats(math.log10(low), math.log10(high)).map(lambda power: min(max(10.0**power, low), high))
    return st.sampled_from([low, high]) | inner


def either_sign(low: float, high: float) -> st.SearchStrategy[float]:
    return st.tuples(st.sampled_from([-1, 1]), between(low, high)).map(math.prod)


WIDE = between(1e-15, 1e15)
SIMULATED = ("monte_carlo.p", "monte_carlo.time", "monte_carlo.step")


@pytest.mark.slow
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    numbers=st.fixed_dictionaries(
        {"omega": WIDE, "D0": WIDE, "tau0": WIDE, "epsilon": between(1e-12, 1e6), "c1": either_sign(5e-324, 1e15)}
        | {"c2": between(5e-324, 1e15), "c3": between(5e-324, 1e15), "restitution": between(5e-324, 1.0)}
        | {
            "r0": st.floats(-1e6, math.nextafter(5 / 3, 0), exclude_max=True)
            | either_sign(1e-16, 0.5).map(lambda part: 1 - part)
        }
    ),
    words=st.tuples(st.sampled_from(["delta", "restitution"]), st.sampled_from(["exact", "ou-reduction"])),
    p=either_sign(5e-324, 1e308),
    settings_of_time=st.tuples(between(5e-324, 1e308), between(5e-324, 1e308)) | st.none(),
)
def test_any_parameters_in_their_ranges_give_a_case_or_messages(
    tmp_path: Path,
    numbers: dict[str, float],
    words: tuple[str, str],
    p: float,
    settings_of_time: tuple[float, float] | None,
) -> None:
    """And what is said of the simulation of its curves; without obstacles its steps and its length are numbers."""
    text = GOOD[: GOOD.index("[vary]")]
    for key, value in numbers.items():
        text = re.sub(rf"^{key} = .*", f"{key} = {value!r}", text, flags=re.MULTILINE)
    text = re.sub(r"^p = .*", f"p = [{p!r}]", text, flags=re.MULTILINE)
    text = text.replace('"delta"', f'"{words[0]}"').replace('"ou-reduction"', f'"{words[1]}"')
    if settings_of_time:
        text += "[monte_carlo]\ntime = {!r}\nstep = {!r}\n".format(*settings_of_time)
    path = write(tmp_path, text)
    try:
        case = load_case(path)
    except CaseError:
        assert {fault.key for fault in refused(path).faults} <= {"oscillator", "moments", *SIMULATED}
        return
    [curve] = case.curves()
    if not obstacles(curve.oscillator, curve.noise, time=case.monte_carlo.time, step=case.monte_carlo.step):
        lengths = transient(curve.oscillator, curve.noise), default_step(curve.oscillator, curve.noise)
        assert all(0 < length < math.inf for length in lengths)


@pytest.mark.parametrize(
    ("start", "parts"), sampled(("vary", 300), ("a", 300), ("mesh.file", 300), ("mesh.file", 3000), keep=3)
)
def test_very_long_dotted_key(tmp_path: Path, start: str, parts: int) -> None:
    long = f"{start}{'.a' * parts} = 1"
    path = write(tmp_path, f"{long}\n{without(start.partition('.')[0]) if start != 'a' else GOOD}")
    assert refused(path).faults
    assert refused(write(tmp_path, GOOD), [long]).faults


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ": is empty|cases/minimal.toml"),
        (b" \n\t\n", ": is empty|cases/minimal.toml"),
        (b"\xef\xbb\xbf" + GOOD.encode(), ":1: starts with a byte order mark|UTF-8"),
        (GOOD.encode("utf-16"), ": is binary or UTF-16|save it as UTF-8"),
        (b"\x7fELF\x02\x01\x00\x00", ": is binary|name a TOML file"),
        (GOOD.replace("good", "gööd").encode("latin-1"), ":1: is not UTF-8|0xf6|save it as UTF-8"),
        (GOOD.encode() + b"# \xff", ":39: is not UTF-8|0xff|save it as UTF-8"),
    ],
    ids=["empty", "blank", "mark", "utf-16", "binary", "latin-1", "byte"],
)
def test_file_that_is_no_text(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    message = only_message(path)
    first, *others = words.split("|")
    assert message.startswith(f"{path}{first}")
    assert all(word in message for word in others)


NO_FILE = "is a pipe or a device, not a file; write the case into a file and name that"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("nowhere.toml", "no such file; look in {} or give the full path"),
        ("", "is a directory; name a case file in it, such as fig1.toml"),
        *((name, NO_FILE) for name in ("/dev/zero", "/dev/null", "pipe.toml")),  # reading them might never end
        ("huge.toml", f"has {2**40} bytes, and a case file has at most {2**22}; name another, such as fig1.toml"),
        ("bad.toml/case.toml", "cannot be read (Not a directory); check its name and permissions"),
    ],
)
def test_no_file(tmp_path: Path, name: str, sentence: str) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "huge.toml").touch()
    os.truncate(tmp_path / "huge.toml", 2**40)
    write(tmp_path, GOOD)
    assert only_message(tmp_path / name) == f"{tmp_path / name}: {sentence.format(tmp_path)}"
    assert "cannot be read (" in only_message(tmp_path / "a\0b.toml")


@pytest.mark.parametrize("name", [".", "..", "a\x1b[31m", "a\nb", "a\u202eb"])
def test_names_that_are_no_folder(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The results of `..toml` would be in the folder of all results, those of `...toml` in the one above."""
    monkeypatch.chdir(tmp_path)
    path = Path(f"{name}.toml")
    path.write_text(GOOD, encoding="utf-8")
    with pytest.raises(CaseError, match="names the folder of its results; must have no control characters"):
        load_case(path)
    assert main(["run", str(path)]) == BAD_INPUT
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("override", [[], 2.0, None])
def test_an_override_that_is_no_text(tmp_path: Path, override: Any) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(GOOD, encoding="utf-8")
    assert "is no text; write it as in --set oscillator.omega=2.0" in only_message(path, [override])


def test_a_link_to_a_case(tmp_path: Path) -> None:
    (tmp_path / "link.toml").symlink_to(write(tmp_path, GOOD))
    assert load_case(tmp_path / "link.toml").title == "good"


@pytest.mark.parametrize(
    ("count", "last"), sampled((50, "unknown key"), (51, ": and 1 more"), (1000, ": and 950 more"), keep=2)
)
def test_of_many_faults_the_first_are_told(tmp_path: Path, count: int, last: str) -> None:
    path = write(tmp_path, "".join(f"wrong{i} = 1\n" for i in range(count)) + GOOD)
    error = refused(path)
    assert len(error.faults) == count
    lines = str(error).splitlines()
    assert len(lines) == min(count, 51)
    assert [line.split(": ")[:2] for line in lines[:50]] == [[f"{path}:{i + 1}", f"wrong{i}"] for i in range(50)]
    assert last in lines[-1]


def test_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deny(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", deny)
    message = only_message(write(tmp_path, GOOD))
    assert message.endswith(": cannot be read (Permission denied); check its name and permissions")


def test_deep_nesting_is_refused_at_once(tmp_path: Path) -> None:
    path, started = write(tmp_path, GOOD), time.process_time()
    assert "nested too deeply" in only_message(path, [f"title={'[' * 5000}"])
    assert time.process_time() - started < 1


def quadrilaterals(phi: Any, z: Any) -> meshio.Mesh:
    points = np.array([(x, y, 0.0) for x in phi for y in z])
    node = np.arange(len(points)).reshape(len(phi), len(z))
    cells = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)
    return meshio.Mesh(points, [("quad", cells)])


TRIANGLE = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))])
WHOLE = quadrilaterals(np.linspace(0.5, 1.5, 5) * np.pi, [-8, -2, 2, 8])
MESHES = {
    "no tensor grid": (meshio.Mesh(WHOLE.points, [("quad", WHOLE.cells[0].data[1:])]), "tensor grid"),
    "triangles": (TRIANGLE, "triangle"),
    "no line at an impact": (quadrilaterals(np.linspace(0, 2, 4) * np.pi, [-8, 0.5, 8]), "impact line"),
    "a third of the circle": (quadrilaterals(np.linspace(0, 0.7, 4) * np.pi, [-8, 8]), "half circle"),
    "noise on one side": (quadrilaterals(np.linspace(0.5, 1.5, 4) * np.pi, [1, 8]), "must contain 0"),
}


UNREADABLE = {
    "empty.vtu": (b"", "cannot be read"),
    "garbage.vtu": (b"garbage", "cannot be read"),
    "truncated.vtu": (b"<VTKFile>", "cannot be read"),
    "half.vtu": (None, "cannot be read"),
    "missing.vtu": (None, "exist"),
    "folder.vtu": (None, "is not a file"),
    "mesh.txt": (b"mesh", '".txt"; it must be one of '),
}


@pytest.mark.parametrize("name", [*MESHES, *UNREADABLE])
def test_bad_mesh(tmp_path: Path, name: str) -> None:
    if name in MESHES:
        mesh, words = MESHES[name]
        name = "bad.vtu"
        mesh.write(tmp_path / name)
    else:
        content, words = UNREADABLE[name]
        if name == "half.vtu":
            write_mesh(make_mesh(), tmp_path / "whole.vtu")
            content = (tmp_path / "whole.vtu").read_bytes()
            content = content[: len(content) // 2]
        if name == "folder.vtu":
            (tmp_path / name).mkdir()
        if content is not None:
            (tmp_path / name).write_bytes(content)
    text = edited("phi_cells = 2\nxi_cells = 4", f'file = "{name}"')
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f'{path}:{line_of(text, "mesh.file")}: mesh.file: got "{name}"; ')
    assert words in message


def test_mesh_file_too_wide_for_one_of_the_noises(tmp_path: Path) -> None:
    """Bounded noise cuts the mesh off, Gaussian noise does not."""
    write_mesh(make_mesh(xi_max=100.0), tmp_path / "wide.vtu")
    text = edited("phi_cells = 2\nxi_cells = 4", 'file = "wide.vtu"').replace('"ou-reduction"', '"exact"')
    text = text.replace('"oscillator.omega" = [1.0, 2.0]', '"noise.r0" = [0.5, 1.0]')
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(text, 'mesh.file')}: mesh.file: ")
    assert 'got "wide.vtu"; with noise.r0 = 1.0: from xi = -8 to 100 P_s underflows' in message
