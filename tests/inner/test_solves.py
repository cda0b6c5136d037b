"""The paper's own curve takes no more solves, unknowns and time than it did, see solves.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from fpsolve import Problem
from fpsolve.fem import generator
from tests import benchmarks
from tests.benchmarks.cpu import fpsolve_curve, race
from tests.benchmarks.problem import CASES
from tests.benchmarks.references import REFERENCES

ROWS = tomllib.loads(Path(benchmarks.__path__[0], "solves.toml").read_text(encoding="utf-8"))
MOST = 1.2
"""Of what a row says."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
def test_curve_takes_what_its_row_says(name, monkeypatch):
    case, row, sizes, known = CASES[name], ROWS[name], [], generator.factorised

    def counted(operator, noise):
        sizes.append(operator.size)
        return known(operator, noise)

    with monkeypatch.context() as patched:
        patched.setattr(generator, "factorised", counted)
        fpsolve_curve(Problem(case.oscillator, case.noise), case.p, case.rtol)
    assert 1 / MOST < len(sizes) / row["factorisations"] < MOST
    assert 1 / MOST < np.mean(sizes) / row["unknowns"] < MOST
    seconds = race(case, REFERENCES[name], 5)
    for peer in ("tuned", "certified"):
        assert seconds["fpsolve"] / seconds[peer] < MOST * row[f"to_{peer}"]
