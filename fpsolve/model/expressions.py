"""Arithmetic in texts: numbers, names, + − * / **, pi, exp and sqrt.

A text is parsed, and one walk over its tree gives its value: nothing in it is ever run. A value is a polynomial in what
the names stand for, at most of degree 3 in the state and 1 in the noise, whose coefficients are numbers with their
derivatives by one parameter. So the matrices, their orders in ε and their derivatives are all exact.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from keyword import iskeyword

from fpsolve.arrays import shortened
from fpsolve.model.parameters import without_unit

Series = tuple[float, float]
"""A value and its derivative by one parameter."""
Monomial = tuple[tuple[str, ...], str, int]
"""The variables of the state that are multiplied, in order, a noise or "", and the power of ε."""
NUMBER: Monomial = (), "", 0
HIGHEST_DEGREE = 3
"""Highest degree of a term in the state."""
MOST_LETTERS = 20_000
"""Largest number of characters of an expression."""
MOST_LEVELS = 50
"""Largest depth of an expression, whose sums and products of any length are one level each."""
LARGEST_POWER = 10
"""Largest exponent, and largest power of ε."""
CONSTANTS = {"pi": math.pi}
TIME = "t"
"""The time in x(t - tau) and cos(nu*t), where it is no parameter."""
_OTHERS = re.compile(r"[^A-Za-z0-9_+\-*/().\s]")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_KNOWN = "write numbers, names, + - * / **, parentheses, pi, exp() and sqrt() only"
_MINUS = ast.Sub, ast.Div, ast.USub
"""What gives an operand the sign −1, which in a product is a division."""
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
        for key, (value, slope) in other.parts.items():
            known = total.get(key, (0.0, 0.0))
            total[key] = known[0] + sign * value, known[1] + sign * slope
        return Form(total)

    def times(self, other: Form) -> Form:
        """The product. Raises `_Unsuitable` where its degree is too high."""
        total = Form({})
        for (x, xi, n), (a, a_slope) in self.parts.items():
            for (y, eta, m), (b, b_slope) in other.parts.items():
                for is_wrong, reason in (
                    (len(x + y) > HIGHEST_DEGREE, TOO_STEEP),
                    (xi and eta, NOT_AFFINE),
                    (n + m > LARGEST_POWER, TOO_HIGH),
                ):
                    if is_wrong:
                        raise _Unsuitable(*reason)
                key = tuple(sorted(x + y)), xi or eta, n + m
                total = total.plus(Form({key: (a * b, a * b_slope + a_slope * b)}))
        return total

    def of(self, function: Callable[[Series], Series]) -> Form:
        """A function of it. Raises `_Unsuitable` where it is no number."""
        if (scalar := self.scalar) is not None:
            return Form({NUMBER: function(scalar)})
        has_state, has_noise = (any(key[i] for key in self.parts) for i in (0, 1))
        raise _Unsuitable(*(NOT_LINEAR if has_state else NOT_AFFINE if has_noise else NO_POLYNOMIAL))


OfTime = Callable[[str, str, str], Form | None]
"""What a call is, by its name, its argument and how it is written; None where it is none of the time."""


def constant(value: float, slope: float = 0.0) -> Form:
    """A number, with its derivative."""
    return Form({NUMBER: (value, slope)})


def product(*states: str, noise: str = "", power: int = 0) -> Form:
    """A product of variables, a noise and a power of ε, whatever a parameter is."""
    return Form({(states, noise, power): (1.0, 0.0)})


def _function(a: Series, value: float, slope: float) -> Series:
    """A function of a series, from its value and its derivative there."""
    return value, slope * a[1]


def _power(a: Series, power: float) -> Series:
    """a^r. Raises `_Unsuitable` where it is no real number."""
    if a[0] < 0 and not power.is_integer():
        raise _Unsuitable(*NOT_REAL)
    value = 1 / a[0] if power == -1 else a[0] ** power
    return _function(a, value, power * value / a[0] if a[1] else 0.0)


FUNCTIONS: Mapping[str, Callable[[Series], Series]] = {
    "exp": lambda a: _function(a, *2 * (math.exp(a[0]),)),
    "sqrt": partial(_power, power=0.5),
}
_INVERSE = partial(_power, power=-1.0)
WAVES = "cos", "sin"
"""The functions of the time."""
RESERVED = (*CONSTANTS, *FUNCTIONS, *WAVES)
_WAVE = (
    "of the time t write cos(nu*t) or sin(nu*t) alone; of sin(x) write the first terms of its series, x - x**3/6; of "
    "parameters write the value"
)
_DELAY = "write x(t - tau), tau a number or an expression in the parameters"
_SMALL = "rates are of small amplitudes: sums of terms of degree 1, or of degree 3 in two variables"
_REMEDIES = {"sin": _WAVE, "cos": _WAVE, "tan": _WAVE, "abs": _SMALL, "sign": _SMALL, "min": _SMALL, "max": _SMALL}
_REMEDIES |= {"tanh": _SMALL, "log": "write its value as a parameter", "ln": "write its value as a parameter"}


@lru_cache(maxsize=1024)
def _parsed(text: str) -> tuple[str, ast.expr]:
    """An expression in one line, and its tree.

    Raises:
        ExpressionError: it is empty, too long or too deep, or has other characters.
    """
    if not text.strip():
        raise ExpressionError("is empty; write a number or an expression")
    if len(text) > MOST_LETTERS:
        raise ExpressionError(
            f"has {len(text)} characters; must be at most {MOST_LETTERS}; use parameters to shorten it"
        )
    if remedy := without_unit(text):
        raise ExpressionError(f"has a unit{remedy}")
    if other := _OTHERS.search(text):
        more = "write ** for powers" if other[0] == "^" else _KNOWN
        raise ExpressionError(f"has the character {other[0]!a}, which is no arithmetic; {more}")
    line = " ".join(text.split())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(line, mode="eval").body
    except SyntaxError as error:
        raise ExpressionError(f"cannot be read ({error.msg}); write, for example, -omega**2 * x") from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(_TOO_DEEP) from None
    return line, tree


@lru_cache(maxsize=1024)
def names_in(text: str) -> frozenset[str]:
    """The names in an expression, without those of functions and constants, nor the time. Raises `ExpressionError`."""
    nodes = [*ast.walk(_parsed(text)[1])]
    has_time = any(isinstance(each, ast.Call) and not _is_function(each.func) for each in nodes)
    names = frozenset(each.id for each in nodes if isinstance(each, ast.Name))
    return names.difference(RESERVED, {TIME} if has_time else ())


def _is_function(node: ast.expr) -> bool:
    """Whether it is the name of a function of numbers."""
    return isinstance(node, ast.Name) and node.id in FUNCTIONS


def _plain(node: ast.expr) -> str:
    """A node as Python writes it. Raises `ExpressionError`."""
    try:
        return ast.unparse(node)
    except RecursionError:
        raise ExpressionError(_TOO_DEEP) from None


def evaluate(text: str, names: Mapping[str, Form], place: str, of_time: OfTime | None = None) -> Form:
    """The value of an expression, all in floating-point numbers.

    Args:
        text: the expression.
        names: what names stand for.
        place: what it is, for messages: "v's rate".
        of_time: what x(t - tau) and cos(nu*t) are, by their names, their arguments and how they are written; None
            where there may be none of these.

    Raises:
        ExpressionError: it is no arithmetic, has other names, is not finite, or of too high a degree.
    """
    line, tree = _parsed(text)
    return _Walk(line, names, place, of_time).value(tree)


def summands(text: str) -> list[tuple[float, str]]:
    """The terms of an expression that is a sum, as they are written, with their signs. Raises `ExpressionError`."""
    line, tree = _parsed(text)
    return [(sign, line[node.col_offset : node.end_col_offset]) for sign, node in _chain(tree, ast.Add, ast.Sub)]


def log_of(text: str, names: Mapping[str, Form], place: str) -> Series:
    """The logarithm of an expression that is a positive number, also near 1 without loss.

    Raises:
        ExpressionError: as `evaluate`, or it is not positive.
    """
    scalar = evaluate(text, names, place).scalar
    if scalar is None:
        raise ExpressionError(f"{place} must be a number or an expression in parameters; leave out the others")
    line, tree = _parsed(text)
    match tree:
        case ast.Call(func=ast.Name("exp"), args=[exponent]):
            return evaluate(line[exponent.col_offset : exponent.end_col_offset], names, place).scalar or scalar
    if not scalar[0] > 0:
        raise ExpressionError(f"{place} is {scalar[0]:.6g}; must be > 0; change it or its parameters")
    if not 0.5 < scalar[0] < 2:
        return _function(scalar, math.log(scalar[0]), 1 / scalar[0])
    forms = [(sign, evaluate(term, names, place)) for sign, term in summands(text)]
    firsts = [sign * form.scalar[0] for sign, form in forms if form.scalar]
    return _function(scalar, math.log1p(math.fsum([*firsts, -1.0])), 1 / scalar[0])


def _chain(node: ast.expr, *kinds: type[ast.operator]) -> list[tuple[float, ast.expr]]:
    """The operands of a sum, or of a product, with 1 or −1 for what is subtracted, or divided by."""
    parts = list[tuple[float, ast.expr]]()
    while isinstance(node, ast.BinOp) and isinstance(node.op, kinds):
        parts.append((-1.0 if isinstance(node.op, _MINUS) else 1.0, node.right))
        node = node.left
    return [(1.0, node), *reversed(parts)]


class _Walk:
    """The values of the nodes of one line: what is no arithmetic, and too many levels, are refused."""

    def __init__(self, line: str, names: Mapping[str, Form], place: str, of_time: OfTime | None) -> None:
        self._line, self._names, self._place, self._of_time, self._level = line, names, place, of_time, 0

    def _source(self, node: ast.expr) -> str:
        return self._line[node.col_offset : node.end_col_offset]

    def written(self, node: ast.expr) -> str:
        """How a node is written, cut to a readable length."""
        return shortened(self._source(node))

    def _read(self, node: ast.expr) -> float:
        """A number with a sign or without; NaN for all else, as for True, 1j and 0x10."""
        try:
            return float(self._source(node).replace(" ", ""))
        except ValueError:
            return math.nan

    def value(self, node: ast.expr) -> Form:
        """The value of a node. Raises `ExpressionError`."""
        self._level += 1
        if self._level > MOST_LEVELS:
            raise ExpressionError(_TOO_DEEP)
        try:
            found, (reason, remedy) = self._form(node), NOT_FINITE
            if all(math.isfinite(each) for series in found.parts.values() for each in series):
                self._level -= 1
                return found
        except (OverflowError, ZeroDivisionError):
            reason, remedy = NOT_FINITE
        except _Unsuitable as unsuitable:
            reason, remedy = unsuitable.args
        states, noises = (
            ", ".join(name for name, form in self._names.items() if any(key[i] for key in form.parts)) for i in (0, 1)
        )
        told = reason.format(states=states, noises=noises)
        raise ExpressionError(f"the term {self.written(node)} of {self._place} {told}; {remedy}")

    def _form(self, node: ast.expr) -> Form:
        """The value of a node from those below it. Raises `ExpressionError`, `_Unsuitable`, `ArithmeticError`."""
        match node:
            case ast.Constant() if not math.isnan(number := self._read(node)):
                return constant(number)
            case ast.Name(id=name):
                return self._named(name)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub() as op, operand=inner):
                return Form({}).plus(self.value(inner), -1.0 if isinstance(op, _MINUS) else 1.0)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                total = Form({})
                for sign, each in _chain(node, ast.Add, ast.Sub):
                    total = total.plus(self.value(each), sign)
                return total
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                total = constant(1.0)
                for sign, each in _chain(node, ast.Mult, ast.Div):
                    total = total.times(self.value(each) if sign > 0 else self.value(each).of(_INVERSE))
                return total
            case ast.BinOp(op=ast.Pow()):
                return self._power(node.left, node.right)
            case ast.Call():
                return self._call(node)
        raise ExpressionError(f"has {self.written(node)}, which is no arithmetic; {_KNOWN}")

    def _named(self, name: str) -> Form:
        if name in CONSTANTS:
            return constant(CONSTANTS[name])
        try:
            return self._names[name]
        except KeyError:
            known = f"known names: {', '.join(self._names) or 'none'}"
            raise ExpressionError(f"{self._place} has the unknown name {name}; {known}; add or rename it") from None

    def _power(self, base: ast.expr, exponent: ast.expr) -> Form:
        power = self._read(exponent)
        if not abs(power) <= LARGEST_POWER:
            must = f"must be a number from -{LARGEST_POWER} to {LARGEST_POWER}"
            raise ExpressionError(f"has the exponent {self.written(exponent)}; {must}; write the factors")
        form = self.value(base)
        if not power.is_integer():
            return form.of(partial(_power, power=power))
        total = constant(1.0)
        for _ in range(abs(int(power))):
            total = total.times(form)
        return total.of(_INVERSE) if power < 0 else total

    def _call(self, node: ast.Call) -> Form:
        name, remedy = self.written(node.func), f"the functions are {' and '.join(FUNCTIONS)}; write * for products"
        if _is_function(node.func):
            if len(node.args) != 1:
                raise ExpressionError(f"has {self.written(node)}, but {name} takes one number; write {name}(...)")
            return self.value(node.args[0]).of(FUNCTIONS[name])
        if self._of_time and isinstance(node.func, ast.Name) and (name in WAVES or name not in _REMEDIES):
            inside = [each for argument in node.args for each in ast.walk(argument)]
            if len(node.args) == 1 and any(isinstance(each, ast.Name) and each.id == TIME for each in inside):
                if any(isinstance(each, ast.Call) and not _is_function(each.func) for each in inside):
                    raise ExpressionError(f"has another call inside {name}(...); {_REMEDIES.get(name, _DELAY)}")
                if (found := self._of_time(name, _plain(node.args[0]), _plain(node))) is not None:
                    return found
        remedy = _REMEDIES.get(name.lower(), remedy)
        raise ExpressionError(f"has {self.written(node)}, which calls no known function; {remedy}")
