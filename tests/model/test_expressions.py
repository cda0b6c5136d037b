"""Arithmetic in texts, against Python's own and differences; what is no arithmetic is refused, and nothing is run."""

import ast
import math
import random
import sys
from pathlib import Path

import pytest

from fpsolve.model import expressions
from fpsolve.model.expressions import ExpressionError, Form, constant, evaluate, log_of, name_fault, names_in

VALUES = {"a": 1.3, "b": 0.7, "c": 2.1}
STATE = {"x": Form({(("x",), "", 0): (1.0,)}), "v": Form({(("v",), "", 0): (1.0,)})}
NOISE = {"load": Form({((), "load", 0): (1.0,)}), "epsilon": Form({((), "", 1): (1.0,)})}
NAMES = {**STATE, **NOISE, "a": constant(2.0), "zero": constant(0.0)}


def number(text, values, by=""):
    """The value of a text, and its derivative by a name."""
    names = {name: constant(value, float(name == by)) for name, value in values.items()}
    return evaluate(text, names, "it").scalar


def random_text(rng, depth):
    if depth == 0:
        return rng.choice([*VALUES, "pi", f"{rng.uniform(0.5, 2):.3f}"])
    one, other = (random_text(rng, depth - 1) for _ in range(2))
    power = rng.choice(["2", "3", "-1", "0.5", "-2.5"])
    sums = f"({one} + {other})", f"({one} - {other} / 9)", f"-({one})**2"
    return rng.choice(
        [*sums, f"{one} * {other}", f"({one}) / ({other})", f"sqrt({one})", f"({one})**{power}", "exp(-b)"]
    )


@pytest.mark.parametrize("seed", range(20))
def test_values_and_derivatives_of_random_expressions(seed):
    """Python's own value, for these texts are ours; the derivative by central differences."""
    rng = random.Random(seed)
    text, known = random_text(rng, 3), {"pi": math.pi, "exp": math.exp, "sqrt": math.sqrt}
    try:
        plain = eval(text, {**known, **VALUES})
    except ValueError:  # the root of a negative number
        plain = 1j
    if isinstance(plain, complex):
        with pytest.raises(ExpressionError, match="is no real number"):
            number(text, VALUES)
        return
    for name in VALUES:
        value, slope = number(text, VALUES, name)
        assert value == pytest.approx(plain, rel=1e-13)
        ahead, behind = (number(text, {**VALUES, name: VALUES[name] + h})[0] for h in (1e-5, -1e-5))
        assert slope == pytest.approx((ahead - behind) / 2e-5, rel=1e-6, abs=1e-6 * max(1, abs(value)))


def test_coefficients_and_orders():
    """(a + ε)³ x by its binomial coefficients."""
    parts = evaluate("(a + epsilon)**3 * x - 2*load*v/a", NAMES, "it").parts
    expected = {(("x",), "", k): (math.comb(3, k) * 2.0 ** (3 - k),) for k in range(4)}
    assert parts == {**expected, (("v",), "load", 0): (-1.0,)}


@pytest.mark.parametrize(
    ("law", "second"),
    [("exp(-epsilon**2*(1 - r))", -0.2), ("1 - epsilon**2*(1 - r)", -0.2), ("1/(1 + epsilon**2)", -1.0)],
)
def test_the_second_order_of_a_logarithm(law, second):
    """By its Taylor coefficients at ε = 0; and near 1 without loss of digits."""
    zeroth, first, found = log_of(law, {"epsilon": constant(0.0, 1.0, 0.0), "r": constant(0.8, 0.0, 0.0)}, "R")
    assert (zeroth, first) == (0, 0)
    assert found == pytest.approx(second, rel=1e-15)
    exact = {"exp": lambda e: -0.2 * e**2, "1 -": lambda e: math.log1p(-0.2 * e**2), "1/(": lambda e: -math.log1p(e**2)}
    for epsilon in (0.5, 1e-5):
        value = log_of(law, {"epsilon": constant(epsilon), "r": constant(0.8)}, "R")[0]
        assert value == pytest.approx(exact[law[:3]](epsilon), rel=1e-14, abs=1e-16 * ("/" in law))


@pytest.mark.parametrize("value", [1e-300, 1e-17, 1e-9, 0.3, 0.9, 1 - 1e-12, 1.7, 40.0])
def test_the_logarithm_of_a_number(value):
    """Also far from 1, where R − 1 has few digits of it."""
    assert log_of(repr(value), {}, "R")[0] == pytest.approx(math.log(value), rel=1e-15)


def test_reading_has_no_values():
    """The names of what could not be computed; what is no arithmetic is refused without them."""
    assert names_in("1/(a - a) + exp(1e4)*b**-0.5 + pi") == {"a", "b"}
    with pytest.raises(ExpressionError, match=r"has a.real, which is no arithmetic"):
        names_in("b + a.real")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("10**10**10", "has the exponent 10**10; must be a number from -10 to 10"),
        ("((10**10)**10)**10", "the term ((10**10)**10)**10 of it is not finite"),
        ("x*a*v*x*v", "the term x*a*v*x*v of it is of a degree above 3 in x, v"),
        ("a/v", "the term a/v of it is not linear in x, v"),
        ("load*(x + load*v)", "the term load*(x + load*v) of it is not affine in load"),
        ("sqrt(epsilon)*x", "is no polynomial in epsilon"),
        ("1/zero", "the term 1/zero of it is not finite"),
        ("exp(1000)", "the term exp(1000) of it is not finite"),
        ("9e307*9*x", "is not finite"),
        ("a.real", "has a.real, which is no arithmetic"),
        ("[x for x in a]", "has the character '['"),
        ("(lambda: x)()", "has the character ':'"),
        ("a if x else v", "which is no arithmetic"),
        ("a or x", "which is no arithmetic"),
        ("x // a", "which is no arithmetic"),
        ("True * x", "has True, which is no arithmetic"),
        ("1j * x", "has 1j, which is no arithmetic"),
        ("0x10 * x", "has 0x10, which is no arithmetic"),
        ("exp(*a) * x", "has *a, which is no arithmetic"),
        ("a**x", "has the exponent x; must be a number from -10 to 10"),
        ("__import__(a)", "has __import__(a), which calls no known function"),
        ("exp", "the unknown name exp"),
        ("pi(x)", "calls no known function"),
        ("x +", "cannot be read"),
        ("\x00", "has the character '\\x00'"),
        ("-" * 100_000 + "x", "has 100001 characters; must be at most 20000"),
        ("-" * 900 + "x", "is nested too deeply; must be at most 50 levels"),
        ("sqrt(" * 51 + "a" + ")" * 51, "is nested too deeply"),
        ("(" * 400 + "x" + ")" * 400, "cannot be read"),
    ],
)
def test_what_is_no_arithmetic(text, words):
    with pytest.raises(ExpressionError) as raised:
        evaluate(text, NAMES, "it")
    assert words in str(raised.value)
    assert len(str(raised.value)) < 300


def test_long_sums_are_one_level():
    assert evaluate(" + ".join(["x"] * 200), NAMES, "it").parts == {(("x",), "", 0): (200.0,)}
    assert evaluate("(" * 150 + "x" + ")" * 150, NAMES, "it") == NAMES["x"]


def test_names():
    assert name_fault("omega_1") == ""
    for name in ("lambda", "if", "pi", "exp", "1a", "a-b", "ω", "", "a b"):
        assert name_fault(name), name


def test_nothing_is_run():
    """The file calls nothing that runs code, and evaluating has no audit event of one."""
    tree = ast.parse(Path(expressions.__file__).read_text(encoding="utf-8"))
    called = {each.func.id for each in ast.walk(tree) if isinstance(each, ast.Call) and isinstance(each.func, ast.Name)}
    assert not called & {"eval", "exec", "compile", "getattr", "__import__", "open"}
    events, is_on = [], True
    sys.addaudithook(lambda event, _: events.append(event) if is_on else None)
    for text in ("a**2 * x", "__import__(a)", "a.__class__", "exp(a)*v"):
        try:
            evaluate(text, NAMES, "it")
        except ExpressionError:
            continue
    is_on = False
    assert not {"exec", "import", "open"} & set(events)
