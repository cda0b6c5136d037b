"""The record of each key: meaning, example, symbol and unit, beside its range."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, get_args

import pytest
from pydantic import Field, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from fpsolve.case.case import Case
from fpsolve.case.kinds import kinds_of, parameters_of, sections_of
from fpsolve.case.read_vary import values_of
from fpsolve.exponent.adapt import Budget
from fpsolve.model import faults
from fpsolve.model.parameters import STRICT, example_of, symbol_of
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import P
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from tests.conftest import FIG1, FIG1_NOISE


def fields_of(annotation: Any) -> Mapping[str, FieldInfo]:
    """Those of the model in an annotation, if there is one."""
    return faults.fields_of(annotation) or next(filter(None, map(fields_of, get_args(annotation))), {})


def records(fields: Mapping[str, FieldInfo], section: str = "") -> Iterator[tuple[str, FieldInfo]]:
    for name, field in fields.items():
        yield section + name, field
        yield from records(fields_of(field.annotation), f"{section}{name}.")


RECORDS = dict(records(sections_of(Case.model_fields, {})))
KEYS = sorted(key for key, field in RECORDS.items() if "." in key or not example_of(field).startswith("["))


def test_sections_and_keys_have_a_record() -> None:
    assert {"title", "noise", "noise.D0", "moments.p.num", "monte_carlo.seed", "expect.where"} <= RECORDS.keys()
    assert all(field.description and example_of(field) for field in RECORDS.values())


@pytest.mark.parametrize("key", KEYS)
def test_examples_are_accepted(key: str) -> None:
    field = RECORDS[key]
    kind: Any = Annotated[field.annotation, Field(), *field.metadata]
    adapter = TypeAdapter(kind) if fields_of(field.annotation) else TypeAdapter(kind, config=STRICT)
    for example in example_of(field).split(" or "):
        [(name, value)] = tomllib.loads(example).items()
        assert name == key.rpartition(".")[2]
        assert adapter.validate_python(value) is not None


@pytest.mark.parametrize("key", sorted({key.partition(".")[0] for key in KEYS} - {"title"}))
def test_examples_of_sections_are_their_headers(key: str) -> None:
    assert example_of(RECORDS[key]).startswith("[[expect]]" if key == "expect" else f"[{key}]")


KEYS_OF_FIGURES = {
    key for key in RECORDS if re.match(r"(oscillator|noise)\.", key) and RECORDS[key].annotation is float
}
KEYS_OF_FIGURES |= {"p"}


def test_figures_name_what_they_are_drawn_over() -> None:
    about = {key: parameter.quantity for key, parameter in Problem(FIG1, FIG1_NOISE).parameters.items()} | {"p": P}
    assert {
        key: (symbol_of(RECORDS["moments.p" if key == "p" else key]), about[key].title) for key in KEYS_OF_FIGURES
    } == {
        "p": ("$p$", "order of the moment $p$"),
        "oscillator.omega": (r"$\omega$", r"natural frequency $\omega$ (rad/time)"),
        "oscillator.restitution": ("$r$", "coefficient of restitution $r$"),
        "oscillator.c1": ("$c_1$", "damping coefficient $c_1$ (1/time)"),
        "oscillator.epsilon": (r"$\varepsilon$", r"small parameter of Eq. (6) $\varepsilon$"),
        "oscillator.c2": ("$c_2$", "nonlinear damping coefficient $c_2$ (1/(time length²))"),
        "oscillator.c3": ("$c_3$", "nonlinear damping coefficient $c_3$ (time/length²)"),
        "noise.D0": ("$D_0$", "noise intensity $D_0$ (1/time)"),
        "noise.tau0": (r"$\tau_0$", r"correlation time $\tau_0$ (time)"),
        "noise.r0": ("$r_0$", "departure from Gaussian noise $r_0$"),
    }


def test_what_can_be_varied_has_a_record() -> None:
    assert parameters_of({}, {}) is None
    known = parameters_of({}, {"kinds": kinds_of({})})
    assert known is not None
    assert known.keys() == {*KEYS_OF_FIGURES, "oscillator.impact", "noise.treatment"} - {"p"}
    assert all(values_of(known[key]).validate_python([0.5]) == (0.5,) for key in KEYS_OF_FIGURES - {"p"})


@pytest.mark.parametrize(
    "wrong", [{"omega": "1"}, {"omega": True}, {"omega": float("nan")}, {"omega": 0.0}, {"restitution": 2.0}, {"x": 1}]
)
def test_records_leave_the_types_strict(wrong: dict[str, Any]) -> None:
    good: dict[str, Any] = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1}
    assert VibroImpactOscillator(**good).omega == 1.0
    with pytest.raises(ValidationError):
        VibroImpactOscillator(**good | wrong)


def test_a_budget_is_strict_too() -> None:
    for wrong in ({"unknowns": 1e4}, {"unknowns": 99}, {"seconds": 0.0}, {"seconds": float("inf")}, {"minutes": 1.0}):
        with pytest.raises(ValidationError):
            Budget(**wrong)
