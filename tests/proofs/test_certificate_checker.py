"""The checker of certificates takes proofs and refuses what does not follow."""

import copy
import math
from decimal import Decimal

import mpmath
import numpy as np
import pytest

from tests.oracles import certificate_checker as checker
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
            **{"log_R": log_factor(parameters), "p": order, "harmonics": 7, "hermite": 14},
        )

    if p is not None:
        return moment(p)
    h = 0.05
    return (8 * (moment(h) - moment(-h)) - moment(2 * h) + moment(-2 * h)) / (12 * h)


@pytest.fixture(scope="module", params=[2.0, -1.0, None])
def entry(request):
    """Certificates of weak noise."""
    return certified(request.param)


def test_a_proof_is_taken(entry):
    assert checker.check(entry) == ""
    value = oracle(entry["certificate"]["parameters"], entry["p"])
    assert entry["lower"] < value < entry["upper"]
    assert not violated(entry["certificate"])


def test_mutations_are_refused(entry):
    """All whose claim cannot follow; and these are most."""
    changed = list(mutations(entry, oracle))
    broken = [m for m in changed if not m.may_follow]
    assert len(broken) > 0.6 * len(changed)
    assert [m.change for m in broken if checker.check(m.entry) == ""] == []


def psi(certificate, z, sign):
    """±ψ about z, zero there, from W in its cell."""
    nodes, values = np.array(certificate["nodes"]), np.array(certificate["values"])
    j = int(np.searchsorted(nodes, z)) - 1
    slope = (mpmath.mpf(values[j + 1]) - values[j]) / (mpmath.mpf(nodes[j + 1]) - nodes[j])
    w = values[j] + slope * (z - nodes[j])
    return lambda y: sign * (w * (y - z) + slope * (y - z) ** 2 / 2)


@pytest.mark.parametrize("p", [2.0, None])
def test_what_a_proof_says_of_the_generator(p, rng):
    """LT ≤ (μ + δ)T and LT ≥ (μ − δ)T at random points of the core and of both tails, by derivatives of T itself."""
    certificate = certified(p)["certificate"]
    nodes, delta = certificate["nodes"], certificate["delta"]
    beyond = [nodes[-1] + 1e-9, nodes[-1] + 3, nodes[-1] + 30, nodes[0] - 0.1, nodes[0] - 5]
    for z in (*rng.uniform(nodes[0], nodes[-1], size=10), *beyond):
        phi, z = mpmath.mpf(rng.uniform(0, math.pi)), mpmath.mpf(z)
        end = min(max(z, mpmath.mpf(nodes[0])), mpmath.mpf(nodes[-1]))
        for sign in (1, -1):
            kappa = mpmath.mpf(certificate["tails"][int(z > 0)])
            extra = psi(certificate, z, sign) if z == end else lambda y, z=z, s=sign * kappa: s * (y - z)

            def held(c, x, y, z=z, end=end):
                return trial(c, x, y if z == end else end)

            with mpmath.workdps(40):
                value = applied(certificate, phi, z, held, extra)
                value /= held(certificate, phi, z) if p is not None else 1
            assert sign * value <= delta


@pytest.mark.parametrize("parameters", [PARAMETERS, EXACT, REACHED])
@pytest.mark.parametrize(("side", "end"), [(1, 0.6), (-1, -0.6), (-1, 0.5), (1, -0.5)])
def test_tails_of_any_sign(parameters, side, end, rng):
    """A tail may begin beyond the middle of the noise: with the least δ that is taken, both bounds hold in it."""
    certificate = {
        **{"quantity": "moment", "p": "1.5", "parameters": parameters, "mu": 0.3, "delta": 0.1, "phases": 64},
        "basis": {"kind": "core", "centre": 0.0, "scale": 0.5, "gauge": 0.3 * side},
        "cosine": [[1.0, 0.02], [0.01, 0.01]],
        "sine": [[0.0, 0.0], [0.03, -0.01]],
        **{"nodes": sorted([end, end - 0.1 * side]), "values": [0.0, 0.0], "tails": [-1.0, 1.0]},
    }
    model = statement.model_of(certificate)
    found, *_ = statement.read_trial(model, certificate)
    kappa, low, high = 1.2 * side, 0.0, 50.0

    def taken(delta):
        try:
            checker._check_tail(model._replace(delta=delta), found, side, end, 2.0 * side, kappa)
        except statement.Refused:
            return False
        return True

    assert taken(high)
    while high - low > 1e-3 and high > 1e-6:
        low, high = (low, (low + high) / 2) if taken((low + high) / 2) else ((low + high) / 2, high)
    far = 1 if parameters is not PARAMETERS else 20
    for z in end + (side * far - end) * np.array([1e-12, 0.02, 0.1, 0.4, 0.7, 0.95]):
        for phi in rng.uniform(0, math.pi, size=3):
            for sign in (1, -1):
                value = applied(
                    certificate,
                    mpmath.mpf(phi),
                    mpmath.mpf(z),
                    lambda c, x, y: trial(c, x, mpmath.mpf(end)),
                    lambda y, s=sign, z=z: s * kappa * (y - z),
                )
                assert sign * value / trial(certificate, mpmath.mpf(phi), mpmath.mpf(end)) <= high


def constant(parameters, kind):
    """Λ(p) = 0 of an oscillator without damping, noise and loss, ε = 0, with u = 1 and W next to 0."""
    whole = kind == "whole"
    certificate = {
        **{"quantity": "moment", "p": "1.5", "mu": 0.0, "delta": 1e-12, "phases": 8},
        "basis": {"kind": "whole"} if whole else {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0},
        "parameters": {**parameters, "oscillator.epsilon": "0"},
        **{"cosine": [[1.0, 0.0]], "sine": [[0.0, 0.0]]},
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
    entry["certificate"]["mu"] = 1e-10
    assert "fails" in checker.check(entry)


def test_the_moment_of_order_zero(entry):
    """Λ(0) = 0 needs no trial function."""
    new = altered(entry, quantity="moment", p="0", mu=1e-9, delta=1e-9, cosine=[], nodes=[])
    assert checker.check({**new, "p": 0.0, "lower": 0, "upper": 2.1e-9}) == ""
    new["certificate"]["mu"] = -1.1e-9
    assert "order 0" in checker.check({**new, "p": 0.0, "lower": -3e-9, "upper": 0})


def test_a_positive_slope_needs_room():
    """W = 1e-6 z about the middle: ½W′ ≤ δ/ν there, and not a little more."""
    entry = constant(EXACT, "whole")
    nu, certificate = 0.3 / 0.6, entry["certificate"]
    certificate["nodes"], certificate["values"] = [-1.0, 0.0, 1.0], [-1e-12, 0.0, 1e-12]
    certificate["delta"] = 0.501e-12 * nu
    assert checker.check(entry) == ""
    certificate["delta"] = 0.499e-12 * nu
    assert "z = -1 and 0" in checker.check(entry)
    certificate["delta"], certificate["values"] = 1e-10, [1e-12, 0.0, 1e-12]
    assert "z = -1 and 0" in checker.check(entry)


def altered(entry, **changes):
    """An entry with other members of its certificate; None removes one, keys with dots are parameters."""
    new = copy.deepcopy(entry)
    for name, value in changes.items():
        name = name.replace("__", ".")
        where = new["certificate"]["parameters"] if "." in name else new["certificate"]
        where[name] = value
    return new


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"quantity": "else"}, "quantity"),
        ({"mu": math.nan}, "finite"),
        ({"delta": -1e-9}, "delta"),
        ({"mu": "0.1"}, "number"),
        ({"p": "2.5"}, "another p"),
        ({"oscillator__omega": "-1"}, "forward"),
        ({"oscillator__epsilon": "3", "oscillator__impact": "restitution"}, "positive factor"),
        ({"oscillator__impact": "none"}, "impact"),
        ({"noise__treatment": "exact", "noise__r0": "1.2", "noise__D0": "1", "noise__tau0": "1"}, "r0"),
        ({"noise__treatment": "ou-reduction", "noise__r0": "1.7", "noise__D0": "1", "noise__tau0": "1"}, "5/3"),
        ({"noise__sigma": "1e999999999"}, "range"),
        ({"basis": {"kind": "whole"}}, "tails"),
        ({"basis": {"kind": "whole"}, "tails": None}, "bounded noise"),
        ({"basis": {"kind": "core"}}, "read"),
        ({"basis": {"kind": "core", "centre": 0.0, "scale": 0.0, "gauge": 0.0}}, "scale"),
        ({"tails": [0.3, 0.3]}, "flatter"),
        ({"tails": [-0.3, 0.6]}, "jumps"),
        ({"tails": [-0.3, 1e-9]}, "too slowly"),
        ({"nodes": [0.0, 0.0], "values": [0.0, 0.0]}, "rise"),
        ({"nodes": [0.0, 1.0], "values": [0.0]}, "match"),
        ({"cosine": [[-1.0, 0.0]], "sine": [[0.0, 0.0]]}, "positive"),
        ({"cosine": [[1.0, 0.0]], "sine": [[0.0]]}, "read"),
    ],
)
def test_reasons(changes, reason):
    assert reason in checker.check(altered(certified(2.0), **changes))


def test_gauge_needs_a_moment_and_steep_tails():
    gauge = {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.5}
    assert "gauge" in checker.check(altered(certified(None), basis=gauge))
    assert "flatter" in checker.check(altered(certified(2.0), basis=gauge))


def test_a_claim_is_compared_exactly(entry):
    """The decimals of a file count, not the floats they are rounded to."""
    mu, delta = (Decimal(entry["certificate"][name]) for name in ("mu", "delta"))
    with mpmath.workdps(30):
        text = f"{mpmath.mpf(entry['certificate']['mu']) - mpmath.mpf(entry['certificate']['delta'])}"
    assert abs(Decimal(text) - (mu - delta)) < Decimal("1e-30")
    below, above = (Decimal(text) + s * Decimal("1e-30") for s in (-1, 1))
    assert float(below) == float(above)
    assert checker.check({**entry, "lower": below}) == ""
    assert "lower" in checker.check({**entry, "lower": above})
    assert checker.read('{"lower": 0.1}') == {"lower": Decimal("0.1")}


def test_splitting_a_cell_keeps_w_within_its_range():
    """The parts of a cell that is too coarse cover it and the values of W in it."""
    nodes, values = np.array([0.1, 0.7, 0.9]), np.array([-0.3, 1e5, 1e5 + 1])
    parts = checker._divided(nodes, values, np.array([0, 1]), 4)
    assert parts.left[0] == 0.1
    assert parts.right[3] == parts.left[4] == 0.7
    np.testing.assert_array_equal(parts.right[:3], parts.left[1:4])
    for j, (left, right) in enumerate(zip(parts.left, parts.right, strict=True)):
        cell = j // 4
        for z in (left, right):
            w = mpmath.mpf(values[cell]) + (mpmath.mpf(values[cell + 1]) - values[cell]) * (
                (mpmath.mpf(z) - nodes[cell]) / (mpmath.mpf(nodes[cell + 1]) - nodes[cell])
            )
            assert parts.least[j] <= w <= parts.most[j]
