"""Arithmetic in texts: numbers, names, + − * / **, pi, exp and sqrt.

A text is parsed, and each node of its tree becomes a function here: nothing in it is ever run. A value is a polynomial
in what the names stand for, at most of degree 3 in the state and 1 in the noise, whose coefficients are Taylor series
in one parameter. So the matrices, their orders in ε and their derivatives are all exact.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from keyword import iskeyword
from operator import add
from typing import Any, cast

Series = tuple[float, ...]
"""Taylor coefficients in one parameter, the value first; all in one calculation have one length."""
Monomial = tuple[tuple[str, ...], str, int]
"""The variables of the state that are multiplied, in order, a noise or "", and the power of ε."""
NUMBER: Monomial = (), "", 0
HIGHEST_DEGREE = 3
"""In the state."""
MOST_LETTERS, MOST_LEVELS, LARGEST_POWER = 1000, 50, 10
CONSTANTS = {"pi": math.pi}
_LETTERS = re.compile(r"[A-Za-z0-9_+\-*/().\s]")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_KNOWN = "write numbers, names, + - * / **, parentheses, pi, exp() and sqrt() only"
_SUMS, _PRODUCTS, _SIGNS = ("Add", "Sub"), ("Mult", "Div"), {"UAdd": 1.0, "USub": -1.0}
_TOO_DEEP = f"is nested too deeply; must be at most {MOST_LEVELS} levels; use fewer parentheses and signs"


class ExpressionError(ValueError):
    """A text that is no arithmetic, or of which no coefficient can be made."""


class _Unsuitable(Exception):
    """Why a calculation gives none of the values that are known here, and what to do; the term is named further up."""


NOT_LINEAR = "is not linear in {states}", "write sums of terms with one of these in each"
TOO_STEEP = (
    f"is of a degree above {HIGHEST_DEGREE} in {{states}}",
    f"write terms of degree 1, or of degree {HIGHEST_DEGREE} in two variables without the noise",
)
NOT_AFFINE = "is not affine in {noises}", "a noise may only be multiplied by numbers, parameters and a variable"
NO_POLYNOMIAL = "is no polynomial in epsilon", "write powers of epsilon only, or give the parameter another name"
TOO_HIGH = f"has a power of epsilon above {LARGEST_POWER}", "leave it out"
NOT_REAL = "is no real number", "change it, or the values of its parameters"
NOT_FINITE = "is not finite", "change it, or the values of its parameters"


def name_fault(name: str) -> str:
    """Why a name cannot stand in an expression, or nothing."""
    if not _NAME.fullmatch(name):
        return "must be letters, digits and underscores, no digit first; rename it"
    if iskeyword(name):
        return f"is a keyword of Python, as are if and in; rename it, for example {name}_"
    if name in RESERVED:
        return f"is reserved, as are {', '.join(each for each in RESERVED if each != name)}; rename it"
    return ""


@dataclass(frozen=True)
class Form:
    """Σ c x^i ξ^j ε^n, i up to 3 in all variables and j 0 or 1: what an expression is worth.

    Attributes:
        parts: c by its monomial.
    """

    parts: Mapping[Monomial, Series]

    @property
    def scalar(self) -> Series | None:
        """The number that it is; None where a variable, a noise or ε is in it."""
        return self.parts.get(NUMBER) if set(self.parts) == {NUMBER} else None

    def plus(self, other: Form, sign: float = 1.0) -> Form:
        """The sum."""
        total = dict(self.parts)
        for key, series in other.parts.items():
            known = total.get(key, (0.0,) * len(series))
            total[key] = tuple(a + sign * b for a, b in zip(known, series, strict=True))
        return Form(total)

    def times(self, other: Form) -> Form:
        """The product. Raises `_Unsuitable` where its degree is too high."""
        total = dict[Monomial, Series]()
        for (x, xi, n), a in self.parts.items():
            for (y, eta, m), b in other.parts.items():
                for is_wrong, reason in (
                    (len(x + y) > HIGHEST_DEGREE, TOO_STEEP),
                    (xi and eta, NOT_AFFINE),
                    (n + m > LARGEST_POWER, TOO_HIGH),
                ):
                    if is_wrong:
                        raise _Unsuitable(*reason)
                key, series = (tuple(sorted(x + y)), xi or eta, n + m), _product(a, b)
                total[key] = tuple(map(add, total[key], series)) if key in total else series
        return Form(total)

    def of(self, function: Callable[[Series], Series]) -> Form:
        """A function of it. Raises `_Unsuitable` where it is no number."""
        if (scalar := self.scalar) is not None:
            return Form({NUMBER: function(scalar)})
        has_state, has_noise = (any(key[i] for key in self.parts) for i in (0, 1))
        raise _Unsuitable(*(NOT_LINEAR if has_state else NOT_AFFINE if has_noise else NO_POLYNOMIAL))


def constant(*series: float) -> Form:
    """A number, with its further Taylor coefficients."""
    return Form({NUMBER: series})


def _product(a: Series, b: Series) -> Series:
    return tuple(sum(a[i] * b[k - i] for i in range(k + 1)) for k in range(len(a)))


def _inverse(a: Series) -> Series:
    c = [1 / a[0]]
    for k in range(1, len(a)):
        c.append(-sum(c[i] * a[k - i] for i in range(k)) / a[0])
    return tuple(c)


def _exponential(a: Series) -> Series:
    c = [math.exp(a[0])]
    for k in range(1, len(a)):
        c.append(sum(i * a[i] * c[k - i] for i in range(1, k + 1)) / k)
    return tuple(c)


def _logarithm(a: Series, first: float) -> Series:
    """ln of a series, whose first coefficient is known."""
    c = [first]
    for k in range(1, len(a)):
        c.append((a[k] - sum(i * c[i] * a[k - i] for i in range(1, k)) / k) / a[0])
    return tuple(c)


def _real_power(a: Series, power: float) -> Series:
    """a^r for r that is not whole, and a^(1/2)."""
    if a[0] < 0:
        raise _Unsuitable(*NOT_REAL)
    if not any(a[1:]):
        return (a[0] ** power, *a[1:])
    c = [a[0] ** power]
    for k in range(1, len(a)):
        c.append(sum((power * i - (k - i)) * a[i] * c[k - i] for i in range(1, k + 1)) / (k * a[0]))
    return tuple(c)


FUNCTIONS: Mapping[str, Callable[[Series], Series]] = {
    "exp": _exponential,
    "sqrt": lambda series: _real_power(series, 0.5),
}
RESERVED = (*CONSTANTS, *FUNCTIONS)
_WAVE = (
    'no rate may depend on the time t: state cos(nu*t) as a noise of the kind "bounded" with sigma = 0, and write its '
    "name; of sin(x) write the first terms of its series, x - x**3/6; of parameters write the value"
)
_SMALL = "rates are of small amplitudes: sums of terms of degree 1, or of degree 3 in two variables"
_REMEDIES = {"sin": _WAVE, "cos": _WAVE, "tan": _WAVE, "abs": _SMALL, "sign": _SMALL, "min": _SMALL, "max": _SMALL}
_REMEDIES |= {"tanh": _SMALL, "log": "write its value as a parameter", "ln": "write its value as a parameter"}
_STEPS: Mapping[str, Callable[[Form, Form], Form]] = {
    "Add": Form.plus,
    "Sub": lambda total, form: total.plus(form, -1.0),
    "Mult": Form.times,
    "Div": lambda total, form: total.times(form.of(_inverse)),
}


@dataclass(frozen=True)
class _Node:
    """A part of an expression.

    Attributes:
        written: how it is written, cut to a readable length.
        form: its value, of what a walk knows.
        number: itself, if it is a number with signs, else NaN.
        summands: of a sum, each with its sign, first to last.
        exponent: of exp().
    """

    written: str
    form: Callable[[_Walk], Form]
    number: float = math.nan
    summands: Sequence[tuple[str, _Node]] = ()
    exponent: _Node | None = None


@lru_cache(maxsize=1024)
def _parsed(text: str) -> tuple[_Node, frozenset[str]]:
    """An expression in which there is nothing but arithmetic, and its names without those of functions and constants.

    Raises:
        ExpressionError: it is empty, too long or too deep, or something else.
    """
    if not text.strip():
        raise ExpressionError("is empty; write a number or an expression")
    if len(text) > MOST_LETTERS:
        raise ExpressionError(
            f"has {len(text)} characters; must be at most {MOST_LETTERS}; use parameters to shorten it"
        )
    for letter in text:
        if not _LETTERS.fullmatch(letter):
            more = "write ** for powers" if letter == "^" else _KNOWN
            raise ExpressionError(f"has the character {letter!a}, which is no arithmetic; {more}")
    line = " ".join(text.split())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(line, mode="eval").body
    except SyntaxError as error:
        raise ExpressionError(f"cannot be read ({error.msg}); write, for example, -omega**2 * x") from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(_TOO_DEEP) from None
    reader = _Reader(line)
    return reader.visit(tree), frozenset(reader.names)


class _Operator(ast.NodeVisitor):
    """The name of a node's operator, as "Add"; empty for what has none."""

    def visit_BinOp(self, node: ast.BinOp) -> str:
        return type(node.op).__name__

    def generic_visit(self, _: ast.AST) -> str:
        return ""


class _Reader(ast.NodeVisitor):
    """Makes the nodes of one line; what is no arithmetic, and too many levels, are refused."""

    def __init__(self, line: str) -> None:
        self.names = set[str]()
        self._line, self._level = line, 0

    def visit(self, node: ast.AST) -> Any:
        self._level += 1
        if self._level > MOST_LEVELS:
            raise ExpressionError(_TOO_DEEP)
        made = super().visit(node)
        self._level -= 1
        return made

    def _written(self, node: Any) -> str:
        source = self._line[node.col_offset : node.end_col_offset]
        return source if len(source) <= 60 else f"{source[:57]}..."

    def generic_visit(self, node: ast.AST) -> _Node:
        raise ExpressionError(f"has {self._written(node)}, which is no arithmetic; {_KNOWN}")

    def visit_Constant(self, node: ast.Constant) -> _Node:
        try:
            number = float(self._line[node.col_offset : node.end_col_offset])
        except ValueError:  # as of True, 1j and 0x10
            return self.generic_visit(node)
        return _Node(self._written(node), lambda walk: constant(number, *walk.rest), number)

    def visit_Name(self, node: ast.Name) -> _Node:
        if node.id not in RESERVED:
            self.names.add(node.id)
        return _Node(self._written(node), lambda walk: walk.named(node.id))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> _Node:
        sign = _SIGNS.get(type(node.op).__name__)
        if sign is None:
            return self.generic_visit(node)
        inner = self.visit(node.operand)
        return _Node(self._written(node), lambda walk: Form({}).plus(walk.value(inner), sign), sign * inner.number)

    def visit_BinOp(self, node: ast.BinOp) -> _Node:
        operator = _Operator()
        name = operator.visit(node)
        if name == "Pow":
            return self._power(node)
        kinds = next((each for each in (_SUMS, _PRODUCTS) if name in each), None)
        if kinds is None:
            return self.generic_visit(node)
        parts, left = list[tuple[str, _Node]](), cast("Any", node)  # of any length in one level
        while (name := operator.visit(left)) in kinds:
            parts.append((name, self.visit(left.right)))
            left = left.left
        parts = [("", self.visit(left)), *reversed(parts)]
        summands = parts if kinds is _SUMS else ()
        return _Node(self._written(node), lambda walk: walk.chain(parts), summands=summands)

    def _power(self, node: ast.BinOp) -> _Node:
        try:
            power = _Reader(self._line).visit(node.right).number
        except ExpressionError:
            power = math.nan
        if not abs(power) <= LARGEST_POWER:
            must = f"must be a number from -{LARGEST_POWER} to {LARGEST_POWER}"
            raise ExpressionError(f"has the exponent {self._written(node.right)}; {must}; write the factors")
        base = self.visit(node.left)
        return _Node(self._written(node), lambda walk: walk.power(walk.value(base), power))

    def visit_Call(self, node: ast.Call) -> _Node:
        name = self._written(node.func)
        if name not in FUNCTIONS:
            known = f"the functions are {' and '.join(FUNCTIONS)}"
            remedy = _REMEDIES.get(name.lower(), f"{known}; write * for products")
            raise ExpressionError(f"has {self._written(node)}, which calls no known function; {remedy}")
        if len(node.args) != 1:
            raise ExpressionError(f"has {self._written(node)}, but {name} takes one number; write {name}(...)")
        inner, function = self.visit(node.args[0]), FUNCTIONS[name]
        exponent = inner if name == "exp" else None
        return _Node(self._written(node), lambda walk: walk.value(inner).of(function), exponent=exponent)


def names_in(text: str) -> frozenset[str]:
    """The names in an expression, without those of functions and constants. Raises `ExpressionError`."""
    return _parsed(text)[1]


def evaluate(text: str, names: Mapping[str, Form], place: str) -> Form:
    """The value of an expression, all in floating-point numbers.

    Args:
        text: the expression.
        names: what names stand for; all series of one length.
        place: what it is, for messages: "v's rate".

    Raises:
        ExpressionError: it is no arithmetic, has other names, is not finite, or of too high a degree.
    """
    return _Walk(names, place).value(_parsed(text)[0])


def summands(text: str, names: Mapping[str, Form], place: str) -> Iterator[tuple[str, Form]]:
    """The terms of an expression that is a sum, as they are written, with their values. Raises `ExpressionError`."""
    walk, (tree, _) = _Walk(names, place), _parsed(text)
    for sign, node in tree.summands or [("", tree)]:
        form = walk.value(node)
        yield node.written, Form({}).plus(form, -1.0) if sign == "Sub" else form


def log_of(text: str, names: Mapping[str, Form], place: str) -> Series:
    """The logarithm of an expression that is a positive number, also near 1 without loss.

    Raises:
        ExpressionError: as `evaluate`, or it is not positive.
    """
    walk, (tree, _) = _Walk(names, place), _parsed(text)
    scalar = walk.value(tree).scalar
    if tree.exponent:
        scalar = walk.value(tree.exponent).scalar
    elif scalar is not None:
        if not scalar[0] > 0:
            raise ExpressionError(f"{place} is {scalar[0]:.6g}; must be > 0; change it or its parameters")
        each = [form.scalar or (0.0,) for _, form in summands(text, names, place)]
        scalar = _logarithm(scalar, math.log1p(math.fsum([*(first for first, *_ in each), -1.0])))
    if scalar is None:
        raise ExpressionError(f"{place} must be a number or an expression in parameters; leave out the others")
    return scalar


class _Walk:
    """The values of the nodes of one tree."""

    def __init__(self, names: Mapping[str, Form], place: str) -> None:
        self._names, self._place = names, place
        length = len(next((series for form in names.values() for series in form.parts.values()), (0.0,)))
        self.rest: Series = (0.0,) * (length - 1)

    def value(self, node: _Node) -> Form:
        """Of a node. Raises `ExpressionError`."""
        try:
            found = node.form(self)
            if all(math.isfinite(each) for series in found.parts.values() for each in series):
                return found
            reason, remedy = NOT_FINITE
        except (OverflowError, ZeroDivisionError):
            reason, remedy = NOT_FINITE
        except _Unsuitable as unsuitable:
            reason, remedy = unsuitable.args
        states, noises = (
            ", ".join(name for name, form in self._names.items() if any(key[i] for key in form.parts)) for i in (0, 1)
        )
        told = reason.format(states=states, noises=noises)
        raise ExpressionError(f"the term {node.written} of {self._place} {told}; {remedy}")

    def named(self, name: str) -> Form:
        """What a name stands for. Raises `ExpressionError`."""
        if name in CONSTANTS:
            return constant(CONSTANTS[name], *self.rest)
        if name not in self._names:
            known = f"known names: {', '.join(self._names) or 'none'}"
            raise ExpressionError(f"{self._place} has the unknown name {name}; {known}; add or rename it")
        return self._names[name]

    def chain(self, parts: Sequence[tuple[str, _Node]]) -> Form:
        """A sum or a product. Raises `_Unsuitable`."""
        total = self.value(parts[0][1])
        for sign, each in parts[1:]:
            total = _STEPS[sign](total, self.value(each))
        return total

    def power(self, base: Form, power: float) -> Form:
        """A power of a value. Raises `_Unsuitable`."""
        if not power.is_integer():
            return base.of(lambda series: _real_power(series, power))
        total = constant(1.0, *self.rest)
        for _ in range(abs(int(power))):
            total = total.times(base)
        return total.of(_inverse) if power < 0 else total
