"""Exponents that are known in special functions."""

import math

from scipy.special import airy, iv, mathieu_a


def white_stiffness(stiffness, intensity, damping=0.0, restitution=1.0):
    """λ of ẍ + 2bẋ + (k + sξ)x = 0 under white noise, and with a wall at x = 0.

    x = e^{−bt} y, ÿ + (E + sξ)y = 0, E = k − b². With c = (s²/2)^⅓ and z = −E/c² the growth rate of y is
    c (Ai Ai′ + Bi Bi′)/(Ai² + Bi²) and the number of its zeros in unit time N = c/(π²(Ai² + Bi²)) at z, B. I. Halperin,
    Phys. Rev. 139, 1965. The wall adds N ln R.
    """
    c = (intensity**2 / 2) ** (1 / 3)
    ai, dai, bi, dbi = airy(-(stiffness - damping**2) / c**2)
    square = ai**2 + bi**2
    return -damping + c * (ai * dai + bi * dbi) / square + c / (math.pi**2 * square) * math.log(restitution)


def saddle_and_turning():
    """λ, Λ(2) and Λ(−1) of dx = diag(1, −1)x dt + Jx∘dW.

    The stationary density of the phase is exp(cos 2φ)/(π I₀(1)). At p = −1 T exp(½ cos 2φ) obeys
    ½u″ − ½ sin²(2φ) u = Λu, Mathieu's equation u_zz + (a₀ − 2Q cos 2z)u = 0 with z = 2φ, Q = 1/16, a₀ = −½(Λ + ¼).
    """
    return iv(1, 1.0) / iv(0, 1.0), math.sqrt(5) - 1, -0.25 - 2 * float(mathieu_a(0, 1 / 16))
