"""Messages of the solver speak of its arguments; those on a case file, of its keys."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import fpsolve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.problem import Problem, refuse_infinite
from tests.conftest import FIG1

WORDS = {
    "SIMULATION": "or simulate it, see [monte_carlo] and `fpsolve simulate`",
    "MESH": "use more cells ([mesh] phi_cells, xi_cells), a wider noise interval (xi_min, xi_max) or no [mesh]",
    "CELLS": "use more cells in [mesh], or a smaller rtol where there is none",
    "REACH": "use a [mesh] that reaches there, or no [mesh]",
    "BUDGET": "use a larger rtol or a larger [budget]",
    "MANY": "use a larger rtol or a larger [budget]; p = 2 takes little and bounds it, as Λ(p) <= p Λ(2)/2 for "
    "0 < p < 2 and λ <= Λ(2)/2, and `fpsolve simulate` gives it with a standard error",
    "MESH_FILE": "make one with `fpsolve mesh`",
    "REDUCTION": 'or treatment = "ou-reduction"',
    "NO_REDUCTION": 'treatment = "exact" keeps Eq. (7)',
    "FOLDER": "choose another --out",
    "MEMORY": "use a smaller [budget], or fewer --jobs",
}
LOWER_ROOMS = ["", "model", "theory", "fem", "simulation", "exponent", "analysis"]
OF_A_CASE = re.compile(
    r"\[(oscillator|noise|moments|budget|vary|mesh|monte_carlo|figure|output|expect)\]|--(?!nworkers|nthreads)[a-z]|treatment"
)
"""Sections, options (two are those of Dask's workers), and what a case calls the reduction."""
KEY = re.compile(r"(oscillator|noise)\.\w+")
"""The name of a parameter, which is no sentence."""
COMMANDS = {"cli.py", "commands.py", "arguments.py"}


@pytest.mark.parametrize("remedy", Remedy)
def test_every_remedy_has_words_for_a_case(remedy: Remedy) -> None:
    """Those without words of their own speak of nothing that a case calls otherwise."""
    message = Message(Code.RTOL_MISSED, rtol=1e-8, count=1, of=2, p=2.0, size=1e-3, remedy=remedy)
    assert message.endswith(f"1.0e-03; {remedy.value}, or use a larger rtol")
    words = WORDS.get(remedy.name, remedy.value)
    assert message.words(CASE_WORDS).endswith(f"1.0e-03; {words}, or use a larger rtol")
    assert NotConverged("no", remedy=remedy).message.words(CASE_WORDS) == f"no; {words}"


def test_the_solver_speaks_of_the_noise_and_a_case_of_its_treatment() -> None:
    with pytest.raises(NoSuchExponent, match=r"r0 <= 1, or the Ornstein-Uhlenbeck reduction of the noise$") as raised:
        refuse_infinite(Problem(FIG1, NonGaussianNoise(D0=1.0, tau0=1.0, r0=1.2)), 2.0)
    assert raised.value.message.words(CASE_WORDS).endswith('r0 <= 1, or treatment = "ou-reduction"')
    [note] = NonGaussianNoise(D0=1.0, tau0=1.0, r0=0.5).ou_reduction().remarks
    assert note.endswith("; the unreduced noise keeps Eq. (7)")
    assert note.words(CASE_WORDS).endswith('; treatment = "exact" keeps Eq. (7)')


@pytest.mark.parametrize("room", LOWER_ROOMS)
def test_lower_rooms_know_no_sections_and_no_options(room: str) -> None:
    for path in (Path(fpsolve.__file__).parent / room).glob("*.py"):
        if path.name not in (*COMMANDS, "__init__.py"):
            values = [
                node.value for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Constant)
            ]
            texts = [value for value in values if isinstance(value, str) and not KEY.fullmatch(value)]
            assert not [text for text in texts if OF_A_CASE.search(text)], path


def test_rtol_is_made_smaller_for_a_better_number_and_larger_to_accept_one() -> None:
    missed = Message(Code.INDEX_RTOL_MISSED, symbol="λ", value=3.0, error=1e-3, size=1e-3, rtol=1e-8, remedy=None)
    assert missed.endswith("; use a larger rtol to accept it, or a smaller one to refine its mesh")
    on_a_mesh = Message(Code.INDEX_RTOL_MISSED, **{**missed.data, "remedy": Remedy.MESH})
    assert on_a_mesh.endswith("or let the mesh be chosen, or use a larger rtol")


def test_effective_windows_may_be_more_than_paths() -> None:
    direct, population = (
        Message(Code.FEW_PATHS, p=2.0, low=571.4, high=None, needed=1000, is_direct=each) for each in (True, False)
    )
    assert "too few effective windows carry the mean, 571 where 1000 are needed; use estimator" in direct
    assert population.endswith("too few effective paths carry the mean, 571 where 1000 are needed; use more paths")
