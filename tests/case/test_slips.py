"""Odd input: one line that says what is wrong and what to do, no traceback, no warning of a library."""

import subprocess
import sys
import time

import numpy as np
import pytest
import xarray as xr

from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT
from fpsolve.exponent.solver import moment_lyapunov
from fpsolve.measured.tables import read_table
from fpsolve.model.faults import TableError
from fpsolve.model.kinds import kind_classes
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.model.parameters import example_of
from fpsolve.model.problem import Problem
from fpsolve.model.systems.modal import ModalSystem

CASE = """title = "base"
[system]
variables = ["x", "v"]
drift = ["v", "-x - 0.2*v - xi*x"]
[noise]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 1.0
[moments]
p = [2.0]
"""


@pytest.fixture
def refused(tmp_path, monkeypatch, capsys):
    """What is said of a case with a change of its text, or on the command line, in one line."""
    monkeypatch.chdir(tmp_path)

    def said(old="", new="", *arguments, name="mine.toml"):
        (tmp_path / name).write_text(CASE.replace(old, new) if old else CASE, encoding="utf-8")
        start = time.process_time()
        assert main(["run", name, *arguments]) == BAD_INPUT
        assert time.process_time() - start < 5
        text = capsys.readouterr().err
        assert len(text.splitlines()) == 1
        assert len(text) < 1000
        return text

    return said


@pytest.mark.parametrize("number", ["0x10", "0o17", "0b11", "0X1F"])
def test_numbers_in_rates_are_decimal(number, refused):
    assert f"has {number}, which is no arithmetic" in refused("0.2*v", f"{number}*v")


@pytest.mark.parametrize(
    ("call", "remedy"),
    [
        ("sin(x)", "write the first terms of its series, x - x**3/6"),
        ("cos(x)", "of the time t write cos(nu*t) or sin(nu*t) alone"),
        ("tan(2*t)*x", "of the time t write cos(nu*t) or sin(nu*t) alone"),
        ("abs(x)", "sums of terms of degree 1, or of degree 3"),
        ("tanh(v)", "sums of terms of degree 1, or of degree 3"),
        ("ln(2)*x", "write its value as a parameter"),
        ("2(x)", "write * for products"),
    ],
)
def test_functions_that_are_not_known_have_a_remedy_of_their_own(call, remedy, refused):
    said = refused("0.2*v", call)
    assert remedy in said
    assert ("write * for products" in said) == (call == "2(x)")


@pytest.mark.parametrize(
    ("old", "new", "remedy"),
    [
        ("alpha = 1.0", 'alpha = "1.0 Hz"', "write 6.283185 for 1.0 Hz, in rad/time"),
        ("alpha = 1.0", "alpha = 60 rpm", "without a unit: alpha = 60 rpm; write 6.283185 for 60 rpm, in rad/time"),
        ("[noise]", 'parameters = { zeta = "2 %" }\n[noise]', "write 0.02 for 2 %"),
    ],
)
def test_numbers_with_a_unit_are_refused_with_the_number_to_write(old, new, remedy, refused):
    assert refused(old, new).endswith(f"{remedy}\n")


def test_too_many_parameters(refused):
    table = "parameters = {" + ", ".join(f"p{i} = 1.0" for i in range(10_000)) + "}\n[noise]"
    assert "system.parameters: got 10000 parameters; must be at most 200" in refused("[noise]", table)


@pytest.mark.parametrize(
    ("old", "new"),
    [("[2.0]", "[2.0],,"), ('xi*x"]', 'xi*x"],,'), ("[2.0]", "[2.0,,1.0]"), ("alpha = 1.0", "alpha = 1.0,")],
)
def test_a_comma_too_many(old, new, refused):
    said = refused(old, new)
    assert "not valid TOML" in said
    assert "remove the comma at ','" in said or "remove the comma at ',,'" in said or "at '0,'" in said


def test_a_long_title(refused):
    assert "title: got 100000 letters; must be at most 500; shorten it" in refused("base", 100_000 * "a")
    assert "title: got 100000 letters" in refused("", "", "--set", f'title="{100_000 * "a"}"')


def test_a_file_whose_name_has_a_line_end(refused):
    assert r"got 'mi\nne.toml'; a file's name may have no line ends" in refused(name="mi\nne.toml")


def test_a_case_is_a_path():
    with pytest.raises(TypeError, match="got 5; must be the path of a case file"):
        load_case(5)


def test_masses_of_any_size():
    """Λ(p) of two uncoupled modes is that of one, whatever the unit of the other; a singular mass is refused."""
    one = ModalSystem.of([[1.0]], [[1.0]], [[0.2]], stiffness_noise=[[1.0]])
    both = ModalSystem.of(
        [[1e13, 0], [0, 1.0]], [[4e13, 0], [0, 1.0]], [[9e12, 0], [0, 0.2]], stiffness_noise=[[0, 0], [0, 1.0]]
    )
    noise = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
    found, other = (moment_lyapunov(Problem(each, noise), 2.0, rtol=1e-6) for each in (one, both))
    assert abs(found.value[0] - other.value[0]) <= found.error_estimate[0] + other.error_estimate[0]
    for mass in ([[1.0, 1.0], [1.0, 1.0]], [[1e13, 1.0], [1e13, 1.0]], [[0.0, 0.0], [0.0, 1.0]]):
        with pytest.raises(TableError, match="must have an inverse"):
            ModalSystem.of(mass, np.eye(2), stiffness_noise=np.eye(2))
    with pytest.raises(TableError, match=r"1e-320.*; must have an inverse, and an entry beyond ±1e-300"):
        ModalSystem.of([[1e-320]], [[1.0]], stiffness_noise=[[1.0]])


def test_matrices_of_numpy():
    lists = ModalSystem.of([[2.0, 0.0], [0.0, 1.0]], [[1.0, 0.5], [0.5, 3.0]], stiffness_noise=[[1.0, 0.0], [0.0, 1.0]])
    arrays = ModalSystem.of(np.diag([2, 1]), [np.array([1.0, 0.5]), (0.5, np.int64(3))], stiffness_noise=np.eye(2))
    assert arrays.terms == lists.terms


def test_libraries_do_not_warn_of_a_spectrum(tmp_path, recwarn):
    f = np.linspace(0.1, 5, 50)
    kept = {"_FillValue": -1.0, "missing_value": -2.0}
    values = xr.Dataset({"S": ("f", 1 / (1 + f * f))}, {"f": ("f", f, {"units": "Hz"})})
    values.to_netcdf(tmp_path / "s.nc", engine="scipy", encoding={"S": {"_FillValue": -1.0}})
    from scipy.io import netcdf_file

    with netcdf_file(tmp_path / "s.nc", "a") as file:
        file.variables["S"].missing_value = np.float64(kept["missing_value"])
    assert read_table(tmp_path / "s.nc").columns["S"].values.size == 50
    assert not [str(each.message) for each in recwarn]


WARNS = """
import subprocess, sys, warnings
from fpsolve import cli
loud = "import numpy as np; np.float64(1.0) / np.float64(0.0)"
def called(_):
    exec(loud)
    return subprocess.run([sys.executable, "-c", loud]).returncode
cli._called = called
sys.exit(cli.main())
"""


@pytest.mark.parametrize("options", [(), ("-W", "always")])
def test_what_numpy_warns_of_is_shown_where_it_is_asked_for(options):
    """Neither of the command itself nor of its workers; the errors of the numbers tell."""
    found = subprocess.run([sys.executable, *options, "-c", WARNS], capture_output=True, text=True, check=True)
    assert ("RuntimeWarning" in found.stderr) == bool(options)


@pytest.mark.slow
def test_standard_error_is_empty(tmp_path):
    (tmp_path / "mine.toml").write_text(CASE, encoding="utf-8")
    command = [sys.executable, "-W", "always", "-m", "fpsolve", "run", "mine.toml", "--quiet"]
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stderr == ""


@pytest.mark.parametrize("kind", [each for room in ("systems", "noises") for each in kind_classes(room)])
def test_every_parameter_has_an_example(kind):
    for name, field in getattr(kind, "__pydantic_fields__", {}).items():
        assert example_of(field).partition(" ")[0] == name or "\n" in example_of(field), name


def test_what_is_out_of_range_has_an_example(refused):
    assert refused("sigma = 1.0", "sigma = 0.0").endswith("write, for example, sigma = 0.5\n")
