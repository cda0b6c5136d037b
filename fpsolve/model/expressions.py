"""Arithmetic in texts: numbers, names, + − * / **, pi, exp and sqrt.

A text is parsed, and its tree is walked here: nothing in it is ever run. A value is a polynomial in what the names
stand for, at most of degree 1 in the state and in the noise, whose coefficients are Taylor series in one parameter. So
the matrices, their orders in ε and their derivatives are all exact.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from keyword import iskeyword
from operator import add

Series = tuple[float, ...]
"""Taylor coefficients in one parameter, the value first; all in one calculation have one length."""
Monomial = tuple[str, str, int]
"""A variable of the state or "", a noise or "", and the power of ε."""
MOST_LETTERS, MOST_LEVELS, LARGEST_POWER = 1000, 50, 10
CONSTANTS = {"pi": math.pi}
FUNCTIONS = ("exp", "sqrt")
RESERVED = (*CONSTANTS, *FUNCTIONS)
_LETTERS = re.compile(r"[A-Za-z0-9_+\-*/().\s]")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_KNOWN = "write numbers, names, + - * / **, parentheses, pi, exp() and sqrt() only"
_SUMS, _PRODUCTS = (ast.Add, ast.Sub), (ast.Mult, ast.Div)


class ExpressionError(ValueError):
    """A text that is no arithmetic, or of which no coefficient can be made."""


class _Unsuitable(Exception):
    """Why a calculation gives none of the values that are known here, and what to do; the term is named further up."""


NOT_LINEAR = "is not linear in {states}", "write sums of terms with one of these in each"
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
    """Σ c x^i ξ^j ε^n, i and j 0 or 1: what an expression is worth.

    Attributes:
        parts: c by its monomial.
    """

    parts: Mapping[Monomial, Series]

    @property
    def scalar(self) -> Series | None:
        """The number that it is; None where a variable, a noise or ε is in it."""
        return self.parts.get(("", "", 0)) if set(self.parts) == {("", "", 0)} else None

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
                    (x and y, NOT_LINEAR),
                    (xi and eta, NOT_AFFINE),
                    (n + m > LARGEST_POWER, TOO_HIGH),
                ):
                    if is_wrong:
                        raise _Unsuitable(*reason)
                key, series = (x or y, xi or eta, n + m), _product(a, b)
                total[key] = tuple(map(add, total[key], series)) if key in total else series
        return Form(total)

    def of(self, function: Callable[[Series], Series]) -> Form:
        """A function of it. Raises `_Unsuitable` where it is no number."""
        if (scalar := self.scalar) is not None:
            return Form({("", "", 0): function(scalar)})
        has_state, has_noise = (any(key[i] for key in self.parts) for i in (0, 1))
        raise _Unsuitable(*(NOT_LINEAR if has_state else NOT_AFFINE if has_noise else NO_POLYNOMIAL))


def constant(*series: float) -> Form:
    """A number, with its further Taylor coefficients."""
    return Form({("", "", 0): series})


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


@lru_cache(maxsize=1024)
def parsed(text: str) -> ast.expr:
    """The tree of an expression, in which there is nothing but arithmetic.

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
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(_one_line(text), mode="eval").body
    except SyntaxError as error:
        raise ExpressionError(f"cannot be read ({error.msg}); write, for example, -omega**2 * x") from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(_too_deep()) from None
    _check(text, tree)
    return tree


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _too_deep() -> str:
    return f"is nested too deeply; must be at most {MOST_LEVELS} levels; use fewer parentheses and signs"


def _check(text: str, tree: ast.expr) -> None:
    """Refuse trees with something else than arithmetic, or with too many levels."""
    waiting = [(tree, 1)]
    while waiting:
        node, level = waiting.pop()
        if level > MOST_LEVELS:
            raise ExpressionError(_too_deep())
        match node:
            case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
                continue
            case ast.Name():
                continue
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=inner):
                waiting.append((inner, level + 1))
            case ast.BinOp(op=ast.Pow(), left=base, right=power):
                _exponent(text, power)
                waiting.append((base, level + 1))
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
                waiting += [(each, level + 1) for _, each in _chain(node)]
            case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]) if name in FUNCTIONS:
                waiting.append((inner, level + 1))
            case ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
                raise ExpressionError(f"has {_source(text, node)}, but {name} takes one number; write {name}(...)")
            case ast.Call():
                remedy = f"the functions are {' and '.join(FUNCTIONS)}; write * for products"
                raise ExpressionError(f"has {_source(text, node)}, which calls no known function; {remedy}")
            case _:
                raise ExpressionError(f"has {_source(text, node)}, which is no arithmetic; {_KNOWN}")


def _exponent(text: str, node: ast.expr) -> float:
    """The number of an exponent."""
    sign, inner = 1.0, node
    while isinstance(inner, ast.UnaryOp) and isinstance(inner.op, ast.USub | ast.UAdd):
        sign, inner = (-sign if isinstance(inner.op, ast.USub) else sign), inner.operand
    value = inner.value if isinstance(inner, ast.Constant) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not value <= LARGEST_POWER:
        must = f"must be a number from -{LARGEST_POWER} to {LARGEST_POWER}"
        raise ExpressionError(f"has the exponent {_source(text, node)}; {must}; write the factors")
    return sign * float(value)


def _chain(node: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    """The summands of a sum, or the factors of a product, each with its sign, first to last; else the node itself."""
    kinds = next((each for each in (_SUMS, _PRODUCTS) if isinstance(node, ast.BinOp) and isinstance(node.op, each)), ())
    found = list[tuple[str, ast.expr]]()
    while isinstance(node, ast.BinOp) and isinstance(node.op, kinds):
        found.append((type(node.op).__name__, node.right))
        node = node.left
    return reversed([*found, ("", node)])


def _source(text: str, node: ast.expr) -> str:
    """How a part of a text is written there, cut to a readable length."""
    found = ast.get_source_segment(_one_line(text), node) or ast.unparse(node)
    return found if len(found) <= 60 else f"{found[:57]}..."


def names_in(text: str) -> frozenset[str]:
    """The names in an expression, without those of functions and constants. Raises `ExpressionError`."""
    return frozenset(each.id for each in ast.walk(parsed(text)) if isinstance(each, ast.Name)) - set(RESERVED)


def evaluate(text: str, names: Mapping[str, Form], place: str) -> Form:
    """The value of an expression, all in floating-point numbers.

    Args:
        text: the expression.
        names: what names stand for; all series of one length.
        place: what it is, for messages: "v's rate".

    Raises:
        ExpressionError: it is no arithmetic, has other names, is not finite, or of a degree above 1.
    """
    return _Walk(text, names, place).value(parsed(text))


def summands(text: str, names: Mapping[str, Form], place: str) -> Iterator[tuple[str, Form]]:
    """The terms of an expression that is a sum, as they are written, with their values. Raises `ExpressionError`."""
    walk = _Walk(text, names, place)
    for sign, node in _chain(parsed(text)) if _is_sum(parsed(text)) else [("", parsed(text))]:
        form = walk.value(node)
        yield _source(text, node), Form({}).plus(form, -1.0) if sign == "Sub" else form


def log_of(text: str, names: Mapping[str, Form], place: str) -> Series:
    """The logarithm of an expression that is a positive number, also near 1 without loss.

    Raises:
        ExpressionError: as `evaluate`, or it is not positive.
    """
    tree, walk = parsed(text), _Walk(text, names, place)
    if isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name) and tree.func.id == "exp":
        scalar = walk.value(tree.args[0]).scalar
        walk.value(tree)  # which may overflow
    else:
        scalar = walk.value(tree).scalar
        if scalar is not None and not scalar[0] > 0:
            raise ExpressionError(f"{place} is {scalar[0]:.6g}; must be > 0; change it or its parameters")
        if scalar is not None:
            each = [form.scalar or (0.0,) for _, form in summands(text, names, place)]
            scalar = _logarithm(scalar, math.log1p(math.fsum([*(first for first, *_ in each), -1.0])))
    if scalar is None:
        raise ExpressionError(f"{place} must be a number or an expression in parameters; leave out the others")
    return scalar


def _is_sum(node: ast.expr) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, _SUMS)


class _Walk:
    """The values of the nodes of one tree."""

    def __init__(self, text: str, names: Mapping[str, Form], place: str) -> None:
        self._text, self._names, self._place = text, names, place
        length = len(next((series for form in names.values() for series in form.parts.values()), (0.0,)))
        self._rest: Series = (0.0,) * (length - 1)

    def value(self, node: ast.expr) -> Form:
        """Of a node. Raises `ExpressionError`."""
        try:
            found = self._value(node)
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
        raise ExpressionError(f"the term {_source(self._text, node)} of {self._place} {told}; {remedy}")

    def _value(self, node: ast.expr) -> Form:
        match node:
            case ast.Constant(value=int() | float() as number):
                return constant(float(number), *self._rest)
            case ast.Name(id=name) if name in CONSTANTS:
                return constant(CONSTANTS[name], *self._rest)
            case ast.Name(id=name) if name in self._names:
                return self._names[name]
            case ast.Name(id=name):
                known = f"known names: {', '.join(self._names) or 'none'}"
                raise ExpressionError(f"{self._place} has the unknown name {name}; {known}; add or rename it")
            case ast.UnaryOp(op=op, operand=inner):
                return Form({}).plus(self.value(inner), -1.0 if isinstance(op, ast.USub) else 1.0)
            case ast.BinOp(op=ast.Pow(), left=base, right=power):
                return self._power(self.value(base), _exponent(self._text, power))
            case ast.Call(func=ast.Name(id=function), args=[inner]):
                made = self.value(inner)
                return made.of(_exponential if function == "exp" else lambda series: _real_power(series, 0.5))
        total = Form({})
        for sign, each in _chain(node):
            form = self.value(each)
            match sign:
                case "":
                    total = form
                case "Add" | "Sub":
                    total = total.plus(form, 1.0 if sign == "Add" else -1.0)
                case "Mult":
                    total = total.times(form)
                case _:
                    total = total.times(form.of(_inverse))
        return total

    def _power(self, base: Form, power: float) -> Form:
        if not power.is_integer():
            return base.of(lambda series: _real_power(series, power))
        total = constant(1.0, *self._rest)
        for _ in range(abs(int(power))):
            total = total.times(base)
        return total.of(_inverse) if power < 0 else total
