"""The checker of certificates takes proofs and refuses what does not follow."""

import copy
import math
from decimal import Decimal

import mpmath
import numpy as np
import pytest

from tests.conftest import sampled
from tests.oracles import certificate_checker as checker
from tests.oracles import certificate_condition as condition
from tests.oracles import certificate_statement as statement
from tests.oracles import fourier_hermite
from tests.proofs.by_definition import applied, trial
from tests.proofs.mutations import mutations, violated
from tests.proofs.weak_noise import PARAMETERS, certified, log_factor

EXACT = {name: value for name, value in PARAMETERS.items() if not name.startswith("noise")}
EXACT |= {"noise.D0": "0.4", "noise.tau0": "0.6", "noise.r0": "0.7", "noise.treatment": "exact"}
REACHED = {**EXACT, "noise.r0": "-1.5"}


def oracle(parameters, p):
    """Λ(p) from another code; λ by a central difference of third order of it."""
    v = {name.partition(".")[2]: float(x) for name, x in parameters.items() if name != "oscillator.impact"}

    def moment(order):
        return fourier_hermite.moment_lyapunov(
            **{name: v[name] for name in ("alpha", "sigma", "omega", "epsilon", "c1")},
            **{"log_R": log_factor(parameters), "p": order, "harmonics": 5, "hermite": 11},
        )

    if p is not None:
        return moment(p)
    h = 0.05
    return (8 * (moment(h) - moment(-h)) - moment(2 * h) + moment(-2 * h)) / (12 * h)


@pytest.fixture(scope="module", params=[2.0, -1.0, None])
def entry(request):
    """Certificates of weak noise."""
    return certified(request.param)


@pytest.fixture(scope="module")
def second():
    """A certificate of the second moment."""
    return certified(2.0)


def test_a_proof_is_taken(entry):
    assert checker.check(entry) == ""
    value = oracle(entry["certificate"]["parameters"], entry["p"])
    assert entry["lower"] < value < entry["upper"]
    assert not violated(entry["certificate"])


@pytest.mark.parametrize("every", sampled(7, 1))
def test_mutations_are_refused(entry, every):
    """All whose claim cannot follow; and these are most."""
    changed = list(mutations(entry, oracle))[::every]
    broken = [m for m in changed if not m.may_follow]
    assert len(broken) > 0.6 * len(changed)
    assert [m.change for m in broken if checker.check(m.entry) == ""] == []


@pytest.mark.parametrize("p", [2.0, -1.0])
def test_w_of_either_sign_levels_a_rough_trial_function(p, rng):
    """Few harmonics and degrees: |Lu/u − μ| is far greater than either δ; and neither W serves the other bound."""
    entry = certified(p, harmonics=2, degrees=3)
    certificate = entry["certificate"]
    assert checker.check(entry) == ""
    points = zip(rng.uniform(0, math.pi, 60), rng.uniform(-4, 4, 60), strict=True)
    worst = max(abs(applied(certificate, phi, z) / trial(certificate, phi, z)) for phi, z in points)
    for name, other in (("upper", "lower"), ("lower", "upper")):
        side = certificate[name]
        assert side["delta"] < 0.5 * worst
        assert (np.array(side["values"]) * side["nodes"] < 0).any()
        reason = checker.check(altered(entry, {other: side}) | {"lower": -1, "upper": 1})
        assert reason.startswith(f"The {other} condition fails")


def psi(side, z, sign):
    """qψ about z, zero there, from W in its cell."""
    nodes, values = np.array(side["nodes"]), np.array(side["values"])
    j = int(np.searchsorted(nodes, z)) - 1
    slope = (mpmath.mpf(values[j + 1]) - values[j]) / (mpmath.mpf(nodes[j + 1]) - nodes[j])
    w = values[j] + slope * (z - nodes[j])
    return lambda y: sign * (w * (y - z) + slope * (y - z) ** 2 / 2)


@pytest.mark.parametrize("p", [2.0, None])
@pytest.mark.parametrize(("name", "sign"), [("upper", 1), ("lower", -1)])
def test_what_a_proof_says_of_the_generator(p, name, sign, rng):
    """LT ≤ (μ + δ)T or LT ≥ (μ − δ)T at random points of the core and of both tails, by derivatives of T itself."""
    certificate = certified(p)["certificate"]
    side = certificate[name]
    nodes = side["nodes"]
    beyond = [nodes[-1] + 1e-9, nodes[-1] + 3, nodes[-1] + 30, nodes[0] - 0.1, nodes[0] - 5]
    for z in (*rng.uniform(nodes[0], nodes[-1], size=10), *beyond):
        phi, z = mpmath.mpf(rng.uniform(0, math.pi)), mpmath.mpf(z)
        end = min(max(z, mpmath.mpf(nodes[0])), mpmath.mpf(nodes[-1]))
        kappa = mpmath.mpf(side["tails"][int(z > 0)])
        extra = psi(side, z, sign) if z == end else lambda y, z=z, s=sign * kappa: s * (y - z)

        def held(c, x, y, z=z, end=end):
            return trial(c, x, y if z == end else end)

        with mpmath.workdps(40):
            value = applied(certificate, phi, z, held, extra)
            value /= held(certificate, phi, z) if p is not None else 1
        assert sign * value <= side["delta"]


@pytest.mark.parametrize("parameters", sampled(EXACT, PARAMETERS, REACHED))
@pytest.mark.parametrize(("toward", "end"), [(1, 0.6), (-1, -0.6), (-1, 0.5), (1, -0.5)])
@pytest.mark.parametrize(("sign", "kappa"), [(1, 1.2), (-1, 1.2), (1, -0.3)])
def test_tails_of_any_sign(parameters, toward, end, sign, kappa, rng):
    """A tail may begin beyond the middle of the noise, and be flatter than u: the least δ taken bounds it all."""
    certificate = {
        **{"quantity": "moment", "p": "0.5", "parameters": parameters, "mu": 0.3},
        "basis": {"kind": "core", "centre": 0.0, "scale": 0.5, "gauge": 0.7 * toward},
        "cosine": [[1.0, 0.02], [0.01, 0.01]],
        "sine": [[0.0, 0.0], [0.03, -0.01]],
    }
    model = statement.model_of(certificate)
    found, kappa, low, high = statement.read_trial(model, certificate), kappa * toward, 0.0, 50.0
    nodes, ones = np.sort([end, end - 0.1 * toward]), np.ones(2)

    def taken(delta):
        side = statement.Side("upper", sign, delta, nodes, 2.0 * toward * ones, kappa * ones)
        try:
            checker._check_tail(model, found, side, toward)
        except statement.Refused:
            return False
        return True

    assert taken(high)
    while high - low > 1e-3 and high > 1e-6:
        low, high = (low, (low + high) / 2) if taken((low + high) / 2) else ((low + high) / 2, high)
    far = 1 if parameters is not PARAMETERS else 20
    for z in end + (toward * far - end) * np.array([1e-12, 0.02, 0.1, 0.4, 0.7, 0.95]):
        for phi in rng.uniform(0, math.pi, size=3):
            value = applied(
                certificate,
                mpmath.mpf(phi),
                mpmath.mpf(z),
                lambda c, x, y: trial(c, x, mpmath.mpf(end)),
                lambda y, z=z: sign * kappa * (y - z),
            )
            assert sign * value / trial(certificate, mpmath.mpf(phi), mpmath.mpf(end)) <= high


@pytest.mark.parametrize(("toward", "sign"), [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_the_slope_at_an_end_of_the_core(toward, sign):
    """q times the slope of ln T falls there: W may jump to κ by the least, over the phase, of q u_z/u and no more."""
    certificate = {
        **{"quantity": "moment", "p": "0.5", "parameters": PARAMETERS, "mu": 0.0},
        "basis": {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0},
        **{"cosine": [[1.0, 0.02], [0.0, 0.01]], "sine": [[0.0, 0.0], [0.0, 0.01]]},
    }
    model, end = statement.model_of(certificate), 0.5 * toward
    found, nodes = statement.read_trial(model, certificate), np.sort([end, 0.0])
    phi = np.linspace(0, np.pi, 5000)
    wave = 0.02 + 0.01 * (np.cos(2 * phi) + np.sin(2 * phi))
    kappa = toward * (1 + np.min(sign * toward * wave / (1 + end * wave)))
    for flatter, reason in ((1 - 1e-5, ""), (1 + 1e-5, "jumps")):
        side = statement.Side("upper", sign, 9.0, nodes, np.full(2, 1.0 * toward), np.full(2, kappa * flatter))
        if reason:
            with pytest.raises(statement.Refused, match=reason):
                checker._check_tail(model, found, side, toward)
        else:
            checker._check_tail(model, found, side, toward)


def constant(parameters, kind):
    """Λ(p) = 0 of an oscillator without damping, noise and loss, ε = 0, with u = 1 and W next to 0."""
    whole = kind == "whole"
    certificate = {
        **{"quantity": "moment", "p": "1.5", "mu": 0.0, "phases": 8},
        "basis": {"kind": "whole"} if whole else {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0},
        "parameters": {**parameters, "oscillator.epsilon": "0"},
        **{"cosine": [[1.0, 0.0]], "sine": [[0.0, 0.0]]},
    }
    for name in ("upper", "lower"):
        certificate[name] = {
            "delta": 1e-12,
            "nodes": [-1.0, 0.25, 1.0] if whole else [-0.5, 0.75],
            "values": [0.0, 0.0, 0.0] if whole else [-1e-59, 1e-59],
            "tails": None if whole else [-1e-60, 1e-60],
        }
    return {"p": 1.5, "lower": -1e-9, "upper": 1e-9, "certificate": certificate}


CONSTANTS = [(PARAMETERS, "core"), (EXACT, "core"), (EXACT, "whole"), (REACHED, "whole"), (REACHED, "core")]


@pytest.mark.parametrize(("parameters", "kind"), CONSTANTS)
def test_a_system_at_rest(parameters, kind):
    """Λ = 0; and nothing else."""
    entry = constant(parameters, kind)
    assert checker.check(entry) == ""
    for mu, name in ((1e-10, "lower"), (-1e-10, "upper")):
        reason = checker.check(altered(entry, {"mu": mu}))
        assert reason.startswith(f"The {name}")
        assert "fails" in reason


def test_the_moment_of_order_zero(entry):
    """Λ(0) = 0 needs no trial function."""
    zero = {"p": "0", "mu": 1e-9, "upper": {"delta": 0.0}, "lower": {"delta": 1e-9}, "cosine": []}
    new = altered(entry, {"quantity": "moment", **zero}) | {"p": 0.0, "lower": 0, "upper": 1.1e-9}
    assert checker.check(new) == ""
    assert "order 0" in checker.check(altered(new, {"mu": 1.1e-9}))
    assert "order 0" in checker.check(altered(new, {"mu": -1e-11}) | {"lower": -2e-9})


@pytest.mark.parametrize("name", ["upper", "lower"])
def test_a_positive_slope_needs_room(name):
    """W = 1e-12 z about the middle: ½W′ ≤ δ/ν there, and not a little more."""
    entry, nu = constant(EXACT, "whole"), 0.3 / 0.6
    side = entry["certificate"][name]
    side["nodes"], side["values"] = [-1.0, 0.0, 1.0], [-1e-12, 0.0, 1e-12]
    side["delta"] = 0.501e-12 * nu
    assert checker.check(entry) == ""
    side["delta"] = 0.499e-12 * nu
    assert f"{name} condition fails between z = -1 and 0" in checker.check(entry)
    side["delta"], side["values"] = 1e-10, [1e-12, 0.0, 1e-12]
    assert "pushes out" in checker.check(entry)


@pytest.mark.parametrize(("name", "sign"), [("upper", 1), ("lower", -1)])
def test_the_square_of_w(name, sign):
    """W = W₀ all over counts −½qW² and bW against it at z = 0: δ = ½νW₀² for the upper bound, −δ for the lower."""
    w, nu = 0.5, 0.3 / 0.6
    certificate = {
        **{"quantity": "moment", "p": "1.5", "mu": 0.0, "parameters": {**EXACT, "oscillator.epsilon": "0"}},
        "basis": {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0},
        **{"cosine": [[1.0, 0.0]], "sine": [[0.0, 0.0]]},
    }
    model = statement.model_of(certificate)
    found = statement.read_trial(model, certificate)
    for slack in (-1e-6, 1e-6):
        delta = sign * nu * w**2 / 2 + slack
        side = statement.Side(name, sign, delta, np.array([0.0, 1e-9]), np.array([w, w]), np.zeros(2))
        if slack > 0:
            condition.check(model, found, side, 16)
        else:
            with pytest.raises(statement.Refused, match="fails"):
                condition.check(model, found, side, 16)


def altered(entry, changes):
    """An entry with other members of its certificate, of a side of it ("upper.delta") or of its parameters."""
    new = copy.deepcopy(entry)
    for name, value in changes.items():
        head, _, tail = name.partition(".")
        certificate = new["certificate"]
        if head in ("upper", "lower") and tail:
            certificate[head][tail] = value
        else:
            (certificate["parameters"] if tail else certificate)[name] = value
    return new


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"quantity": "else"}, "quantity"),
        ({"mu": math.nan}, "finite"),
        ({"upper.delta": -1e-9}, "delta"),
        ({"lower.delta": -1e-9}, "delta"),
        ({"lower": None}, "read"),
        ({"mu": "0.1"}, "number"),
        ({"p": "2.5"}, "another p"),
        ({"oscillator.omega": "-1"}, "forward"),
        ({"oscillator.epsilon": "3", "oscillator.impact": "restitution"}, "positive factor"),
        ({"oscillator.impact": "none"}, "impact"),
        ({"noise.treatment": "exact", "noise.r0": "1.2", "noise.D0": "1", "noise.tau0": "1"}, "r0"),
        ({"noise.treatment": "ou-reduction", "noise.r0": "1.7", "noise.D0": "1", "noise.tau0": "1"}, "5/3"),
        ({"noise.sigma": "1e999999999"}, "range"),
        ({"basis": {"kind": "whole"}}, "bounded noise"),
        ({"upper.tails": None}, "tails"),
        ({"lower.tails": [1.0]}, "tails"),
        ({"basis": {"kind": "core"}}, "read"),
        ({"basis": {"kind": "core", "centre": 0.0, "scale": 0.0, "gauge": 0.0}}, "scale"),
        ({"upper.tails": [0.3, 0.3]}, "flatter"),
        ({"lower.tails": [0.3, 0.3]}, "lower tail beyond -8.33143 is flatter"),
        ({"upper.tails": [-0.3, 0.7]}, "jumps"),
        ({"lower.tails": [-0.3, 1e-9]}, "too slowly"),
        ({"upper.nodes": [0.0, 0.0], "upper.values": [0.0, 0.0]}, "rise"),
        ({"lower.nodes": [0.0, 1.0], "lower.values": [0.0]}, "match"),
        ({"cosine": [[-1.0, 0.0]], "sine": [[0.0, 0.0]]}, "positive"),
        ({"cosine": [[1.0, 0.0]], "sine": [[0.0]]}, "read"),
    ],
)
def test_reasons(changes, reason, second):
    assert reason in checker.check(altered(second, changes))


def test_gauge_needs_a_moment_and_steep_tails(second):
    gauge = {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.5}
    assert "gauge" in checker.check(altered(certified(None), {"basis": gauge}))
    assert "flatter" in checker.check(altered(second, {"basis": gauge}))


def test_a_claim_is_compared_exactly(entry):
    """The decimals of a file count, not the floats they are rounded to."""
    certificate = entry["certificate"]
    mu, delta = (Decimal(x) for x in (certificate["mu"], certificate["lower"]["delta"]))
    with mpmath.workdps(30):
        text = f"{mpmath.mpf(certificate['mu']) - mpmath.mpf(certificate['lower']['delta'])}"
    assert abs(Decimal(text) - (mu - delta)) < Decimal("1e-30")
    below, above = (Decimal(text) + s * Decimal("1e-30") for s in (-1, 1))
    assert float(below) == float(above)
    assert checker.check({**entry, "lower": below}) == ""
    assert "lower" in checker.check({**entry, "lower": above})
    assert checker.read('{"lower": 0.1}') == {"lower": Decimal("0.1")}
