"""The numbers of a parameter set as a terminal and a report say them, and what they say of stability."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from fpsolve.analysis.excursions import SYMBOL, Excursion
from fpsolve.analysis.spreads import Spread
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.data import Quantity
from fpsolve.exponent.error import Estimate, digits
from fpsolve.exponent.quantities import (
    CRITICAL_IMPACT_FACTOR,
    CRITICAL_RESTITUTION,
    LYAPUNOV_EXPONENT,
    MOMENT,
    OF_IMPACTS,
    STABILITY_INDEX,
    SUMMARY_NUMBERS,
    VARIANCE_RATE,
    SummaryNumber,
)
from fpsolve.messages import Code, message_of
from fpsolve.model.coordinates import infinite
from fpsolve.model.quantity import MEAN_SQUARE, ResponseQuantities
from fpsolve.results.table import Table
from fpsolve.solve.intervals import INTERVAL, spreads_of
from fpsolve.solve.set_result import SetResponse, SetResult
from fpsolve.tell.blocks import Block, Column, Grid, Sentence, filled
from fpsolve.tell.text import (
    EACH,
    NUMBER_COLUMNS,
    fate,
    interval,
    likely,
    percent,
    row_of,
    short,
    sign_of,
    units_in_words,
)


def told_summary_numbers(case: Case) -> list[SummaryNumber]:
    """Those that a case asks for, without those of impacts where it names none, and not one ray has them."""
    left_out = () if len(case.system.jumps) == 1 or case.output.lists_quantities else OF_IMPACTS
    return [each for name, each in SUMMARY_NUMBERS.items() if name in case.asked and name not in left_out]


def summary_number_text(quantity: SummaryNumber, result: SetResult, most: int = 17) -> str:
    """A summary number of a parameter set with its digits, or that there is none, or that it was not found out."""
    estimate = result.estimates[quantity.name]
    if estimate is not None:
        return digits(estimate.value, estimate.error_estimate, most)
    told = map(message_of, (*(failure.reason for failure in result.failures), *result.warnings))
    unsolved = {Code.NUMBER_FAILED, Code.NUMBER_MISSING} if result.failures else {Code.NUMBER_FAILED}
    if any(each.code in unsolved and quantity.symbol in each.data["symbols"] for each in told):
        return "not solved"
    if quantity in (STABILITY_INDEX, VARIANCE_RATE) and infinite(result.parameter_set.problem, 1.0, quantity.symbol):
        return "not computed"
    return "none" if quantity == CRITICAL_RESTITUTION else "none found"


def summary_numbers(case: Case, result: SetResult) -> Iterator[Block]:
    """λ, δ_p, Λ(2) and what else is asked for, that of impacts for each ray; not where a figure is over a parameter."""
    if case.figure.x != "p":
        return
    spreads = spreads_of(case, result)
    rows = list[list[str]]()

    def tell(about: Quantity, found: Estimate | None, instead: str, theory: float, spread: Spread | None) -> None:
        words, symbol, number, *more = row_of(about, found, case.units.time)
        closed = f"{theory:.6g}, Eq. {about.closed_form}" if math.isfinite(theory) else ""
        held = interval(spread.low, spread.high) if spread else ""
        rows.append([words, symbol, number or instead, *more, closed, held])

    for quantity in told_summary_numbers(case):
        found = result.estimates[quantity.name]
        theory = quantity.theory(result.parameter_set.problem) if found else math.nan
        tell(quantity, found, summary_number_text(quantity, result), theory, spreads.summary_numbers.get(quantity.name))
    if square := result.moment(2.0):
        [closed] = result.moments.perturbation[result.moments.p == 2]
        tell(MEAN_SQUARE, square, "", closed, spreads.moments.get(2.0))
    if any(result.estimates.values()):
        yield filled("", [*NUMBER_COLUMNS, Column("perturbation theory", 3), Column(INTERVAL, 1)], rows)


def excursions(case: Case, result: SetResult) -> Iterator[Sentence]:
    """What is known of P(sup ‖x‖ ≥ A) for every level, with the start and the norm."""
    found = result.excursion
    if not found or not (told := [text for level in case.excursions.levels if (text := _bounded(found, level))]):
        return
    phi = "uniform φ₀" if isinstance(found.phi, str) else f"φ₀ = {found.phi:.6g}"
    start = f"{phi}, {'stationary noise' if isinstance(found.xi, str) else f'ξ₀ = {found.xi:.6g}'}"
    norm = f"‖x‖ is the length of ({', '.join(result.parameter_set.problem.linear.states)})"
    yield Sentence(f"Start with {start}: {', '.join(told)}; {norm}, and ‖x₀‖ = 1.")


def bounds_text(found: Excursion, level: float, to: str = "-") -> str:
    """The bounds for one level: "0.035-0.054"; empty where there are none."""
    if found.is_certain:
        return "1"
    low, high = map(float, found.bounds(level))
    return f"{_rounded(low, -1)}{to}{_rounded(high, 1)}" if low > 0 or high < 1 else ""


def _bounded(found: Excursion, level: float) -> str:
    symbol, bounds = f"P(sup ‖x‖ ≥ {level:g})", bounds_text(found, level, " and ")
    if bounds:
        return f"{symbol} = 1" if bounds == "1" else f"{symbol} between {bounds}"
    many = float(found.expected_upcrossings(level))
    return f"{symbol} below about {many:.3g}, for large levels" if many < 1 else ""


def _rounded(bound: float, side: int) -> str:
    """A probability with three digits, rounded down or up."""
    if not 0 < bound < 1:
        return f"{bound:g}"
    step = 10.0 ** (math.floor(math.log10(bound)) - 2)
    return f"{(math.floor if side < 0 else math.ceil)(bound / step) * step:.3g}"


def response(case: Case, result: SetResult) -> Iterator[Block]:
    """The means and the impacts with their errors, and where the densities are largest."""
    found, about = result.response, case.problem.linear.response
    if found is None:
        return
    rows = [row_of(about.numbers[name], each, case.units.time) for name, each in found.numbers.items()]
    yield filled(f"Stationary response{result.parameter_set.of}", NUMBER_COLUMNS, rows)
    if found.balance is not None:
        yield Sentence(shape(found, about))


def shape(found: SetResponse, about: ResponseQuantities) -> str:
    """Where the densities of a response are largest: what changes at δ_p = −1 and −2, the P-bifurcations."""
    both = about.joint_symbol
    if not found.has_hump:
        return f"ρ(A) and {both} are infinite at rest, as δ_p > -1."
    plane = "a crater around rest, as δ_p < -2" if found.has_crater else "is infinite there, as δ_p > -2"
    return f"ρ(A) has a hump away from rest, as δ_p < -1, and {both} {plane}."


STAR = "* for the noise reduced by Eqs. (12)-(14)"
"""The remark on perturbation theory of another noise than that which is solved."""


def moment_grid(case: Case, result: SetResult) -> Grid:
    """Λ(p) at each p, with its error, its interval, and perturbation theory."""
    found, spreads = result.moments, spreads_of(case, result).moments
    closed_form = f"Eq. {MOMENT.closed_form}{'*' if result.parameter_set.noise.approximates_spectrum else ''}"
    columns = Column("p"), Column(MOMENT.symbol), Column("± error"), Column(INTERVAL), Column("P(Λ < 0)")
    more = Column(f"perturbation, {closed_form}", 1), Column("difference", 2)
    rows, has_theory = list[list[str]](), any(map(math.isfinite, found.perturbation))
    for p, value, error, closed in zip(found.p, found.value, found.error_estimate, found.perturbation, strict=True):
        spread = spreads.get(float(p))
        row = [f"{p + 0.0:g}", digits(value, error), f"{error:.0e}" if error else "0"]
        row += [interval(spread.low, spread.high), percent(spread.below)] if spread else ["", ""]
        row += [f"{closed + 0.0:.6g}", f"{value - closed + 0.0:.2e}"] if has_theory else ["", ""]
        rows.append(row)
    has_star = has_theory and "*" in closed_form
    remarks = STAR * has_star, units_in_words(case.units.time, [MOMENT])
    return filled("", [*columns, *more], rows, "; ".join(filter(None, remarks)))


PATH, SQUARE = "almost every path", "the mean square"
"""What λ and Λ(2) tell of."""
BURSTS = (
    "Where the mean square grows and almost every path decays, rare paths carry the growth in bursts. Judged by its "
    "mean square or its energy the system is unstable there, although one record most likely looks calm."
)

TREATED = {
    "exact": "the noise is that of Eq. (7)",
    "ou-reduction": "Ornstein-Uhlenbeck noise, Eqs. (12)-(14), replaces the noise of Eq. (7)",
}
"""What the noise is, by its treatment."""


def verdicts(case: Case, results: Sequence[SetResult], table: Table) -> Iterator[Sentence]:
    """Of which noise (7) the numbers are, and what becomes of almost every path and of the mean square.

    Args:
        table: the numbers of all parameter sets.
    """
    yield Sentence("", case.headline)
    for key, stated in case.parameters.items():
        if key.endswith(".treatment") and key not in case.vary.keys:
            yield Sentence(f'{key} = "{stated.value}": {TREATED[str(stated.value)]}.')
    signs = _signs(case, table)
    if len(results) > EACH:
        told = [f"{what} decays in {sum(of < 0)} parameter sets, grows in {sum(of > 0)}" for what, of in signs.items()]
        yield Sentence(_sentence(told))
    else:
        for each in results:
            if text := verdict(case, each):
                yield Sentence(f"{each.parameter_set.label}: {text[0].lower()}{text[1:]}" if len(results) > 1 else text)
    if len(signs) == 2 and ((signs[PATH] < 0) & (signs[SQUARE] > 0)).any():
        yield Sentence(BURSTS)


def _signs(case: Case, table: Table) -> dict[str, FloatArray]:
    """Those of λ and Λ(2) of all parameter sets, as far as a case asks for them; 0 where an error leaves one open."""
    found = dict[str, FloatArray]()
    for what, name in ((PATH, LYAPUNOV_EXPONENT.name), (SQUARE, MOMENT.name)):
        if name in table and (what == PATH or 2 in case.p):
            both = (table[each].values for each in (name, f"{name}_error"))
            value, error = (each if what == PATH else each[:, case.p == 2][:, 0] for each in both)
            found[what] = np.where(np.abs(value) > error, np.sign(value), 0.0)
    return found


def verdict(case: Case, result: SetResult) -> str:
    """The verdict on a set: "Almost every path decays, halving in a time of 40; the mean square grows, ..."."""
    spreads, told = spreads_of(case, result), list[str]()
    for what, rate, spread in (
        (PATH, result.lyapunov_exponent, spreads.summary_numbers.get(LYAPUNOV_EXPONENT.name)),
        (SQUARE, result.moment(2.0), spreads.moments.get(2.0)),
    ):
        if spread:
            told.append(likely(what, spread.below))
        elif rate:
            told.append(fate(what, rate.value, sign := sign_of(rate.value, rate.error_estimate), case.units.time))
            if what == PATH and sign > 0:
                settles = ", and settles into the stationary response" * (result.response is not None)
                is_bounded = result.parameter_set.problem.linear.cubic
                told[0] += f" near rest{settles}" if is_bounded else ", without bound"
    return _sentence(told)


def _sentence(told: Sequence[str]) -> str:
    text = "; ".join(told)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def meaning(result: SetResult) -> Iterator[Sentence]:
    """What δ_p and R_c say, if they are there."""
    index, critical = result.stability_index, result.estimates[CRITICAL_IMPACT_FACTOR.name]
    if index:
        power, number = digits(abs(index.value), index.error_estimate, 4), f"δ_p = {short(index)}"
        yield Sentence(
            f"{number} > 0: moments of order p decay for 0 < p < δ_p and grow for p > δ_p. The "
            f"probability that a path ever exceeds A times its start, {SYMBOL}, falls as A^-{power}."
            if index.value > 0
            else f"{number} < 0: moments of order p decay for δ_p < p < 0, as almost every path grows. The "
            f"probability that a path ever falls below a small share a of its start goes as a^{power}."
        )
    if critical:
        loss = "more loss" if critical.value < 1 else "any loss"
        yield Sentence(
            f"R_c = {short(critical)}: λ would be 0 if an impact multiplied the speed by this factor; {loss} makes "
            "almost every path decay."
        )
