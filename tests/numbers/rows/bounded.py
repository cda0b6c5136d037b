"""Noise of an angle: moments times harmonics, and Fourier series of the phase."""

from fpsolve.model import Bounded, SineWiener, White
from tests.kit import matrices, rates
from tests.numbers.second import LOAD, spring
from tests.numbers.values import Row, exponent, moment
from tests.oracles import moment_hierarchy, phase_circle

CIRCLE = phase_circle.bounded(spring(), LOAD, 0.4, 2.0, 0.3, 16)


def narrow(mu=0.4, nu=2.0, sigma=0.3, damping=0.05, stiffness=1.0):
    return matrices(spring(stiffness, damping), LOAD, Bounded(mu, nu, sigma))


def mathieu(damping, mu, square):
    """ẍ + 2·damping·ẋ + (1 + μ cos 2t + 0.3 Ẇ)x = 0."""
    problem = matrices(spring(1.0, damping), [LOAD, LOAD], [Bounded(mu, 2.0, 0.0), White(0.3)])
    return [
        Row(problem, moment(2), square, 1e-12, 1e-8, f"multipliers of a harmonic load, μ = {mu}"),
        Row(
            problem,
            moment(4),
            lambda: moment_hierarchy.harmonic_exponent(spring(1.0, damping), LOAD, mu, 2.0, 4, 0.3 * LOAD),
            1e-12,
            1e-8,
            f"multipliers of a harmonic load, μ = {mu}",
        ),
        Row(
            problem,
            exponent(rtol=1e-8),
            lambda: phase_circle.lyapunov_exponent(
                phase_circle.bounded(spring(1.0, damping), LOAD, mu, 2.0, 0.0, 24, 0.3 * LOAD), 60
            ),
            1e-12,
            1e-8,
            f"Fourier series of a harmonic load, μ = {mu}",
            mu < 0.4,
        ),
    ]


ROWS = [
    Row(narrow(), moment(2, rtol=1e-10), 0.0778013340478035, 1e-13, 2e-11, "harmonics of a narrow band"),
    Row(narrow(), exponent(rtol=1e-10), 0.0372304328376, 1e-13, 1e-10, "Fourier series of a narrow band"),
    *(
        Row(
            narrow(),
            moment(p, rtol=1e-10),
            lambda p=p, start=start: phase_circle.moment_exponent(CIRCLE, p, 60, start=start),
            1e-11,
            1e-10,
            "Fourier series of a narrow band",
        )
        for p, start in ((-0.5, -0.0175), (1.0, 0.038))
    ),
    *(
        row
        for sigma in (0.03, 0.001)
        for value, doubt, source in (
            (
                lambda sigma=sigma: moment_hierarchy.bounded_exponent(spring(), LOAD, 0.4, 2.0, sigma, 2, 10),
                1e-12,
                "harmonics",
            ),
            (lambda: moment_hierarchy.harmonic_exponent(spring(), LOAD, 0.4, 2.0, 2), sigma**2, "multipliers"),
        )
        for row in [Row(narrow(sigma=sigma), moment(2), value, doubt, 1e-8, f"{source} of a band of σ = {sigma}")]
    ),
    *mathieu(0.05, 0.4, 0.1129960646376),
    *mathieu(0.1, 0.3, -0.0352313732000),
    *(
        Row(
            rates("x' = v; v' = -x - 0.2*v - xi*x", SineWiener(1.0, 1.0)),
            moment(p, rtol=1e-10),
            value,
            1e-12,
            1e-10,
            "harmonics of a spring under sine-Wiener noise",
        )
        for p, value in ((2, -0.0773243898649), (4, -0.0327771112216))
    ),
]
