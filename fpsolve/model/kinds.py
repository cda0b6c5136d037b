"""The kinds of systems and of noises by name: ours, and those that other packages register as entry points.

Another package offers a kind by the entry points "fpsolve.systems" or "fpsolve.noises", name = "module:Class". It is
loaded when its name is asked for and is none of ours.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.metadata import entry_points
from inspect import getsource
from pathlib import Path
from typing import Any, Literal

from fpsolve.model.noise import Noise
from fpsolve.model.parameters import Parametrised
from fpsolve.model.plane import System

SYSTEMS: Mapping[str, str] = {
    "vibro-impact": "vibro_impact:VibroImpactOscillator",
    "plane": "plane_system:PlaneSystem",
    "parametric": "parametric:ParametricOscillator",
    "equations": "equations:EquationSystem",
    "modes": "modal:ModalSystem",
}
NOISES: Mapping[str, str] = {
    "non-gaussian": "non_gaussian:NonGaussianNoise",
    "ou-reduction": "non_gaussian:ReducedNoise",
    "ornstein-uhlenbeck": "ornstein_uhlenbeck:OrnsteinUhlenbeck",
    "sine-wiener": "bounded:SineWiener",
    "white": "white:White",
    "poisson": "poisson:Poisson",
    "telegraph": "markov_chain:Telegraph",
    "markov-chain": "markov_chain:MarkovChain",
    "bounded": "bounded:Bounded",
    "filter": "filter:Filter",
}


def system_kind(name: str) -> type[System]:
    """The class of a kind of system. Raises `ValueError` where there is none, or it is no `System`."""
    return _kind(name, "systems", System)


def noise_kind(name: str) -> type[Noise]:
    """The class of a kind of noise. Raises `ValueError` where there is none, or it is no `Noise`."""
    return _kind(name, "noises", Noise)


def kind_classes(room: Literal["systems", "noises"]) -> tuple[type[Any], ...]:
    """The classes of all of our kinds, with their variants."""
    kinds = map(system_kind, SYSTEMS) if room == "systems" else map(noise_kind, NOISES)
    return tuple(each for kind in kinds for each in (kind, *kind.variants))


def is_ours(half: Parametrised) -> bool:
    """Whether a system or a noise is of one of our kinds itself, and not of a class that is derived from it."""
    return type(half) in (*kind_classes("systems"), *kind_classes("noises"))


def kind_names(room: Literal["systems", "noises"]) -> tuple[str, ...]:
    """The names of all kinds, those of other packages last."""
    ours = SYSTEMS if room == "systems" else NOISES
    return (*ours, *sorted({entry.name for entry in entry_points(group=f"fpsolve.{room}")} - set(ours)))


def is_kind(name: object, room: Literal["systems", "noises"]) -> bool:
    """Whether there is such a kind. What is installed is looked through for a name that is none of ours alone."""
    return name in tuple(SYSTEMS if room == "systems" else NOISES) or name in kind_names(room)


@cache
def version_of(kind: type[Parametrised]) -> str:
    """The package and version that a kind of others comes from; empty for ours, and where no package is known."""
    if kind.kind in SYSTEMS or kind.kind in NOISES:
        return ""
    for group in ("fpsolve.systems", "fpsolve.noises"):
        for entry in entry_points(group=group):
            if entry.name == kind.kind and entry.dist is not None and entry.value.partition(":")[0] == kind.__module__:
                return f"{entry.dist.name} {entry.dist.version}"
    return ""


def source_of(kind: type[Parametrised]) -> str:
    """A digest of the files that a kind of others is written in, its bases among them; empty for ours.

    Results depend on them: who writes a kind corrects it without a new version. Of a class without a file, as in a
    notebook, it is that of its lines; where there are none, of nothing.
    """
    others = [each for each in kind.__mro__ if each.__module__.partition(".")[0] not in ("fpsolve", "builtins", "abc")]
    if not others:
        return ""
    digest = sha256()
    for each in others:
        file = getattr(sys.modules.get(each.__module__), "__file__", None)
        text = b""
        with suppress(OSError, TypeError):
            text = Path(file).read_bytes() if file else getsource(each).encode()
        digest.update(f"{each.__module__}.{each.__qualname__} {len(text)} ".encode() + text)
    return digest.hexdigest()


@cache
def _kind(name: str, room: Literal["systems", "noises"], base: type[Any]) -> Any:
    ours = SYSTEMS if room == "systems" else NOISES
    if name in ours:
        module, _, cls = ours[name].partition(":")
        return getattr(import_module(f"fpsolve.model.{room}.{module}"), cls)
    found = entry_points(group=f"fpsolve.{room}", name=name)
    if not found:
        raise ValueError(f'got kind = "{name}"; must be one of {", ".join(kind_names(room))}')
    entry = next(iter(found))
    try:
        made = entry.load()
    except Exception as failure:
        package = entry.dist.name if entry.dist is not None else entry.module
        raise ValueError(f'kind = "{name}" of {package} cannot be loaded ({failure!r})') from failure
    if not (isinstance(made, type) and issubclass(made, base) and getattr(made, "kind", "") == name):
        raise ValueError(f'kind = "{name}" is {made!r}; must be a subclass of {base.__name__} with kind = "{name}"')
    return made
