"""Means over densities of directions of two modes: second moments by Kronecker squares."""

import math

import numpy as np

from fpsolve import ExponentSolver, OrnsteinUhlenbeck
from fpsolve.analysis import adjoint_density
from fpsolve.model import White
from tests.kit import matrices
from tests.numbers.values import Quantity, Row

OMEGA = 1.6
FREE = np.array([[0, 1, 0, 0], [-1, -0.1, 0, 0], [0, 0, 0, 1], [0, 0, -(OMEGA**2), -0.16]])
COUPLED = -np.array([[0, 0, 0, 0], [0.5, 0, 0.3, 0], [0, 0, 0, 0], [0.3, 0, 0.5, 0]])
UNITS = np.diag([1.0, 1.0, 1.0, 1 / OMEGA])
"""Of rates, divided by their frequencies."""


def modes(noise, units=None):
    """Two modes with noise in their stiffness and between them, in their own units or in others."""
    units = np.eye(4) if units is None else units
    return matrices(*((units @ each @ np.linalg.inv(units)).tolist() for each in (FREE, COUPLED)), noise)


def share_of_second_mode(problem):
    found = adjoint_density(ExponentSolver(problem, rtol=1e-6).pair(2.0))
    return float(found.to_xarray().mean_share), found.error


def by_squares(correlation=None, count=14):
    """The share of the second mode in E zzᵀ as it grows; of OU noise by a series of Hermite functions."""
    free, driven = (UNITS @ each @ np.linalg.inv(UNITS) for each in (FREE, COUPLED))
    free, driven = (np.kron(each, np.eye(4)) + np.kron(np.eye(4), each) for each in (free, driven))
    whole = free + 0.5 * driven @ driven
    if correlation:
        x = np.diag(np.sqrt(np.arange(1.0, count)), 1)
        whole = np.kron(np.eye(count), free) - np.kron(np.diag(np.arange(count)), np.eye(16)) / correlation
        whole = whole + 0.5 * np.kron(x + x.T, driven)
    values, vectors = np.linalg.eig(whole)
    second = vectors[:16, np.argmax(values.real)].real.reshape(4, 4)
    return np.trace(second[2:, 2:]) / np.trace(second)


SHARE = Quantity("share of the second mode", share_of_second_mode)
ROWS = [
    Row(modes(White(s=1.0)), SHARE, by_squares, 1e-4, 0.02, "Kronecker squares of white noise", True),
    Row(
        modes(OrnsteinUhlenbeck(alpha=1.0, sigma=0.5 * math.sqrt(2))),
        SHARE,
        lambda: by_squares(1.0),
        1e-4,
        0.02,
        "Kronecker squares and Hermite functions of Gaussian noise",
        True,
    ),
]
