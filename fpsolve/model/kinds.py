"""The kinds of systems and of noises by the names that case files have for them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Literal, cast

from fpsolve.model.parameters import Parametrised

Half = Literal["system", "noise"]
KINDS: Mapping[Half, Mapping[str, str]] = {
    "system": {
        "vibro-impact": "VibroImpactOscillator",
        "parametric": "ParametricOscillator",
        "equations": "EquationSystem",
        "modes": "ModalSystem",
        "linear": "MatrixSystem",
    },
    "noise": {
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
    },
}
"""The classes of `fpsolve.model` by these names."""


def kind_of(half: Half, name: str) -> type[Parametrised]:
    """The class of a kind of system or noise. Raises `ValueError` where there is none."""
    known = KINDS[half]
    if name not in known:
        raise ValueError(f'got kind = "{name}"; must be one of {", ".join(known)}')
    return cast("type[Parametrised]", getattr(import_module("fpsolve.model"), known[name]))
