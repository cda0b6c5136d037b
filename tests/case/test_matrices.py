"""Matrices of modes in files beside a case."""

from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.io import mmwrite

from fpsolve import load_case
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT

MASS, STIFFNESS = np.diag([1.0, 2.0, 1.0]), np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
CASE = """\
title = "Three masses"
[system]
kind = "modes"
mass = "mass.npy"
stiffness = "stiffness.mtx"
damping = "damping.csv"
stiffness_noise = { a = "load.mtx", b = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]] }
noises = { a = "noise.first", b = "noise.second" }
[noise.first]
kind = "white"
s = 0.1
[noise.second]
kind = "white"
s = 0.1
[moments]
p = [2.0]
"""


@pytest.fixture
def path(tmp_path):
    np.save(tmp_path / "mass.npy", MASS)
    mmwrite(tmp_path / "stiffness.mtx", sparse.csr_array(STIFFNESS))
    np.savetxt(tmp_path / "damping.csv", 0.1 * MASS, delimiter=",")
    mmwrite(tmp_path / "load.mtx", np.eye(3))
    (tmp_path / "mine.toml").write_text(CASE, encoding="utf-8")
    return tmp_path / "mine.toml"


def test_every_format(path):
    terms = load_case(path).problem.system.terms
    still = sum(np.array(term.matrix) for term in terms if not term.noise)
    at, rate = np.arange(0, 6, 2), np.arange(1, 6, 2)
    np.testing.assert_allclose(still[np.ix_(rate, at)], -np.linalg.solve(MASS, STIFFNESS), atol=1e-15)
    np.testing.assert_allclose(still[np.ix_(rate, rate)], -0.1 * np.eye(3), atol=1e-15)
    np.testing.assert_array_equal(still[np.ix_(at, rate)], np.eye(3))
    driven = {term.noise: np.array(term.matrix)[np.ix_(rate, at)] for term in terms if term.noise}
    np.testing.assert_allclose(driven["first"], -np.linalg.inv(MASS))
    np.testing.assert_allclose(driven["second"], -np.diag([0.0, 0.5, 0.0]))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('system.mass="none.npy"', "system.mass: got 'none.npy', which is no file; must be a square matrix"),
        ('system.mass="mine.toml"', "which is of a kind .toml; must be a square matrix"),
        ('system.damping="wide.csv"', "system.damping: got 'wide.csv', which has the shape (1, 3)"),
        ('system.damping="text.csv"', "system.damping: got 'text.csv', which cannot be read"),
        ('system.stiffness_noise.a="none.mtx"', "system.stiffness_noise.a: got 'none.mtx', which is no file"),
        ('system.damping="small.csv"', "system.damping: got ((1.0,),); must be 3 rows of 3, as mass is"),
    ],
)
def test_what_is_refused(path: Path, change: str, said: str, capsys: pytest.CaptureFixture[str]):
    for name, text in (("wide.csv", "1,2,3"), ("text.csv", "a,b"), ("small.csv", "1.0")):
        (path.parent / name).write_text(text, encoding="utf-8")
    assert main(["run", str(path), "--out", str(path.parent / "out"), "--set", change]) == BAD_INPUT
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (path.parent / "out").exists()


def test_a_shipped_case_comes_with_its_matrices(tmp_path):
    assert main(["new", "beam", str(tmp_path / "mine.toml")]) == 0
    assert load_case(tmp_path / "mine.toml").problem.dimension == 24
