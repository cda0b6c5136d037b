"""Certificates for weak Ornstein-Uhlenbeck noise, from a small dense Galerkin system in floats.

The noise needs no tilt: u is a Fourier-Hermite series about z = 0 with the gauge 0.  W levels e, the greatest over
the phase, to its mean over the noise: ½W′ − Wz/2 = (mean e − e)/ν.  To that comes k z e^{z²/4}, which lifts W to
`STEEPEST` where the core ends; k and the nodes of the two bounds differ.  Each δ is read off samples; nothing here is
rigorous, as the checker decides.
"""

import numpy as np

STEEPEST, TAIL = 0.5, 0.3  # |W| at the ends of the core, and beyond them
PARAMETERS = {
    "oscillator.omega": "1.2",
    "oscillator.restitution": "0.8",
    "oscillator.c1": "0.1",
    "oscillator.epsilon": "0.1",
    "oscillator.impact": "restitution",
    "noise.alpha": "1.7",
    "noise.sigma": "0.9",
}


def certified(p, parameters=PARAMETERS, harmonics=4, degrees=6):
    """An entry with the certificate of Λ(p), or of λ if p is None."""
    model = _Model(parameters, p, harmonics, degrees)
    mu, u = model.moment() if p is not None else model.drift()
    u = u.reshape(2 * harmonics + 1, degrees)
    upper, lower = (_side(p, parameters, mu, u, *side) for side in ((1, 1e-9, 401), (-1, 2e-9, 351)))
    table = u[harmonics:]
    cosine, sine = 2 * table.real, -2 * table.imag
    cosine[0], sine[0] = table[0].real, 0
    certificate = {
        "quantity": "moment" if p is not None else "lyapunov_exponent",
        "p": None if p is None else str(p),
        "parameters": dict(parameters),
        "mu": mu,
        "upper": upper,
        "lower": lower,
        "basis": {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0},
        "cosine": cosine.tolist(),
        "sine": sine.tolist(),
        "phases": 128,
    }
    bounds = {"lower": mu - 1.0001 * lower["delta"], "upper": mu + 1.0001 * upper["delta"]}
    return {"p": p, **bounds, "certificate": certificate}


def log_factor(parameters):
    """ln R of an impact."""
    loss = float(parameters["oscillator.epsilon"]) ** 2 * (1 - float(parameters["oscillator.restitution"]))
    return -loss if parameters["oscillator.impact"] == "delta" else float(np.log1p(-loss))


def _side(p, parameters, mu, u, sign, steepness, number):
    """The proof of the upper (sign 1) or lower bound, with a slope of W at 0 and a number of nodes in [0, 12]."""
    z = np.linspace(-12, 12, 2 * number - 1)
    lift = steepness * z * np.exp(z**2 / 4)
    core = np.abs(lift) <= STEEPEST
    samples = _samples(p, parameters, mu, u, z)
    w = lift + _levelling(z, (sign * samples[0]).max(axis=0) / samples[-1])
    core[int(np.argmax(core)) - 1] = core[len(z) - int(np.argmax(core))] = True
    delta = 1.05 * _needed(p, parameters, mu, u, sign, z[core], w[core])
    return {"delta": delta, "nodes": z[core].tolist(), "values": w[core].tolist(), "tails": [-TAIL, TAIL]}


def _levelling(z, e):
    """W of ½W′ − Wz/2 = mean e − e, e in units of ν, summed from the nearer end."""
    weight = np.exp(-(z**2) / 2)
    flow = 2 * (np.average(e, weights=weight) - e) * weight
    steps = (flow[1:] + flow[:-1]) / 2 * np.diff(z)
    left, right = np.append(0, np.cumsum(steps)), -np.append(np.cumsum(steps[::-1])[::-1], 0)
    return np.where(z < 0, left, right) / weight


class _Model:
    """Operators on coefficients of e^{2ikφ} He_m(z)/√m!."""

    def __init__(self, parameters, p, harmonics, degrees):
        number = {k: float(v) for k, v in parameters.items() if k != "oscillator.impact"}
        eps, alpha = number["oscillator.epsilon"], number["noise.alpha"]
        self.is_moment, self.nu = p is not None, 2 * alpha
        self.k, one = np.arange(-harmonics, harmonics + 1), np.eye(2 * harmonics + 1)
        up, down = np.diag(np.ones(2 * harmonics), -1), np.diag(np.ones(2 * harmonics), 1)
        h1, q1 = (up - down) / 4j, (one - (up + down) / 2) / 2
        root = np.sqrt(np.arange(1.0, degrees))
        noise = eps**2 * number["oscillator.c1"] * np.eye(degrees)
        noise += eps * number["noise.sigma"] / np.sqrt(2 * alpha) * (np.diag(root, 1) + np.diag(root, -1))
        kappa, weight = log_factor(parameters) / np.pi, p if self.is_moment else 1.0
        d, omega = np.diag(2j * self.k), number["oscillator.omega"]
        relaxation = -alpha * np.kron(one, np.diag(np.arange(degrees)))
        still, pushed = kappa * omega * one, kappa * h1 + q1
        self.source = (np.kron(still, np.eye(degrees)) + np.kron(pushed, noise)) * weight
        self.operator = relaxation + np.kron(omega * d, np.eye(degrees)) + np.kron(h1 @ d, noise)
        self.first = harmonics * degrees

    def moment(self):
        """Λ(p) and u with the mean 1."""
        values, vectors = np.linalg.eig(self.operator + self.source)
        best = int(np.argmax(values.real))
        return float(values[best].real), vectors[:, best] / vectors[self.first, best]

    def drift(self):
        """λ and f with the mean 0."""
        matrix, first = self.operator.copy(), self.first
        matrix[:, first] = 0
        matrix[first, first] = -1
        f = np.linalg.solve(matrix, -self.source[:, first])
        value, f[first] = float(f[first].real), 0
        return value, f

    def residual(self, mu, u):
        """Coefficients of Lu − μu; for λ those of the drift less μ."""
        if self.is_moment:
            return (self.operator + self.source) @ u - mu * u
        one = np.eye(1, len(u), self.first)[0]
        return self.operator @ u + self.source @ one - mu * one


def _padded(u):
    """Coefficients with one more harmonic on each side and one more degree, which Lu reaches."""
    return np.pad(u, ((1, 1), (0, 1)))


def _needed(p, parameters, mu, u, sign, nodes, values):
    """The least δ of samples: e + ν(½W′ − W B + ½qW²), at both ends of each cell."""
    z, w = np.repeat(nodes, 2)[1:-1], np.repeat(values, 2)[1:-1]
    slope = np.repeat(np.diff(values) / np.diff(nodes), 2)
    e, steep, nu = _samples(p, parameters, mu, u, z)
    square = 0 if p is None else sign * w**2 / 2
    return float((sign * e + nu * (slope / 2 - w * (z / 2 - steep) + square)).max())


def _samples(p, parameters, mu, u, z):
    """Lu/u − μ and u_z/u (of λ: the drift less μ, and 0) at phases × z, and ν."""
    wide = _padded(u)
    model = _Model(parameters, p, wide.shape[0] // 2, wide.shape[1])
    waves = np.exp(2j * np.outer(np.linspace(0, np.pi, 100), model.k))
    hermite = [np.ones_like(z), z]
    for m in range(1, wide.shape[1] - 1):
        hermite.append((z * hermite[m] - np.sqrt(m) * hermite[m - 1]) / np.sqrt(m + 1))
    table = np.array(hermite)
    at = np.zeros_like(table)
    at[1:] = np.sqrt(np.arange(1, len(table)))[:, None] * table[:-1]
    top = (waves @ model.residual(mu, wide.ravel()).reshape(wide.shape) @ table).real
    if not model.is_moment:
        return top, 0.0, model.nu
    bottom, steep = (waves @ wide @ table).real, (waves @ wide @ at).real
    return top / bottom, steep / bottom, model.nu
