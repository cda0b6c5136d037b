"""Messages are data: words for Python and for case files, records and pickles follow from code and data alone."""

import copy
import json
import math
import pickle
import re
from string import Formatter

import numpy as np
import pytest

from fpsolve.messages import Code, Message, Remedy, Severity, escaped, message_of

TEXTS = ("text", "place", "symbol", "symbols", "key", "name", "line", "side", "kind", "file", "last", "value_text")


def fields(template):
    """The names of all fields of a template, with their conversions; also those within others."""
    for _, name, spec, _ in Formatter().parse(template):
        if name:
            yield name, spec
            yield from fields(spec)


def example(code):
    """A message with made-up data."""
    made = {}
    for name, spec in fields(code.template):
        if name in ("reason", "reasons"):
            made[name] = Message(Code.NO_MOMENT, p=3.0)
        elif name == "remedy":
            made[name] = Remedy.MESH
        elif name.startswith(("is_", "has_")):
            made[name] = True
        elif spec and not spec.startswith("?"):
            made[name] = 0.25
        else:
            made.setdefault(name, "some" if name in TEXTS else 2)
    return Message(code, **made)


@pytest.mark.parametrize("code", Code)
def test_message_has_words_and_survives_records_and_pickles(code):
    message = example(code)
    record = Message.from_data(json.loads(json.dumps(message.to_data(), allow_nan=False)))
    for again in (message, record, pickle.loads(pickle.dumps(message)), copy.deepcopy(message)):
        assert (type(again), again.code, dict(again.data)) == (Message, code, dict(message.data))
        assert str(again) == again == message != ""
        assert "{" not in again
        assert "None" not in again
    assert isinstance(code.severity, Severity)


@pytest.mark.parametrize("remedy", Remedy)
def test_remedy_ends_a_message_and_names_keys_as_a_case_does(remedy):
    message = Message(Code.NOT_CONVERGED, p=1.0, reason=message_of("no"), remedy=remedy)
    assert message.endswith(f"; {remedy.value}")
    assert not re.search(r"`(fpsolve\.|write_mesh)|a (larger|smaller) budget|given mesh", message)


def test_numbers_of_any_kind_survive_a_record():
    numbers = {"value": math.inf, "error": np.float64(0.1), "most": -math.inf, "p": np.array([1.0, 2.0])}
    message = Message(Code.AT_REST, **numbers, none=None)
    again = Message.from_data(json.loads(json.dumps(message.to_data())))
    assert again.data == message.data == {"value": math.inf, "error": 0.1, "most": -math.inf, "p": (1, 2), "none": None}


def test_messages_that_differ_in_numbers_only_are_of_one_kind():
    reason = Message(Code.UNKNOWNS_SPENT, unknowns=7, most=5)
    one = Message(Code.NOT_CONVERGED, p=1.0, reason=reason, remedy=Remedy.MESH)
    others = {
        "numbers": Message(Code.NOT_CONVERGED, p=2.0, reason=reason, remedy=Remedy.MESH),
        "reason": Message(Code.NOT_CONVERGED, p=1.0, reason=Message(Code.MESHES_SPENT, count=5), remedy=Remedy.MESH),
        "remedy": one.advising(Remedy.BUDGET),
        "code": Message(Code.NOT_SOLVED, **one.data),
    }
    assert {name for name, other in others.items() if other.kind == one.kind} == {"numbers"}
    assert Message(Code.NUMBER_FAILED, symbols=["λ"]).kind != Message(Code.NUMBER_FAILED, symbols=["λ", "N"]).kind
    drawn = Message(Code.NEGATIVE_DENSITY, name="density", p=0.0, size=0.2)
    assert Message(Code.NOTHING_DRAWN, reason=drawn).size == 0.2


def test_a_message_is_not_changed_but_a_remedy_may_be_another():
    message = message_of("no")
    with pytest.raises(AttributeError, match="not changed"):
        message.code = Code.FAULT
    with pytest.raises(TypeError):
        message.data["text"] = "yes"
    assert message.advising(Remedy.MESH).advising(None) == message == "no"


def test_control_characters_are_shown_as_python_writes_them():
    text = "a\x1b[31m\tb\x9b\u202e\u2028\ud800\nδ_p ± 1, 日本"
    assert escaped(text) == r"a\x1b[31m\tb\x9b\u202e\u2028\ud800" + "\nδ_p ± 1, 日本" == escaped(escaped(text))
