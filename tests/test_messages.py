"""Messages are data: words for each audience, records, grouping and pickles follow from code and data alone."""

import ast
import copy
import json
import math
import pickle
from pathlib import Path
from string import Formatter

import numpy as np
import pytest

import fpsolve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.errors import FpsolveError, MeshError, NoSuchExponent, NotConverged, OutputError
from fpsolve.messages import Code, Message, Remedy, Severity, escaped, message_of

AUDIENCES = {"Python": {}, "case files": CASE_WORDS}
PACKAGE = Path(fpsolve.__file__).parent
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
        elif name.startswith("is_") or name.startswith("has_"):
            made[name] = True
        elif spec and not spec.startswith("?"):
            made[name] = 0.25
        else:
            made.setdefault(name, "some" if name in TEXTS else 2)
    return Message(code, **made)


@pytest.mark.parametrize("code", Code)
def test_every_code_has_words_for_every_audience(code):
    message = example(code)
    for audience in AUDIENCES.values():
        words = message.words(audience)
        assert words
        assert "{" not in words
        assert "None" not in words
        assert Remedy.MESH.value not in words or not audience
    assert str(message) == message == message.words({})
    assert isinstance(code.severity, Severity)


@pytest.mark.parametrize("code", Code)
def test_messages_pickle_and_survive_a_record(code):
    message = example(code)
    read = Message.from_data(json.loads(json.dumps(message.to_data(), allow_nan=False)))
    for again in (read, pickle.loads(pickle.dumps(message)), copy.deepcopy(message)):
        assert type(again) is Message
        assert (again, again.code, dict(again.data)) == (message, code, dict(message.data))
        assert again.words(CASE_WORDS) == message.words(CASE_WORDS)


def test_numbers_of_any_kind_survive_a_record():
    numbers = {"value": math.inf, "error": np.float64(0.1), "most": -math.inf, "p": np.array([1.0, 2.0])}
    message = Message(Code.AT_REST, **numbers, none=None)
    again = Message.from_data(json.loads(json.dumps(message.to_data(), allow_nan=False)))
    assert again.data == message.data == {"value": math.inf, "error": 0.1, "most": -math.inf, "p": (1, 2), "none": None}


@pytest.mark.parametrize(
    "failure",
    [
        NotConverged(Message(Code.NO_ARNOLDI, p=2.0), {"a": 1}, Remedy.DEGREES),
        NoSuchExponent(Message(Code.TAILS, what="Λ(9)", remedy=Remedy.REDUCTION)),
        MeshError("no", Remedy.MESH_FILE),
        OutputError("nowhere"),
        FpsolveError("a text"),
    ],
)
def test_exceptions_carry_messages_and_pickle(failure):
    again = pickle.loads(pickle.dumps(failure))
    assert type(again) is type(failure)
    assert vars(again) == vars(failure)
    assert str(again) == again.message == str(failure)
    assert again.message.data == failure.message.data


def test_what_differs_in_numbers_only_is_of_one_kind():
    one = Message(
        Code.NOT_CONVERGED, p=1.0, reason=Message(Code.UNKNOWNS_SPENT, unknowns=7, most=5), remedy=Remedy.MESH
    )
    others = {
        "numbers": Message(Code.NOT_CONVERGED, p=2.0, reason=one.data["reason"], remedy=Remedy.MESH),
        "reason": Message(Code.NOT_CONVERGED, p=1.0, reason=Message(Code.MESHES_SPENT, count=5), remedy=Remedy.MESH),
        "remedy": one.advising(Remedy.BUDGET),
        "code": Message(Code.NOT_SOLVED, **one.data),
    }
    assert {name for name, other in others.items() if other.kind == one.kind} == {"numbers"}
    assert Message(Code.FEW_PATHS, p=[1.0]).kind == Message(Code.FEW_PATHS, p=[1.0, 2.0]).kind
    assert Message(Code.INDEX_FAILED, symbols=["λ"]).kind != Message(Code.INDEX_FAILED, symbols=["λ", "N"]).kind


def test_how_bad_it_is_may_be_said_by_its_reason():
    reason = Message(Code.NEGATIVE_DENSITY, name="density", p=0.0, size=0.2)
    assert Message(Code.NOTHING_DRAWN, reason=reason).size == reason.size == 0.2
    assert Message(Code.NO_MOMENT, p=1.0).size is None


def test_a_message_is_not_changed_but_a_remedy_may_be_another():
    message = message_of("no")
    with pytest.raises(AttributeError, match="not changed"):
        message.code = Code.FAULT
    with pytest.raises(TypeError):
        message.data["text"] = "yes"
    assert message.advising(Remedy.MESH) == f"no; {Remedy.MESH.value}"
    assert message.advising(Remedy.MESH).advising(None) == message == "no"
    assert message_of(message) is message


@pytest.mark.slow
def test_nothing_reads_a_sentence():
    """No search in, nor comparison with, the text of an exception or of a message."""
    texts = [(path, path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")]
    trees = [(path, ast.parse(text)) for path, text in texts if "str(" in text]
    for path, node in [(path, node) for path, tree in trees for node in ast.walk(tree)]:
        searched = []
        if isinstance(node, ast.Compare):
            searched = [node.left, *node.comparators]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr in ("search", "match", "fullmatch", "sub", "findall"):
                searched = node.args
            elif node.func.attr in ("replace", "startswith", "endswith", "partition", "split"):
                searched = [node.func.value]
        said = ("failure", "error", "reason", "message", "warning")
        texts = [each for each in searched if isinstance(each, ast.Call) and getattr(each.func, "id", "") == "str"]
        assert not [each for each in texts if each.args and ast.unparse(each.args[0]) in said], path


def test_control_characters_are_shown_as_python_writes_them():
    text = "a\x1b[31m\tb\x9b\u202e\u2028\ud800\nδ_p ± 1, 日本"
    assert escaped(text) == r"a\x1b[31m\tb\x9b\u202e\u2028\ud800" + "\nδ_p ± 1, 日本"
    assert escaped(escaped(text)) == escaped(text)
