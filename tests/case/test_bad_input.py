"""Case files that are wrong: one message for each fault, with file, line, key, value, range and remedy."""

from __future__ import annotations

import itertools
import math
import os
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fpsolve.case.case import load_case
from fpsolve.errors import CaseError, Fault
from fpsolve.fem.mesh import make_mesh
from fpsolve.fem.mesh_file import write_mesh
from fpsolve.simulation.setup import default_step, obstacles, transient

GOOD = """\
title = "good"
[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1
c2 = 0.0
c3 = 0.0
impact = "delta"
[noise]
D0 = 0.1
tau0 = 0.5
r0 = 0.95
treatment = "ou-reduction"
[moments]
p = [-1.0, 1.0, 2.0]
rtol = 1e-8
[vary]
"noise.D0" = [0.1, 0.5]
"oscillator.omega" = [1.0, 2.0]
[mesh]
phi_cells = 2
xi_cells = 4
[figure]
x = "p"
y = "moment"
[output]
eigenfunctions = [1.0]
[[expect]]
quantity = "moment"
p = 2.0
value = 0.01416
rtol = 1e-3
source = "Eq. (37)"
where = { "noise.D0" = 0.1 }
[budget]
unknowns = 60000
seconds = 60.0
"""

BIG = "1" + "0" * 400


def faults_of(path: Path, overrides: Sequence[str] = ()) -> tuple[Fault, ...]:
    with pytest.raises(CaseError) as raised:
        load_case(path, overrides)
    assert raised.value.file == str(path)
    return raised.value.faults


def only_message(path: Path, overrides: Sequence[str] = ()) -> str:
    with pytest.raises(CaseError) as raised:
        load_case(path, overrides)
    assert len(raised.value.faults) == 1, str(raised.value)
    return str(raised.value)


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


def test_the_good_case_is_good(tmp_path: Path) -> None:
    assert load_case(write(tmp_path, GOOD)).title == "good"


VALUES = [  # key, its bad line, what the message says
    ("title", "title = 3", "got 3 (a number)|non-empty string|title = "),
    ("title", 'title = ""', 'got ""|non-empty string'),
    (
        "oscillator.omega",
        "omega = -1.0",
        "got -1.0;|finite number >= 1e-15 and <= 1e15|(natural frequency, in rad/time)|omega = 1.0",
    ),
    ("oscillator.omega", "omega = 0", "got 0;|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", 'omega = "fast"', 'got "fast" (a string)|finite number >= 1e-15 and <= 1e15'),
    ("oscillator.omega", "omega = nan", "got nan|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", "omega = inf", "got inf|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", "omega = true", "got true (a boolean)|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", "omega = [1.0]", "got [1.0] (a list)|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", "omega = 1979-05-27", "got 1979-05-27 (a date or time)|finite number"),
    ("oscillator.omega", f"omega = {BIG}", "got 1000|...|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", f"omega = 0x{'f' * 9000}", "too long to show|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.omega", "omega = { a = 1 }", "got {a = 1} (a table)|finite number >= 1e-15 and <= 1e15"),
    ("oscillator.epsilon", "epsilon = 0.0", "got 0.0|>= 1e-12 and <= 1e6|Eq. (6)|epsilon = 0.1"),
    ("oscillator.restitution", "restitution = 1.5", "got 1.5|> 0 and <= 1|restitution = 0.8"),
    ("oscillator.restitution", "restitution = 0.0", "got 0.0|> 0 and <= 1|restitution = 0.8"),
    ("oscillator.c1", 'c1 = "0.1"', 'got "0.1" (a string)|finite number|damping|c1 = 0.1'),
    ("oscillator.c2", "c2 = -1", "got -1|>= 0|c2 = 0.0"),
    ("oscillator.c3", "c3 = -inf", "got -inf|>= 0|c3 = 0.0"),
    ("oscillator.impact", 'impact = "dleta"', 'got "dleta"|"delta", "restitution"|you mean "delta"'),
    ("oscillator.impact", "impact = 1", 'got 1|one of "delta", "restitution"'),
    ("noise.D0", "D0 = -0.1", "got -0.1|>= 1e-15 and <= 1e15|(noise intensity, in 1/time)|D0 = 0.1"),
    ("noise.tau0", "tau0 = 0", "got 0|>= 1e-15 and <= 1e15|(correlation time, in time)|tau0 = 0.5"),
    ("noise.r0", "r0 = 1.7", "got 1.7|< 5/3|variance (10) is infinite|r0 = 0.95"),
    ("noise.r0", "r0 = 1.6666666666666667", "got 1.66|< 5/3"),
    ("noise.r0", "r0 = 1.6666666666666665", "got 1.66|< 5/3"),
    ("noise.treatment", 'treatment = "OU"', 'got "OU"|"ou-reduction", "exact"'),
    ("moments.p", "p = []", "got []|non-empty list|start, stop, num|p = [1.0, 2.0]"),
    ("moments.p", "p = 2.0", "got 2.0|list of finite numbers|start, stop, num|p = [1.0"),
    ("moments.p[3]", "p = [-1, 1, 2, nan]", "got nan|finite numbers"),
    ("moments.p[3]", 'p = [-1, 1, 2, "x"]', 'got "x" (a string)|finite numbers'),
    ("moments.p[0]", "p = [nan]", "got nan|finite numbers"),
    ("moments.p", "p = [1, 2, -1, 2.0]", "2.0 stands twice|differ|remove"),
    ("moments.p.num", "p = { start = 0, stop = 2, num = 1 }", "got 1|>= 2 and <= 100000|num ="),
    ("moments.p.num", "p = { start = 0, stop = 2, num = 3.0 }", "got 3.0|whole number|num ="),
    ("moments.p.stop", "p = { start = 0, num = 3 }", "missing|finite number|stop = 6.0"),
    ("moments.p", "p = { start = 2, stop = 1, num = 3 }", "start = 2.0, stop = 1.0|start < stop"),
    ("moments.p", "p = { start = -1e308, stop = 1e308, num = 3 }", "1e+308|a finite way apart"),
    ("moments.p.step", "p = { start = 0, stop = 2, num = 3, step = 1 }", "unknown key|start, stop"),
    ("moments.rtol", "rtol = 1e-14", "got 1e-14|> 1e-13 and < 1|rtol = 1e-8"),
    ("moments.rtol", "rtol = 1", "got 1;|> 1e-13 and < 1"),
    ("budget.seconds", "seconds = 0", "got 0|> 0|time for one p|seconds = 60.0"),
    ("budget.seconds", "seconds = inf", "got inf|finite number > 0"),
    ("budget.unknowns", "unknowns = 99", "got 99|whole number >= 100|unknowns = 60000"),
    ("budget.unknowns", "unknowns = 1e4", "got 10000.0|whole number >= 100"),
    ('vary."noise.D0"', '"noise.D0" = []', "got []|non-empty list|>= 1e-15 and <= 1e15|[0.1, 0.5, 1.0]"),
    ('vary."noise.D0"', '"noise.D0" = 0.1', "got 0.1|non-empty list|>= 1e-15 and <= 1e15"),
    ('vary."noise.D0"', '"noise.D0" = {}', "got {} (a table)|non-empty list"),
    ('vary."noise.D0"[1]', '"noise.D0" = [0.1, -1]', "got -1|>= 1e-15 and <= 1e15 (noise intensity, in 1/time)"),
    ('vary."noise.D0"[1]', '"noise.D0" = [0.1, inf]', "got inf|finite number >= 1e-15 and <= 1e15"),
    ('vary."noise.D0"[1]', '"noise.D0" = [0.1, 0.1]', "got 0.1 twice|distinct|remove"),
    ('vary."noise.D0"[2]', '"noise.D0" = [0.3, 0.1, 0.3, 0.2]', "got 0.3 twice|distinct|remove"),
    ("mesh.phi_cells", "phi_cells = -2", "got -2|whole number >= 1|phi_cells = 2"),
    ("mesh.phi_cells", "phi_cells = 2.0", "got 2.0 (a number)|whole number >= 1|phi_cells = 2"),
    ("mesh.xi_cells", "xi_cells = 0", "got 0|whole number >= 1|xi_cells = 4"),
    ("mesh.xi_cells", f"xi_cells = {BIG}", "got 1000|whole number >= 1 and <= "),
    ("figure.x", "x = 1", "got 1 (a number)|non-empty string"),
    ("figure.y", 'y = "moments"', 'got "moments"|one of "moment", "lyapunov_exponent"|you mean "moment"'),
    ("figure.y", 'y = "stability_index"', 'got "stability_index"|"moment" where x = "p"|key of [vary]'),
    ("figure.y", "y = 3", "got 3 (a number)|must be one of|{ moment = p } with a finite p|y = { moment = 2.0 }"),
    ("figure.y", "y = { moment = inf }", "got {moment = inf} (a table)|{ moment = p } with a finite p"),
    ("figure.y", f"y = {{ moment = {BIG} }}", "got |(a table)|{ moment = p } with a finite p"),
    ("figure.y", "y = { moment = true }", "got {moment = true} (a table)|{ moment = p } with a finite p"),
    ("figure.y", "y = { moment = 2.0 }", 'got {moment = 2.0}; must be "moment" where x = "p"|set x to a key of [vary]'),
    ("output.eigenfunctions", 'eigenfunctions = "all"', 'got "all" (a string)|list of finite'),
    ("output.eigenfunctions[1]", "eigenfunctions = [1, 3]", "got 3.0|among moments.p (3|add it"),
    ("output.eigenfunctions[2]", "eigenfunctions = [1, 2, 1]", "got 1.0 twice|distinct|remove one"),
    ("output.eigenfunctions[1]", "eigenfunctions = [1, 1]", "got 1.0 twice|distinct|remove one"),
    ("expect[0].quantity", 'quantity = "variance"', 'got "variance"|you mean "variance_rate"?'),
    ("expect[0].p", "p = 7.0", "got 7.0|among moments.p|add it there"),
    ("expect[0].p", "", "missing; a moment needs its order|p = 2.0"),
    ("expect[0].value", "value = nan", "got nan|finite number|value = 0.01416"),
    ("expect[0].rtol", "rtol = 0", "got 0|> 0|rtol = 1e-3"),
    ("expect[0].rtol", "", "missing, and so is atol|rtol = 1e-3"),
    ("expect[0].source", 'source = ""', 'got ""|non-empty string|source = '),
    ('expect[0].where."noise.D0"', 'where = { "noise.D0" = 9 }', "got 9.0|[0.1, 0.5]"),
    ('expect[0].where."noise.D0"', 'where = { noise.D0 = "a" }', 'got "a"|[0.1, 0.5]|write one of these'),
    ('expect[0].where."noise.D0"', "where = { noise.D0 = true }", "got true (a boolean)|finite numbers"),
    ('expect[0].where."noise.D0"', "where = { noise.D0 = inf }", "got inf|finite numbers"),
    ('expect[0].where."noise.r0"', 'where = { "noise.r0" = 1 }', "not varied|[vary]"),
]
LINES = [  # key, a good line, what stands there instead, what the message says
    ("moments", "p = [-1.0, 1.0, 2.0]", "p = [1.0, 2.0, 1e300]", "overflow|moderate sizes|nearer to 1"),
    ('vary."noise.r0"[1]', '"oscillator.omega" = [1.0, 2.0]', '"noise.r0" = [0.95, 2]', "got 2|< 5/3"),
    (
        "vary.omega",
        '"oscillator.omega" = [1.0, 2.0]',
        "omega = [1.0]",
        'cannot be varied; did you mean "oscillator.omega"?',
    ),
    (
        'vary."oscillator.impact"[0]',
        '"oscillator.omega" = [1.0, 2.0]',
        '"oscillator.impact" = ["dleta"]',
        'got "dleta" (a string)|one of "delta", "restitution"; did you mean "delta"?',
    ),
    (
        'vary."oscillator.omega"[0]',
        '"oscillator.omega" = [1.0, 2.0]',
        '"oscillator.omega" = [1e200]',
        "got 1e+200|<= 1e15 (natural",
    ),
    (
        "vary",
        '"oscillator.omega" = [1.0, 2.0]',
        '"oscillator.epsilon" = [1e6]\noscillator.restitution = [1e-3]',
        "with noise.D0 = 0.1, oscillator.epsilon = 1000000.0, oscillator.restitution = 0.001: |overflow",
    ),
    ("mesh.phi_degree", "phi_cells = 2", "phi_degree = 0", "got 0|whole number >= 1|phi_degree = "),
    ("mesh.xi_degree", "xi_cells = 4", "xi_degree = 99", "got 99|whole number >= 1 and <= |xi_degree = 9"),
    ("mesh.xi_min", "xi_cells = 4", "xi_min = 2.0", "got 2.0|finite number < 0|xi_min = -8.0"),
    ("mesh.xi_max", "xi_cells = 4", "xi_max = -2.0", "got -2.0|finite number > 0|xi_max = 8.0"),
    (
        "mesh.file",
        "xi_cells = 4",
        'file = "mesh.vtu"',
        "either a file or made from numbers|remove file, or remove phi_cells",
    ),
    ("mesh.grading", "xi_cells = 4", "grading = 2.0", "unknown key|known keys: file, phi_cells"),
    (
        "figure.y",
        'x = "p"',
        'x = "noise.D0"',
        'got "moment"|{ moment = 2.0 }, "lyapunov_exponent" or "stability_index"|write one',
    ),
    (
        "figure.x",
        'x = "p"\ny = "moment"',
        'x = "noise.r0"\ny = "stability_index"',
        'got "noise.r0"|noise.D0|[vary]',
    ),
    (
        "expect[0].p",
        'quantity = "moment"',
        'quantity = "stability_index"',
        "got 2.0|does not depend on p|remove p",
    ),
    ("expect[0].atol", "rtol = 1e-3", "atol = -1", "got -1|> 0|atol = 1e-6"),
    ("expect[0].wehre", 'where = { "noise.D0" = 0.1 }', "wehre = {}", 'unknown key; did you mean "where"?'),
    (
        "oscillator.omgea",
        "c3 = 0.0",
        "omgea = 1.0",
        'unknown key; did you mean "omega"?|known keys: omega, rest|remove',
    ),
    (
        "noise.d0",
        'treatment = "ou-reduction"',
        "d0 = 1.0",
        'unknown key; did you mean "D0"?|known keys: D0, tau0',
    ),
    (
        "figures",
        'title = "good"',
        'title = "good"\nfigures = 1',
        'unknown key; did you mean "figure"?|known keys: title',
    ),
]


@pytest.mark.parametrize(("key", "new", "words"), VALUES, ids=[f"{key}:{new:.30}" for key, new, _ in VALUES])
def test_bad_value(tmp_path: Path, key: str, new: str, words: str) -> None:
    old = GOOD.splitlines()[line_of(GOOD, key) - 1]
    assert_message(write(tmp_path, edited(old, new)), key, words)


@pytest.mark.parametrize(("key", "old", "new", "words"), LINES, ids=[f"{key}:{new:.30}" for key, _, new, _ in LINES])
def test_bad_line(tmp_path: Path, key: str, old: str, new: str, words: str) -> None:
    assert_message(write(tmp_path, edited(old, new)), key, words)


def assert_message(path: Path, key: str, words: str) -> None:
    """The one message names the file, the key's line and the key, and holds all the words."""
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(path.read_text(encoding='utf-8'), key)}: {key}: ")
    for word in words.split("|"):
        assert word in message


FIGURES = [  # a line beside x = "p", what is at fault, what the message says
    ("title = 3", "title", "got 3 (a number)|non-empty string"),
    ('width = "single"', "width", 'one of "single column", "double column"|did you mean "single column"?'),
    ("xlim = [2.0, 1.0]", "xlim", "got [2.0, 1.0] (a list); must be a list of two numbers, the smaller one first"),
    ("xlim = [1.0]", "xlim", "got [1.0] (a list)|two numbers|write, for example, [0.0, 4.0]"),
    ("xlim = 4.0", "xlim", "got 4.0 (a number)|two numbers"),
    ("xlim = [0.0, nan]", "xlim", "got [0.0, nan] (a list)|two numbers"),
    ("ylim = [0.0, 1e31]", "ylim", "got [0.0, 1e+31] (a list)|from -1e30 to 1e30"),
    (f"ylim = [0, {BIG}]", "ylim", "(a list)|from -1e30 to 1e30"),
    ("ylim = [1.0, 1.0000000000001]", "ylim", "not equal to 9 digits"),
    ("ylim = [false, true]", "ylim", "got [false, true] (a list)|two numbers"),
    (
        'mark = "stability_index"',
        "mark",
        'got "stability_index" (a string); must be a list of some of "stability_index"',
    ),
    ('mark = ["lambda"]', "mark[0]", 'got "lambda" (a string); must be one of "stability_index", "lyapunov_exponent"'),
    ('mark = ["stability_indx"]', "mark[0]", 'did you mean "stability_index"?'),
    ('mark = ["stability_index", "stability_index"]', "mark[1]", 'got "stability_index" twice|remove one'),
    ('time_unit = "1/s"', "time_unit", 'got "1/s" (a string); must be a unit of 1 to 12 letters|time_unit = "s"'),
    ('time_unit = ""', "time_unit", 'got ""|1 to 12 letters'),
    ("time_unit = 1", "time_unit", "got 1 (a number)|1 to 12 letters"),
    ("map = 1", "map", "got 1 (a number)|map = true"),
    ("map = true", "map", "got true; a map is drawn over two keys of [vary]; set x to one of them, or remove it"),
    ("colour = 1", "colour", "unknown key|known keys: x, y, map, title, width, xlim, ylim, mark, time_unit"),
]


@pytest.mark.parametrize(("line", "key", "words"), FIGURES, ids=[f"{line:.30}" for line, _, _ in FIGURES])
def test_bad_figure(tmp_path: Path, line: str, key: str, words: str) -> None:
    path = write(tmp_path, edited('y = "moment"', f'y = "moment"\n{line}'))
    assert_message(path, f"figure.{key}", words)


OVER_A_KEY = [  # lines of [figure], of [vary], what is at fault, what the message says
    ("y = { moment = 3.0 }", "", "y.moment", "got 3.0; must be among moments.p (3 values, -1 to 2); add it there"),
    ('y = "stability_index"\nmark = ["stability_index"]', "", "mark", "only Λ(p) over p has marks"),
    (
        'y = "stability_index"\nmap = true',
        '"noise.treatment" = ["exact", "ou-reduction"]',
        "map",
        "two keys of numbers",
    ),
    ('y = "stability_index"\nmap = true', '"noise.tau0" = [1.0, 2.0]', "map", "two keys of numbers and no others"),
    ('y = "stability_index"\nmap = true', 'mode = "zip"', "map", "all combinations of two keys"),
    (
        'y = "stability_index"\nxlim = [0.0, 2.0]',
        "",
        "xlim",
        "must be > 0|noise.D0 are spread by factors|raise the smaller",
    ),
]


@pytest.mark.parametrize(("lines", "vary", "key", "words"), OVER_A_KEY)
def test_bad_figure_over_a_key(tmp_path: Path, lines: str, vary: str, key: str, words: str) -> None:
    text = GOOD.replace('x = "p"\ny = "moment"', f'x = "noise.D0"\n{lines}')
    text = text.replace("[0.1, 0.5]\n", "[0.1, 1.0, 10.0]\n").replace("[1.0, 2.0]\n", f"[1.0, 2.0, 3.0]\n{vary}\n")
    assert_message(write(tmp_path, text), f"figure.{key}", words)


@pytest.mark.parametrize(
    "lines",
    [
        'title = "Mine"\nwidth = "single column"\nxlim = [-1, 2.5]\nylim = [-1e-3, 1e-3]\nmark = []\ntime_unit = "µs"',
        'mark = ["lyapunov_exponent", "stability_index"]\nmap = false',
    ],
)
def test_a_good_figure(tmp_path: Path, lines: str) -> None:
    figure = load_case(write(tmp_path, edited('y = "moment"', f'y = "moment"\n{lines}'))).figure
    assert set(figure.model_fields_set) == {"x", "y", *re.findall(r"^(\w+) = ", lines, re.MULTILINE)}


SECTIONS = ["oscillator", "noise", "moments", "vary", "mesh", "figure", "output", "expect"]
REQUIRED = {
    "oscillator": ["epsilon = 0.1", "omega = 1.0", "restitution = 0.8", "c1 = 0.1"],
    "noise": ["D0 = 0.1", "tau0 = 0.5", "r0 = 0.95"],
    "moments": ["p = [-1.0, 1.0, 2.0]"],
    "expect": ['quantity = "moment"', "value = 0.01416", 'source = "Eq. (37)"'],
}


@pytest.mark.parametrize(
    ("section", "line"), [(section, line) for section, lines in REQUIRED.items() for line in lines]
)
def test_missing_key_names_the_line_of_its_section(tmp_path: Path, section: str, line: str) -> None:
    text = edited(line, "")
    path, key = write(tmp_path, text), line.partition(" ")[0]
    name = "expect[0]" if section == "expect" else section
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(text, section)}: {name}.{key}: missing; must be ")
    assert f"add it, for example {key} = " in message


@pytest.mark.parametrize("section", ["oscillator", "noise", "moments"])
def test_missing_section(tmp_path: Path, section: str) -> None:
    path = write(tmp_path, without(section).partition("[output]")[0])
    message = only_message(path)
    assert message.startswith(f"{path}: {section}: missing; must be a table with the keys ")
    assert f"add it, for example [{section}]" in message


def without(section: str) -> str:
    before, _, rest = GOOD.partition("[[expect]]" if section == "expect" else f"[{section}]")
    return before + rest[rest.find("\n[") + 1 :] if "\n[" in rest else before


def test_missing_title(tmp_path: Path) -> None:
    path = write(tmp_path, edited('title = "good"', ""))
    assert only_message(path).startswith(f"{path}: title: missing; must be a non-empty string")


@pytest.mark.parametrize("section", SECTIONS)
def test_section_that_is_no_table(tmp_path: Path, section: str) -> None:
    path = write(tmp_path, f"{section} = 3\n{without(section)}")
    fault = next(fault for fault in faults_of(path) if fault.key == section)
    assert fault.line == 1
    assert fault.sentence.startswith("got 3 (a number); must be a ")
    assert "table" in fault.sentence
    assert f"[{section}]" in fault.sentence


def test_misspelt_section(tmp_path: Path) -> None:
    """It is told once, not as a missing one too."""
    text = edited("[noise]", "[nois]")
    message = only_message(write(tmp_path, text))
    assert f'bad.toml:{line_of(text, "nois")}: nois: unknown key; did you mean "noise"? known keys: title' in message


@pytest.mark.parametrize(
    ("line", "misspelt", "key"),
    [
        ("omega = 1.0", "omgea = 1.0", "oscillator.omgea"),
        ("D0 = 0.1", "d0 = 0.1", "noise.d0"),
        ("p = [-1.0, 1.0, 2.0]", "P = [-1.0, 1.0, 2.0]", "moments.P"),
        ("value = 0.01416", "vale = 0.01416", "expect[0].vale"),
        ('title = "good"', 'titel = "good"', "titel"),
    ],
)
def test_a_misspelt_key_that_is_needed_is_told_once(tmp_path: Path, line: str, misspelt: str, key: str) -> None:
    message = only_message(write(tmp_path, edited(line, misspelt)))
    assert f": {key}: unknown key; did you mean " in message
    assert "missing" not in message


def test_what_is_missing_is_told_beside_another_misspelt_key(tmp_path: Path) -> None:
    text = edited("omega = 1.0", "epsilom = 0.1").replace("epsilon = 0.1\n", "")
    faults = {fault.key: fault.sentence for fault in faults_of(write(tmp_path, text))}
    assert faults.keys() == {"oscillator.epsilom", "oscillator.omega"}
    assert faults["oscillator.omega"].startswith("missing")


def test_single_expect_table(tmp_path: Path) -> None:
    message = only_message(write(tmp_path, edited("[[expect]]", "[expect]")))
    assert "expect: got {quantity" in message
    assert "must be a list of tables" in message
    assert "[[expect]]" in message


def test_second_expectation_is_counted_and_found(tmp_path: Path) -> None:
    text = GOOD + '[[expect]]\nquantity = "variance_rate"\nvalue = 1\nrtol = -2\nsource = "x"\n'
    path = write(tmp_path, text)
    line = 1 + text.splitlines().index("rtol = -2")
    assert only_message(path).startswith(f"{path}:{line}: expect[1].rtol: got -2; must be a finite number > 0")


def test_entry_of_a_list_over_several_lines(tmp_path: Path) -> None:
    text = edited("p = [-1.0, 1.0, 2.0]", "p = [\n  -1.0, 1.0, # [\n  2.0,\n  inf,\n]")
    path = write(tmp_path, text)
    line = 1 + text.splitlines().index("  inf,")
    assert only_message(path).startswith(f"{path}:{line}: moments.p[3]: got inf")


def test_restitution_law_that_turns_the_velocity(tmp_path: Path) -> None:
    text = edited("epsilon = 0.1", "epsilon = 3.0").replace('"delta"', '"restitution"')
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f"{path}:2: oscillator: ")
    for word in ("1 - epsilon^2 (1 - restitution) > 0", "it is -0.8", "smaller epsilon", 'impact = "delta"'):
        assert word in message


def test_restitution_law_on_one_of_the_curves(tmp_path: Path) -> None:
    text = edited('"oscillator.omega" = [1.0, 2.0]', '"oscillator.epsilon" = [0.1, 3.0]')
    text = text.replace('impact = "delta"', 'impact = "restitution"')
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(text, 'vary')}: vary: ")
    assert "with noise.D0 = 0.1, oscillator.epsilon = 3.0: " in message
    assert "1 - epsilon^2 (1 - restitution) > 0" in message


def test_too_many_curves(tmp_path: Path) -> None:
    text = edited('"oscillator.omega" = [1.0, 2.0]', '"noise.tau0" = { start = 1, stop = 9, num = 50001 }')
    text = text.replace("[mesh]", '"oscillator.omega" = { start = 1, stop = 9, num = 20 }\n[mesh]')
    message = only_message(write(tmp_path, text))
    assert "vary: makes 2000040 curves; must be at most 1000000; list fewer values" in message


TOO_MANY = f"[{', '.join(f'0.{i:06}' for i in range(1, 100_002))}]"


@pytest.mark.parametrize(
    ("key", "old", "new"),
    [
        ("moments.p", "p = [-1.0, 1.0, 2.0]", f"p = {TOO_MANY}"),
        ('vary."noise.D0"', '"noise.D0" = [0.1, 0.5]', f'"noise.D0" = {TOO_MANY}'),
        ("output.eigenfunctions", "eigenfunctions = [1.0]", f"eigenfunctions = {TOO_MANY}"),
        ("monte_carlo.p", "[budget]", f"[monte_carlo]\np = {TOO_MANY}\n[budget]"),
    ],
    ids=["moments", "vary", "output", "monte_carlo"],
)
def test_too_long_a_list(tmp_path: Path, key: str, old: str, new: str) -> None:
    fault = next(fault for fault in faults_of(write(tmp_path, edited(old, new))) if fault.key == key)
    assert fault.sentence == "lists 100001 numbers; must be at most 100000; list fewer"
    assert fault.line


def test_the_longest_lists_take_no_longer_than_reading_them(tmp_path: Path) -> None:
    """Within seconds; comparing all pairs would take minutes."""
    longest = TOO_MANY.replace(", 0.100001", "")
    text = GOOD[: GOOD.index("[vary]")].replace("p = [-1.0, 1.0, 2.0]", f"p = {longest}")
    started = time.process_time()
    case = load_case(write(tmp_path, f"{text}[output]\neigenfunctions = {longest}\n"))
    assert time.process_time() - started < 20
    assert case.p.size == len(case.output.eigenfunctions or ()) == 100_000


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"noise.D0" = [0.1, 0.5]', '"noise.D0" = [0.1, 0.5]\nnoise.D0 = [0.1]'),
        ('where = { "noise.D0" = 0.1 }', 'where = { "noise.D0" = 0.1, noise.D0 = 0.1 }'),
    ],
)
def test_key_with_and_without_quotes(tmp_path: Path, old: str, new: str) -> None:
    message = only_message(write(tmp_path, edited(old, new)))
    assert "noise.D0 stands twice, once with quotes and once without; remove one" in message


TOO_EXTREME = [
    *(f"{key} = {value}" for key in ("omega", "D0", "tau0") for value in ("5e-324", "9e-16", "1.1e15", "1e308")),
    *("epsilon = 1e-170", "epsilon = 1e308", "c1 = -1e308", "c1 = 2e15", "c2 = 1e16", "c3 = 1e308", "r0 = -1e308"),
]


@pytest.mark.parametrize("line", TOO_EXTREME)
def test_extreme_parameters_are_refused_by_their_range(tmp_path: Path, line: str) -> None:
    key = line.partition(" ")[0]
    text = re.sub(rf"^{key} = .*", line, GOOD[: GOOD.index("[vary]")], flags=re.MULTILINE)
    path = write(tmp_path, text + "[monte_carlo]\nseed = 0\n")
    place = f"{path}:{text.splitlines().index(line) + 1}"
    section = "noise" if key in ("D0", "tau0", "r0") else "oscillator"
    assert re.match(f"{re.escape(place)}: {section}.{key}: got \\S+; must be a finite number >= ", only_message(path))


@pytest.mark.parametrize("line", ["p = [1e200]", "p = [-1e10]\nrtol = 1e-3"])
def test_combinations_that_overflow_are_refused(tmp_path: Path, line: str) -> None:
    text = re.sub(r"^p = .*", line, GOOD[: GOOD.index("[vary]")], flags=re.MULTILINE)
    text = text.replace("rtol = 1e-8", "").replace("epsilon = 0.1", "epsilon = 1e6")
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(text, 'moments')}: moments: ")
    assert "moderate sizes; bring the extreme ones nearer to 1" in message


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Log-uniformly, and the ends."""
    inner = st.floats(math.log10(low), math.log10(high)).map(lambda power: min(max(10.0**power, low), high))
    return st.sampled_from([low, high]) | inner


def either_sign(low: float, high: float) -> st.SearchStrategy[float]:
    return st.tuples(st.sampled_from([-1, 1]), between(low, high)).map(math.prod)


WIDE = between(1e-15, 1e15)
SIMULATED = ("monte_carlo.p", "monte_carlo.time", "monte_carlo.step")


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
        assert {fault.key for fault in faults_of(path)} <= {"oscillator", "moments", *SIMULATED}
        return
    [curve] = case.curves()
    if not obstacles(curve.oscillator, curve.noise, time=case.monte_carlo.time, step=case.monte_carlo.step):
        lengths = transient(curve.oscillator, curve.noise), default_step(curve.oscillator, curve.noise)
        assert all(0 < length < math.inf for length in lengths)


def test_all_faults_at_once(tmp_path: Path) -> None:
    text = GOOD
    for old, new in [
        ("omega = 1.0", "omega = -1.0"),
        ("c1 = 0.1", ""),
        ("r0 = 0.95", "r0 = 9"),
        ("rtol = 1e-8", "rtl = 1"),
        ('"noise.D0" = [0.1, 0.5]', '"noise.D0" = [-1, 0.5, "x"]'),
        ("xi_cells = 4", "xi_cells = 0"),
        ('\ny = "moment"', "\ny = 2"),
        ("eigenfunctions = [1.0]", "eigenfunctions = [5]"),
        ('source = "Eq. (37)"', "source = false"),
    ]:
        text = text.replace(f"{old}\n", f"{new}\n")
    faults = faults_of(write(tmp_path, text), ["noise.tau0=-1", "title"])
    assert {fault.key for fault in faults} == {
        "--set title",
        "--set noise.tau0=-1: noise.tau0",
        "oscillator.c1",
        "oscillator.omega",
        "noise.r0",
        "moments.rtl",
        'vary."noise.D0"[0]',
        'vary."noise.D0"[2]',
        "mesh.xi_cells",
        "figure.y",
        "expect[0].source",
    }
    assert [fault.line or 0 for fault in faults] == sorted(fault.line or 0 for fault in faults)


def test_faults_between_sections_come_with_the_others(tmp_path: Path) -> None:
    text = edited("omega = 1.0", "omega = -1.0").replace("[1.0]\n", "[5.0]\n").replace("p = 2.0", "p = 3.0")
    text = text.replace('{ "noise.D0" = 0.1 }', '{ "noise.D0" = 7 }')
    assert [fault.key for fault in faults_of(write(tmp_path, text))] == [
        "oscillator.omega",
        "output.eigenfunctions[0]",
        "expect[0].p",
        'expect[0].where."noise.D0"',
    ]


NOT_TOML = [
    ("omega = 1.0", "omega = ", 4, "Invalid value"),
    ("omega = 1.0", "omega 1.0", 4, "Expected '='"),
    ("omega = 1.0", "omega = fast", 4, "Invalid value"),
    ("omega = 1.0", "omega = 01.5", 4, "not valid TOML"),
    ('title = "good"', 'title = "good', 1, "Illegal character"),
    ("[oscillator]", "[oscillator", 2, "Expected ']'"),
    ("rtol = 1e-8", "rtol = 1_", 17, "not valid TOML"),
    ("phi_cells = 2", "phi_cells = 2, 3", 22, "Expected newline"),
    ("eigenfunctions = [1.0]", "eigenfunctions = [1.0", 29, "Unclosed array"),
    ('title = "good"', "title = " + "[" * 5000, None, "nested too deeply"),
    ('title = "good"', "title = " + "1" * 5000, None, "integer string conversion"),
]


@pytest.mark.parametrize(("old", "new", "line", "words"), NOT_TOML, ids=[f"{row[1]:.20}" for row in NOT_TOML])
def test_broken_toml(tmp_path: Path, old: str, new: str, line: int | None, words: str) -> None:
    path = write(tmp_path, edited(old, new))
    message = only_message(path)
    assert message.startswith(f"{path}: " if line is None else f"{path}:{line}: ")
    assert words in message


@pytest.mark.parametrize("parts", [300, 600, 3000])
@pytest.mark.parametrize("start", ["vary", "a", "mesh.file"])
def test_very_long_dotted_key(tmp_path: Path, start: str, parts: int) -> None:
    long = f"{start}{'.a' * parts} = 1"
    path = write(tmp_path, f"{long}\n{without(start.partition('.')[0]) if start != 'a' else GOOD}")
    assert faults_of(path)
    assert faults_of(write(tmp_path, GOOD), [long])


def test_strange_keys_are_quoted(tmp_path: Path) -> None:
    text = edited("c3 = 0.0", '"" = 1\n"a\\nb" = 2')
    keys = {fault.key for fault in faults_of(write(tmp_path, text))}
    assert keys == {'oscillator.""', 'oscillator."a\\nb"'}


def test_broken_toml_at_the_end(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD + "text = ")
    message = only_message(path)
    assert message.startswith(f"{path}:{len(GOOD.splitlines()) + 1}: not valid TOML: ")
    assert "mend the syntax" in message


@pytest.mark.parametrize(
    ("old", "new", "key", "first", "second"),
    [
        ("c1 = 0.1", "c1 = 0.1\nc1 = [\n0.2]", "oscillator.c1", 6, 7),
        ("c1 = 0.1", 'c1 = 0.1\n"c1" = 0.1', "oscillator.c1", 6, 7),
        ('title = "good"', 'title = "good"\ntitle = "bad"', "title", 1, 2),
        ("[noise]", "[noise]\n[noise]", "noise", 10, 11),
        ("[noise]", "[oscillator]", "oscillator", 2, 10),
        ('where = { "noise.D0" = 0.1 }', "where = { a = 1, a = 2 }", "expect[0].where.a", 35, 35),
    ],
)
def test_duplicate_key(tmp_path: Path, old: str, new: str, key: str, first: int, second: int) -> None:
    path = write(tmp_path, edited(old, new))
    expected = f"{path}:{second}: {key}: set twice, first on line {first}; remove one of them"
    assert only_message(path) == expected


def test_value_that_is_also_a_table(tmp_path: Path) -> None:
    path = write(tmp_path, edited("omega = 1.0", "omega = 1.0\nomega.x = 1"))
    assert only_message(path).startswith(f"{path}:5: not valid TOML: ")


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


def test_missing_file(tmp_path: Path) -> None:
    path = tmp_path / "nowhere.toml"
    assert only_message(path) == f"{path}: no such file; look in {tmp_path} or give the full path"


def test_directory(tmp_path: Path) -> None:
    assert only_message(tmp_path) == f"{tmp_path}: is a directory; name a case file in it, such as fig1.toml"


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null", "pipe.toml"])
def test_a_pipe_or_a_device(tmp_path: Path, name: str) -> None:
    """Reading them might never end."""
    os.mkfifo(tmp_path / "pipe.toml")
    path = tmp_path / name
    sentence = "is a pipe or a device, not a file; write the case into a file and name that"
    assert only_message(path) == f"{path}: {sentence}"


def test_a_link_to_a_case(tmp_path: Path) -> None:
    (tmp_path / "link.toml").symlink_to(write(tmp_path, GOOD))
    assert load_case(tmp_path / "link.toml").title == "good"


@pytest.mark.parametrize(("count", "last"), [(50, "unknown key"), (51, ": and 1 more"), (3000, ": and 2950 more")])
def test_of_many_faults_the_first_are_told(tmp_path: Path, count: int, last: str) -> None:
    path = write(tmp_path, "".join(f"wrong{i} = 1\n" for i in range(count)) + GOOD)
    with pytest.raises(CaseError) as raised:
        load_case(path)
    assert len(raised.value.faults) == count
    lines = str(raised.value).splitlines()
    assert len(lines) == min(count, 51)
    assert [line.split(": ")[:2] for line in lines[:50]] == [[f"{path}:{i + 1}", f"wrong{i}"] for i in range(50)]
    assert last in lines[-1]


def test_file_below_a_file(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD) / "case.toml"
    assert "cannot be read (Not a directory); check its name" in only_message(path)


def test_name_with_a_null(tmp_path: Path) -> None:
    assert "cannot be read (" in only_message(tmp_path / "a\0b.toml")


def test_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deny(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", deny)
    message = only_message(write(tmp_path, GOOD))
    assert message.endswith(": cannot be read (Permission denied); check its name and permissions")


OVERRIDES = [
    ("oscillator.omega=-1", "oscillator.omega: got -1; must be a finite number >= 1e-1"),
    ('oscillator.omega="x"', 'oscillator.omega: got "x" (a string); must be a finite number >= 1e-1'),
    ("oscillator.omgea=1", 'oscillator.omgea: unknown key; did you mean "omega"?'),
    ("omega=2", 'omega: unknown key; did you mean "oscillator.omega"? known keys: title, oscillator, noise'),
    ("RTOL=2", 'RTOL: unknown key; did you mean "moments.rtol"? known keys: title, oscillator, noise'),
    ("nosie.D0=1", 'nosie: unknown key; did you mean "noise"?'),
    ("vary.noise.D0=[0.1, -1]", 'vary."noise.D0"[1]: got -1; must be a finite number >= 1e-1'),
    ('vary."noise.D0"=[]', 'vary."noise.D0": got [] (a list); must be a non-empty list'),
    ("mesh={xi_cells=0}", "mesh.xi_cells: got 0; must be a whole number >= 1"),
    ("oscillator={omega=1, restitution=1, c1=0}", "oscillator.epsilon: missing; must be a finite number >= 1e-1"),
    ('mesh.file="nowhere.vtu"', "mesh.file: a mesh must be either a file or made from numbers"),
    ("oscillator.omega", "a key without a value; write it as in --set oscillator.omega=2.0"),
    ("oscillator.omega=", "cannot read the text"),
    ("", "must be one key=value, but 0 stand here; write it as in --set oscillator.omega=2.0"),
    ("=2", "cannot read the text"),
    ("a=1\nb=2", "must be one key=value, but 2 stand here"),
    ("oscillator.omega.x=1", "omega is not a table, so it has no key x"),
    ("expect.0.value=1", "expect is not a table, so it has no key 0"),
    (f"title={'[' * 5000}", "nested too deeply; a case needs three levels"),
]


@pytest.mark.parametrize(("override", "words"), OVERRIDES, ids=[f"{row[0]:.30}" for row in OVERRIDES])
def test_bad_override_names_itself(tmp_path: Path, override: str, words: str) -> None:
    path = write(tmp_path, GOOD)
    message = only_message(path, ["noise.tau0=0.4", override])
    assert message.startswith(f"{path}: --set {override}: ")
    assert words in message


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


@pytest.mark.parametrize("name", MESHES)
def test_bad_mesh(tmp_path: Path, name: str) -> None:
    mesh, words = MESHES[name]
    mesh.write(tmp_path / "bad.vtu")
    assert_mesh_is_refused(tmp_path, "bad.vtu", words)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "cannot be read"),
        (b"garbage", "cannot be read"),
        (b"<VTKFile>", "cannot be read"),
        (None, "exist"),
    ],
    ids=["empty", "garbage", "truncated", "missing"],
)
def test_unreadable_mesh(tmp_path: Path, content: bytes | None, words: str) -> None:
    if content is not None:
        (tmp_path / "bad.vtu").write_bytes(content)
    assert_mesh_is_refused(tmp_path, "bad.vtu", words)


def test_half_a_mesh_file(tmp_path: Path) -> None:
    write_mesh(make_mesh(), tmp_path / "whole.vtu")
    content = (tmp_path / "whole.vtu").read_bytes()
    (tmp_path / "half.vtu").write_bytes(content[: len(content) // 2])
    assert_mesh_is_refused(tmp_path, "half.vtu", "cannot be read")


def test_mesh_that_is_a_directory(tmp_path: Path) -> None:
    (tmp_path / "folder.vtu").mkdir()
    assert_mesh_is_refused(tmp_path, "folder.vtu", "is not a file")


def test_mesh_of_unknown_format(tmp_path: Path) -> None:
    (tmp_path / "mesh.txt").write_text("mesh", encoding="utf-8")
    assert_mesh_is_refused(tmp_path, "mesh.txt", '".txt"; it must be one of ')


def assert_mesh_is_refused(folder: Path, name: str, words: str) -> None:
    text = edited("phi_cells = 2\nxi_cells = 4", f'file = "{name}"')
    path = write(folder, text)
    message = only_message(path)
    assert message.startswith(f'{path}:{line_of(text, "mesh.file")}: mesh.file: got "{name}"; ')
    assert words in message


def test_mesh_file_and_numbers_that_are_both_wrong(tmp_path: Path) -> None:
    text = edited("phi_cells = 2", 'file = ""').replace("xi_cells = 4", "xi_cells = 0")
    assert [fault.key for fault in faults_of(write(tmp_path, text))] == ["mesh.file", "mesh.xi_cells"]


def test_mesh_too_wide_for_numbers(tmp_path: Path) -> None:
    path = write(tmp_path, edited("xi_cells = 4", "xi_min = -1e308\nxi_max = 1e308"))
    assert only_message(path).startswith(f"{path}:{line_of(GOOD, 'mesh')}: mesh: ")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("xi_max = 100.0", "from xi = -8 to 100 P_s underflows in a cell|use a narrower interval"),
        ("xi_max = 30.0", "from xi = -8 to 30 elements of degree 13 are linearly dependent|use more or lower-degree"),
        (
            "xi_cells = 1000",
            "makes 198022 unknowns; must be at most budget.unknowns = 60000|lower degrees, or a larger",
        ),
        (
            "xi_cells = 4\nphi_degree = 20",
            "makes 1554 unknowns; must be at most budget.unknowns = 1553; use fewer cells",
        ),
    ],
)
def test_mesh_too_wide_or_too_large(tmp_path: Path, lines: str, words: str) -> None:
    """37 functions of ξ, by default, times (20 + 1) · 2 of φ are 1554."""
    text = edited("xi_cells = 4", lines).replace("unknowns = 60000", f"unknowns = {1553 if '20' in lines else 60000}")
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(text, 'mesh')}: mesh: ")
    assert all(word in message for word in words.split("|"))


def test_mesh_file_too_wide_for_one_of_the_noises(tmp_path: Path) -> None:
    """Bounded noise cuts the mesh off, Gaussian noise does not."""
    write_mesh(make_mesh(xi_max=100.0), tmp_path / "wide.vtu")
    text = edited("phi_cells = 2\nxi_cells = 4", 'file = "wide.vtu"').replace('"ou-reduction"', '"exact"')
    text = text.replace('"oscillator.omega" = [1.0, 2.0]', '"noise.r0" = [0.5, 1.0]')
    path = write(tmp_path, text)
    message = only_message(path)
    assert message.startswith(f"{path}:{line_of(text, 'mesh.file')}: mesh.file: ")
    assert 'got "wide.vtu"; with noise.r0 = 1.0: from xi = -8 to 100 P_s underflows' in message


TRIES = [
    *(
        "",
        "-1",
        "0",
        "1e999",
        "nan",
        "true",
        '"x"',
        "[]",
        "{}",
        "[[]]",
        "[1, 2]",
        "{ a = 1 }",
        "1979-05-27",
        BIG,
    ),
    *('"\\u0000"', "{ start = 0, stop = 1, num = 2 }", "[{}]", "1e308", "1e-320", "'''\n'''", "[\n1,\n]"),
    *('{ start = 1, stop = 2, num = 3, scale = "log" }', '["exact"]', '["moment", "moment"]'),
    *("{ noise.D0 = [2] }", "[1e308, -1e308]", '"noise.D0"', '"lyapunov_exponent"', "07:32:00"),
]
FUZZ = settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@FUZZ
@given(
    changes=st.lists(st.tuples(st.integers(0, 34), st.sampled_from(TRIES)), min_size=1, max_size=4),
    overrides=st.lists(st.sampled_from(GOOD.splitlines()), max_size=1),
)
def test_any_values_give_a_case_or_messages(
    tmp_path: Path, changes: list[tuple[int, str]], overrides: list[str]
) -> None:
    lines = GOOD.splitlines()
    for number, value in changes:
        if "=" in lines[number]:
            lines[number] = f"{lines[number].partition(' =')[0]} = {value}"
    assert_case_or_messages(write(tmp_path, "\n".join(lines)), overrides)


@FUZZ
@given(
    cuts=st.lists(st.integers(0, len(GOOD)), min_size=2, max_size=6),
    extra=st.text("[]{}=\"'.,#\\\n a1", max_size=4),
)
def test_any_rearranged_text_gives_a_case_or_messages(tmp_path: Path, cuts: list[int], extra: str) -> None:
    pieces = [GOOD[i:j] for i, j in itertools.pairwise([0, *sorted(cuts), len(GOOD)])]
    assert_case_or_messages(write(tmp_path, extra.join([*pieces[1:], pieces[0]])), [extra])


def assert_case_or_messages(path: Path, overrides: Sequence[str]) -> None:
    try:
        load_case(path, overrides)
    except CaseError as error:
        faults = error.faults
    else:
        return
    lines = path.read_text(encoding="utf-8").count("\n") + 1
    assert faults
    assert all(fault.sentence for fault in faults)
    assert all(fault.line is None or 1 <= fault.line <= lines for fault in faults)
