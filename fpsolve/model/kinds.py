"""The kinds of systems and of noises by the names that case files have for them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any, Literal

from fpsolve.model.noise import Noise
from fpsolve.model.plane import System

SYSTEMS: Mapping[str, str] = {
    "vibro-impact": "vibro_impact:VibroImpactOscillator",
    "parametric": "parametric:ParametricOscillator",
    "equations": "equations:EquationSystem",
    "modes": "modal:ModalSystem",
}
NOISES: Mapping[str, str] = {
    "non-gaussian": "non_gaussian:NonGaussianNoise",
    "ou-reduction": "reduced:ReducedNoise",
    "ornstein-uhlenbeck": "ornstein_uhlenbeck:OrnsteinUhlenbeck",
    "sine-wiener": "bounded:SineWiener",
    "white": "white:White",
    "poisson": "poisson:Poisson",
    "telegraph": "telegraph:Telegraph",
    "markov-chain": "markov_chain:MarkovChain",
    "bounded": "bounded:Bounded",
    "filter": "filter:Filter",
}


def system_kind(name: str) -> type[System]:
    """The class of a kind of system. Raises `ValueError` where there is none."""
    return _kind(name, "systems")


def noise_kind(name: str) -> type[Noise]:
    """The class of a kind of noise. Raises `ValueError` where there is none."""
    return _kind(name, "noises")


@cache
def _kind(name: str, room: Literal["systems", "noises"]) -> Any:
    known = SYSTEMS if room == "systems" else NOISES
    if name not in known:
        raise ValueError(f'got kind = "{name}"; must be one of {", ".join(known)}')
    module, _, cls = known[name].partition(":")
    return getattr(import_module(f"fpsolve.model.{room}.{module}"), cls)
