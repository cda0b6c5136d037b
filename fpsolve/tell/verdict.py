"""What numbers say of stability: first the verdict on each curve, then what follows from δ_p and R_c."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fpsolve.analysis.excursions import SYMBOL
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.exponent.error import digits
from fpsolve.exponent.quantities import CRITICAL_IMPACT_FACTOR, LYAPUNOV_EXPONENT, MOMENT
from fpsolve.results.table import Table
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.intervals import spreads_of
from fpsolve.tell.blocks import Sentence
from fpsolve.tell.text import EACH, fate, likely, short, sign_of

PATH, SQUARE = "almost every path", "the mean square"
"""What λ and Λ(2) tell of."""
BURSTS = (
    "Where the mean square grows though almost every path decays, rare paths carry it in bursts: a design that is "
    "judged by the mean square, by energy or by fatigue is unstable, though one record most likely looks calm."
)

TREATED = {
    "exact": "that of Eq. (7) as it stands",
    "ou-reduction": "Ornstein-Uhlenbeck noise in place of that of Eq. (7), as Eqs. (12)-(14) reduce it",
}
"""What the noise is, by its treatment."""


def verdicts(case: Case, results: Sequence[CurveResult], table: Table) -> Iterator[Sentence]:
    """Of which noise (7) the numbers are, and what becomes of almost every path and of the mean square.

    Args:
        table: the numbers of all curves.
    """
    yield Sentence("", case.headline)
    for key, stated in case.parameters.items():
        if key.endswith(".treatment") and key not in case.vary.keys:
            yield Sentence(f'{key} = "{stated.value}": the noise is {TREATED[str(stated.value)]}.')
    signs = _signs(case, table)
    if len(results) > EACH:
        told = [f"{what} decays in {sum(of < 0)} curves, and grows in {sum(of > 0)}" for what, of in signs.items()]
        yield Sentence(_sentence(told))
    else:
        for each in results:
            if text := verdict(case, each):
                yield Sentence(f"{each.curve.label}: {text[0].lower()}{text[1:]}" if len(results) > 1 else text)
    if len(signs) == 2 and ((signs[PATH] < 0) & (signs[SQUARE] > 0)).any():
        yield Sentence(BURSTS)


def _signs(case: Case, table: Table) -> dict[str, FloatArray]:
    """Those of λ and Λ(2) of all curves, as far as a case asks for them; 0 where an error leaves one open."""
    found = dict[str, FloatArray]()
    for what, name in ((PATH, LYAPUNOV_EXPONENT.name), (SQUARE, MOMENT.name)):
        if name in table and (what == PATH or 2 in case.p):
            value, error = (table[each].values for each in (name, f"{name}_error"))
            value, error = (each if each.ndim == 1 else each[:, case.p == 2][:, 0] for each in (value, error))
            found[what] = np.where(np.abs(value) > error, np.sign(value), 0.0)
    return found


def verdict(case: Case, result: CurveResult) -> str:
    """The verdict on a curve: "Almost every path decays, halving in a time of 40; the mean square grows, ..."."""
    exponent, square, spreads = result.lyapunov_exponent, result.moment(2.0), spreads_of(case, result)
    told = []
    for what, rate, spread in (
        (PATH, exponent, spreads.indices.get(LYAPUNOV_EXPONENT.name)),
        (SQUARE, square, spreads.moments.get(2.0)),
    ):
        if spread:
            told.append(likely(what, spread.below))
        elif rate:
            told.append(fate(what, rate.value, sign := sign_of(rate.value, rate.error_estimate), case.units.time))
            if what == PATH and sign > 0:
                settles = ", and settles into the stationary response" * (result.response is not None)
                is_bounded = result.curve.problem.linear.cubic
                told[0] += f" near rest{settles}" if is_bounded else ", and passes every level in the end"
    return _sentence(told)


def _sentence(told: Sequence[str]) -> str:
    text = "; ".join(told)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def meaning(result: CurveResult) -> Iterator[Sentence]:
    """What δ_p and R_c say, if they are there."""
    index, critical = result.stability_index, result.estimates[CRITICAL_IMPACT_FACTOR.name]
    if index:
        power, number = digits(abs(index.value), index.error_estimate, 4), f"δ_p = {short(index)}"
        yield Sentence(
            f"{number} > 0: moments of the orders 0 < p < δ_p decay, those of p > δ_p grow. The "
            f"probability that a path ever exceeds A times its start, {SYMBOL}, falls as A^-{power}."
            if index.value > 0
            else f"{number} < 0: moments of the orders δ_p < p < 0 decay, as almost every path grows. The "
            f"probability that a path ever falls below a small share a of its start goes as a^{power}."
        )
    if critical:
        loss = "more loss" if critical.value < 1 else "any loss"
        yield Sentence(
            f"R_c = {short(critical)}: with this factor of the speed at an impact λ would be 0; {loss} makes almost "
            "every path decay."
        )
