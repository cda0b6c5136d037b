"""A case file: TOML in, a validated `Case` out, or one message for each fault of the file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, ValidationError, ValidationInfo, field_validator

from fpsolve.arrays import FloatArray
from fpsolve.case.messages import Refusal, explain, nearest, refuse, shown
from fpsolve.case.sections import (
    Expectation,
    FigureSection,
    MeshSection,
    Moments,
    MonteCarloSection,
    NoiseSection,
    OutputSection,
    Section,
    Text,
    Values,
    Vary,
    flat,
    same,
)
from fpsolve.case.toml import Document, read_document
from fpsolve.errors import CaseError, Fault, MeshError, NoSuchExponent
from fpsolve.exponent.adapt import Budget
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.noise import ColouredNoise, NonGaussianNoise, check_existence
from fpsolve.model.problem import Problem
from fpsolve.model.vibro_impact import VibroImpactOscillator
from fpsolve.simulation.setup import obstacles
from fpsolve.theory.second_order import second_order

MAX_CURVES = 10_000


@dataclass(frozen=True)
class Curve:
    """One parameter set of a case.

    Attributes:
        oscillator, noise: what the solver takes.
        parameters: every parameter by its dotted key, such as "noise.D0".
        varied: those of them that [vary] names.
        number: its place among the curves of its case, from 1.
    """

    oscillator: VibroImpactOscillator
    noise: ColouredNoise
    parameters: Mapping[str, float | str]
    varied: Mapping[str, float]
    number: int = 1

    @property
    def problem(self) -> Problem:
        """What is solved."""
        return Problem(self.oscillator, self.noise)

    @property
    def key(self) -> tuple[tuple[str, float], ...]:
        """What tells it from the other curves of its case."""
        return tuple(self.varied.items())

    @property
    def label(self) -> str:
        """The same for the eye: "noise.D0 = 0.1, noise.r0 = 0.9"."""
        return ", ".join(f"{key} = {value:g}" for key, value in self.varied.items())

    @property
    def suffix(self) -> str:
        """What the names of its files end with: "", "-2", "-3" and so on."""
        return "" if self.number == 1 else f"-{self.number}"


def _oscillator(value: Any) -> Any:
    return VibroImpactOscillator(**value) if isinstance(value, dict) else value


def _budget(value: Any) -> Any:
    return Budget(**value) if isinstance(value, dict) else value


class Case(Section):
    """What one case file says; made by `load_case`.

    Raises:
        pydantic.ValidationError: with every fault of the sections and of what they say about each other.
    """

    title: Text
    oscillator: Annotated[VibroImpactOscillator, BeforeValidator(_oscillator)]
    noise: NoiseSection
    moments: Moments
    budget: Annotated[Budget, BeforeValidator(_budget)] = Field(default_factory=Budget)
    vary: Vary = Field(default_factory=dict)
    mesh: MeshSection = MeshSection()
    monte_carlo: MonteCarloSection = MonteCarloSection()
    figure: FigureSection = FigureSection()
    output: OutputSection = OutputSection()
    expect: Annotated[tuple[Expectation, ...], Field(strict=False)] = ()
    _path: Path = PrivateAttr(default=Path("case.toml"))

    @property
    def path(self) -> Path:
        return self._path

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return self._path.stem

    @property
    def p(self) -> FloatArray:
        """The orders of the moments, shape (n,)."""
        return self.moments.values

    @property
    def rtol(self) -> float:
        return self.moments.rtol

    @property
    def shown(self) -> FloatArray:
        """The p whose eigenfunctions are written: those of [output], or else at most nine, evenly spread."""
        if self.output.eigenfunctions is not None:
            wanted = np.array(self.output.eigenfunctions)
            return self.p[[int(np.argmin(np.abs(self.p - each))) for each in wanted]] if wanted.size else wanted
        return _spread(self.p)

    @property
    def simulated(self) -> FloatArray:
        """The p that are simulated: those of [monte_carlo], or else all, or of populations at most nine."""
        if self.monte_carlo.p is not None:
            return np.array(self.monte_carlo.p)
        return self.p if self.monte_carlo.estimator == "direct" else _spread(self.p)

    @property
    def is_exact(self) -> bool:
        """Whether the noise is Eq. (7) as it stands; perturbation theory then has its reduction only."""
        return self.noise.treatment == "exact"

    def curves(self) -> tuple[Curve, ...]:
        """One curve for each combination of the varied values, the last key varying fastest."""
        combinations = enumerate(_combinations(self.vary), start=1)
        return tuple(replace(self.curve(varied), number=number) for number, varied in combinations)

    def curve(self, varied: Mapping[str, float]) -> Curve:
        """The case's parameter set with some parameters replaced, by their dotted keys."""
        return _curve(self.oscillator, self.noise, varied)

    def heading(self, curve: Curve) -> str:
        """The title, and which of the curves."""
        return f"{self.title}: {curve.label}" if curve.varied else self.title

    def place(self, curve: Curve) -> str:
        """The name, and which of the curves."""
        return f"{self.name}, {curve.label}" if curve.varied else self.name

    def original_noise(self, curve: Curve) -> NonGaussianNoise:
        """The noise of Eq. (7) behind a curve, whatever its treatment."""
        return NoiseSection(**_section("noise", curve.parameters)).original()

    def cylinder_mesh(self) -> CylinderMesh | None:
        """The mesh that the case states; None leaves it to the solver."""
        return self.mesh.mesh(self.path.parent)

    @field_validator("moments")
    @classmethod
    def _is_computable(cls, moments: Moments, info: ValidationInfo) -> Moments:
        is_varied = (info.context or {}).get("varies", False)  # then the curves decide which moments exist
        refuse(_curve_refusals(info.data | {"moments": moments}, {}, with_existence=not is_varied))
        return moments

    @field_validator("vary")
    @classmethod
    def _makes_curves(cls, vary: dict[str, Values], info: ValidationInfo) -> dict[str, Values]:
        number = math.prod(map(len, vary.values()))
        if number > MAX_CURVES:
            text = f"makes {number} curves; must be at most {MAX_CURVES}; list fewer values"
            refuse([((), None, text)])
        refuse(_curve_refusals(info.data, vary))
        return vary

    @field_validator("mesh")
    @classmethod
    def _can_be_made(cls, mesh: MeshSection, info: ValidationInfo) -> MeshSection:
        try:
            with np.errstate(all="ignore"):
                mesh.mesh((info.context or {}).get("folder", Path()))
        except (MeshError, OSError, ValueError) as error:
            text = f"got {shown(mesh.file)}; {error}" if mesh.file else str(error)
            refuse([(("file",) if mesh.file else (), mesh.file, text)])
        return mesh

    @field_validator("monte_carlo")
    @classmethod
    def _can_be_simulated(cls, section: MonteCarloSection, info: ValidationInfo) -> MonteCarloSection:
        if {"oscillator", "noise", "vary"} <= info.data.keys():
            refuse(_simulation_refusals(info.data, section))
        return section

    @field_validator("figure")
    @classmethod
    def _is_varied(cls, figure: FigureSection, info: ValidationInfo) -> FigureSection:
        known = ("p", *info.data.get("vary", (figure.x,)))
        if figure.x not in known:
            guess = nearest(figure.x, known)
            text = f"got {shown(figure.x)};{guess} must be p or a key of [vary]: {', '.join(known)}; add it to [vary]"
            refuse([(("x",), figure.x, text)])
        return figure

    @field_validator("output")
    @classmethod
    def _are_computed(cls, output: OutputSection, info: ValidationInfo) -> OutputSection:
        wanted = ((("eigenfunctions", i), p) for i, p in enumerate(output.eigenfunctions or ()))
        refuse(_p_refusals(info.data, wanted))
        return output

    @field_validator("expect")
    @classmethod
    def _can_be_checked(cls, expect: tuple[Expectation, ...], info: ValidationInfo) -> Any:
        wanted = (((i, "p"), item.p) for i, item in enumerate(expect) if item.p is not None)
        refuse([*_p_refusals(info.data, wanted), *_where_refusals(info.data, expect)])
        return expect


def load_case(path: str | Path, overrides: Sequence[str] = ()) -> Case:
    """Read and check a case file.

    Args:
        path: a TOML file.
        overrides: texts such as "oscillator.omega=2.0", each a key with its sections and a TOML value.

    Raises:
        CaseError: with every fault of the file and of the overrides, each with its line and its remedy.
    """
    document = read_document(path, overrides)
    faults = list(document.faults)
    try:
        case = Case.model_validate(
            document.data, context={"folder": Path(path).parent, "varies": bool(document.data.get("vary"))}
        )
        faults += _hidden_overrides(case, document)
    except ValidationError as error:
        faults += [document.fault(*fault) for fault in explain(error, Case)]
    except RecursionError:
        faults.append(Fault("", None, "tables are nested too deeply; name each key with its section only"))
    if faults:
        raise CaseError(str(path), sorted(faults, key=lambda fault: fault.line or 0))
    case._path = Path(path)
    return case


def _hidden_overrides(case: Case, document: Document) -> Iterator[Fault]:
    """Values of the command line that [vary] would replace."""
    for key in case.vary:
        if isinstance(document.places.get(key), str):
            remedy = f"write --set 'vary.\"{key}\"=[…]', or --set 'vary={{}}' as well"
            yield document.fault((key,), key, f"has no effect, as the case varies {key}; {remedy}")


def _curve(oscillator: VibroImpactOscillator, noise: NoiseSection, varied: Mapping[str, float]) -> Curve:
    system = asdict(oscillator) | {"impact": oscillator.impact.value}
    parameters: dict[str, Any] = flat({"oscillator": system, "noise": noise.model_dump()}) | varied
    return Curve(
        oscillator=VibroImpactOscillator(**_section("oscillator", parameters)),
        noise=NoiseSection(**_section("noise", parameters)).process(),
        parameters=parameters,
        varied=varied,
    )


def _section(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {key.partition(".")[2]: value for key, value in parameters.items() if key.startswith(f"{name}.")}


def _combinations(vary: Mapping[str, Values]) -> Iterator[dict[str, float]]:
    return (dict(zip(vary, values, strict=True)) for values in product(*vary.values()))


def _curve_refusals(
    valid: Mapping[str, Any], vary: Mapping[str, Values], *, with_existence: bool = True
) -> Iterator[Refusal]:
    """The first combination whose parameters contradict each other or overflow, or whose moments are infinite."""
    if not {"oscillator", "noise", "moments"} <= valid.keys():
        return
    p = valid["moments"].values
    for varied in _combinations(vary):
        reason = _obstacle(valid["oscillator"], valid["noise"], varied, p)
        if not reason and with_existence:
            reason = _infinite(_curve(valid["oscillator"], valid["noise"], varied).noise, p)
        if reason:
            yield (), varied, _with(varied) + reason
            return


def _with(varied: Mapping[str, float]) -> str:
    """Beginning of a sentence on one of several curves."""
    return f"with {', '.join(f'{key} = {value}' for key, value in varied.items())}: " if varied else ""


def _obstacle(
    oscillator: VibroImpactOscillator, noise: NoiseSection, varied: Mapping[str, float], p: FloatArray
) -> str:
    """Why there is no such curve, or nothing."""
    try:
        curve = _curve(oscillator, noise, varied)
        with np.errstate(all="ignore"):
            theory = second_order(curve.problem)
            factors = [curve.oscillator.impact_factor(float(extreme)) for extreme in (p.max(), p.min())]
            sizes = np.append(
                theory.scale.moment(p),
                [theory.stability_index, *factors],
            )
    except ValidationError as error:
        context = error.errors()[0].get("ctx", {})
        return str(context.get("error", f"the noise has no finite strength; {_MODERATE}"))
    except ArithmeticError:
        sizes = np.array([math.inf])
    return "" if np.all(np.isfinite(sizes)) else f"Eqs. (37)-(38) or R^p overflow; {_MODERATE}"


def _infinite(noise: ColouredNoise, p: FloatArray) -> str:
    """Why some Λ(p) is infinite, or nothing."""
    try:
        for extreme in (p.max(), p.min()):
            check_existence(noise, float(extreme))
    except NoSuchExponent as error:
        return str(error)
    return ""


def _simulation_refusals(valid: Mapping[str, Any], section: MonteCarloSection) -> Iterator[Refusal]:
    """The first parameter set for which the time, the step or a p of the simulation is not right."""
    for varied in _combinations(valid["vary"]):
        curve = _curve(valid["oscillator"], valid["noise"], varied)
        faults = obstacles(curve.oscillator, curve.noise, time=section.time, step=section.step)
        for name, text in faults.items():
            if getattr(section, name) is not None:
                yield (name,), getattr(section, name), _with(varied) + text
        p = np.array(section.p or (0.0,))
        infinite = _obstacle(valid["oscillator"], valid["noise"], varied, p) or _infinite(curve.noise, p)
        if infinite:
            yield ("p",), section.p, _with(varied) + infinite
        if faults or infinite:
            return


def _spread(p: FloatArray) -> FloatArray:
    """At most nine of the p, evenly."""
    return np.sort(p)[np.unique(np.linspace(0, p.size - 1, min(p.size, 9)).round().astype(int))]


_MODERATE = "parameters and p must have moderate sizes; bring the extreme ones nearer to 1"


def _p_refusals(valid: Mapping[str, Any], wanted: Iterable[tuple[tuple[str | int, ...], float]]) -> Iterator[Refusal]:
    moments: Moments | None = valid.get("moments")
    for path, p in wanted:
        if moments is not None and not moments.has(p):
            first, last = moments.values[[0, -1]]
            known = f"moments.p ({moments.values.size} values, {first:g} to {last:g})"
            yield path, p, f"got {p}; must be among {known}; add it there, or choose one of them"


def _where_refusals(valid: Mapping[str, Any], expect: Sequence[Expectation]) -> Iterator[Refusal]:
    vary: Mapping[str, Values] | None = valid.get("vary")
    if vary is None:
        return
    stated = ((i, key, value) for i, item in enumerate(expect) for key, value in item.where.items())
    for i, key, value in stated:
        if key not in vary:
            guess, known = nearest(key, vary), ", ".join(vary) or "none"
            yield (i, "where", key), value, f"is not varied;{guess} varied keys: {known}; add it to [vary]"
        elif not any(same(value, other) for other in vary[key]):
            known = shown(vary[key])
            yield (i, "where", key), value, f"got {value}; must be one of {known}; add it to [vary]"
