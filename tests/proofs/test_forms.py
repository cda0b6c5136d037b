"""Bounds on Λ(2) of several variables from a quadratic form, decided anew in fractions, without balls."""

from fractions import Fraction

import numpy as np
import pytest
from pydantic import ValidationError

from fpsolve import OrnsteinUhlenbeck, Problem, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, LinearSystem, White
from fpsolve.proofs import objection, prove
from fpsolve.proofs.forms import FormCertificate
from tests.kit import chain_of_masses

exact = np.vectorize(Fraction, otypes=[object])


def mixed(rng, n):
    """Two white noises, one in Itô's sense, on all of n variables."""
    free, *driven = rng.standard_normal((3, n, n)) / np.sqrt(n)
    terms = [CoefficientMatrix(0, (free - np.eye(n)).tolist())]
    terms += [
        CoefficientMatrix(1, (0.5 * each).tolist(), identity, name) for each, name in zip(driven, "ab", strict=True)
    ]
    return Problem(LinearSystem(terms), {"a": White(s=1.0), "b": White(s=0.7, interpretation="ito")})


def moved(free, first, second):
    """Λ(2) by products of Kronecker, 0.7 of the second noise in Itô's sense."""
    one = np.eye(len(free))
    both = [np.kron(each, one) + np.kron(one, each) for each in (free, first)]
    total = both[0] + 0.5 * both[1] @ both[1] + 0.49 * np.kron(second, second)
    return float(np.max(np.linalg.eigvals(total).real))


def is_positive(matrix):
    """By pivots, in fractions."""
    left = matrix.copy()
    for k in range(len(left)):
        if left[k, k] <= 0:
            return False
        left[k + 1 :, k + 1 :] -= np.outer(left[k + 1 :, k] / left[k, k], left[k, k + 1 :])
    return True


@pytest.mark.parametrize("n", [3, 4, 6])
def test_bounds_hold_in_fractions(n, rng):
    problem = mixed(rng, n)
    found = prove(problem, 2.0)
    certificate = found.certificate
    assert found.width < 1e-7
    assert not objection(certificate)
    free, first, second = (np.array(each.matrix) for each in problem.system.terms)
    assert found.lower - 1e-13 <= moved(free, first, second) <= found.upper + 1e-13
    factor, drift = exact(certificate.factor), exact(certificate.stated.drift)
    form = factor.T @ factor
    noisy = [exact(each) for each in certificate.stated.diffusions]
    drift = drift + sum(each @ each for each in noisy) / 2
    image = drift.T @ form + form @ drift + sum(each.T @ form @ each for each in noisy)
    low, high = (
        Fraction(certificate.mu) + sign * Fraction(side.delta)
        for sign, side in ((-1, certificate.lower), (1, certificate.upper))
    )
    assert is_positive(form)
    assert is_positive(high * form - image)
    assert is_positive(image - low * form)
    assert not objection(certificate.model_copy(update={"lower": None}))


@pytest.mark.parametrize(("key", "change"), [("mu", 1e-6), ("mu", -1e-6)])
def test_what_does_not_follow(key, change, rng):
    certificate = prove(mixed(rng, 4), 2.0).certificate
    assert "is not certain" in objection(certificate.model_copy(update={key: getattr(certificate, key) + change}))
    singular = (np.array(certificate.factor) * [[0.0], [1.0], [1.0], [1.0]]).tolist()
    assert objection(certificate.model_copy(update={"factor": singular})) == "G need not have an inverse"
    written = certificate.model_dump()
    written["factor"].pop()
    with pytest.raises(ValidationError, match="factor must be a matrix of the size"):
        FormCertificate(**written)


def test_many_variables_and_what_is_not_proven():
    free, driven, _ = chain_of_masses(10, 0.2)
    terms = CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)
    problem = Problem(LinearSystem(terms), White(s=0.2))
    found = prove(problem, 2.0)
    assert found.width < 1e-7
    assert found.lower < moment_lyapunov(problem, 2.0).value[0] < found.upper
    assert not prove(problem, 4.0).is_proven
    with pytest.raises(TypeError, match="20 variables under other noise than white"):
        prove(Problem(problem.system, OrnsteinUhlenbeck(1.0, 1.0)), 2.0)
