"""The kinds of systems and of noises by the names that case files have for them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from operator import attrgetter

from fpsolve.model.noise import Noise
from fpsolve.model.plane import System

SYSTEMS: Mapping[str, str] = {
    "vibro-impact": "VibroImpactOscillator",
    "parametric": "ParametricOscillator",
    "equations": "EquationSystem",
    "modes": "ModalSystem",
}
NOISES: Mapping[str, str] = {
    "non-gaussian": "NonGaussianNoise",
    "ou-reduction": "ReducedNoise",
    "ornstein-uhlenbeck": "OrnsteinUhlenbeck",
    "sine-wiener": "SineWiener",
    "white": "White",
    "poisson": "Poisson",
    "telegraph": "Telegraph",
    "markov-chain": "MarkovChain",
    "bounded": "Bounded",
    "filter": "Filter",
}


@cache
def system_kind(name: str) -> type[System]:
    """The class of a kind of system. Raises `ValueError` where there is none."""
    return _kind(name, SYSTEMS)


@cache
def noise_kind(name: str) -> type[Noise]:
    """The class of a kind of noise. Raises `ValueError` where there is none."""
    return _kind(name, NOISES)


def _kind(name: str, known: Mapping[str, str]) -> type:
    if name not in known:
        raise ValueError(f'got kind = "{name}"; must be one of {", ".join(known)}')
    kind: type = attrgetter(known[name])(import_module("fpsolve.model"))
    return kind
