"""What the tests of the simulation share: problems of moderate and of strong noise, and their Λ(p)."""

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov

MODERATE = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.5, impact="restitution")
STRONG = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0, impact="restitution")
NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9)
REDUCED = NOISE.ou_reduction()


def exact(oscillator, noise, p):
    """Λ(p) by the finite elements."""
    return moment_lyapunov(Problem(oscillator, noise), p, rtol=1e-8).value
