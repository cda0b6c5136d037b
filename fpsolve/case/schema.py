"""The JSON Schema of case files, by which editors complete and check them; it follows from where the keys are declared.

It says what tables there are, which keys they have, of which types, in which ranges. What keys say about each other is
checked when a case is read.
"""

from __future__ import annotations

import json
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Discriminator, Field, Tag, create_model
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from fpsolve.case.case import Case
from fpsolve.case.kinds import EQUATIONS, USUAL
from fpsolve.data import plain_unit
from fpsolve.model.faults import fields_of
from fpsolve.model.kinds import KINDS, Half, kind_of
from fpsolve.model.parameters import STRICT, Parametrised

SCHEMA = "fpsolve.schema.json"
"""What the file is called that case files name."""
_DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Generator(GenerateJsonSchema):
    """Without null, which TOML has not: a key that may be left out says so by not being required."""

    def nullable_schema(self, schema: Any) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> JsonSchemaValue:
        return (
            self.generate_inner(schema["schema"]) if schema.get("default") is None else super().default_schema(schema)
        )


def schema() -> dict[str, Any]:
    """The JSON Schema, draft 2020-12, of all kinds; `symbol` and `unit` beside descriptions."""
    system, noise = _union("system"), _union("noise")
    named: Any = Annotated[dict[str, noise], Field(min_length=1)]  # type: ignore[valid-type]
    fields = dict[str, Any]()
    for name, field in Case.model_fields.items():
        if name == "system":
            oscillator = _described("the vibro-impact oscillator, Eq. (3)", "[oscillator]")
            fields["oscillator"] = system, oscillator
            fields["system"] = system, _described("the system, written as equations or of another kind", "[system]")
        elif name == "noise":
            fields[name] = noise | named, _described("the noise; or a table of noises by their names", "[noise]")
        else:
            fields[name] = field.annotation, field
    model: Any = create_model("Case", __config__=STRICT, **fields)
    made: dict[str, Any] = model.model_json_schema(schema_generator=_Generator)
    made["required"] = [key for key in made["required"] if key not in ("oscillator", "system", "moments")]
    made |= {"$schema": _DIALECT, "title": "fpsolve case", "description": "A case file of fpsolve."}
    made["oneOf"] = [{"required": ["oscillator"]}, {"required": ["system"]}]
    tidy: dict[str, Any] = _tidy(made)
    return tidy


def schema_text() -> str:
    """The schema as the content of a file."""
    return json.dumps(schema(), indent=1) + "\n"


def _union(half: Half) -> Any:
    """The type of a table of any kind, told by the key that names it, or by being without one."""
    models = list[type[BaseModel]]()
    for name in KINDS[half]:
        variants = ((kind := kind_of(half, name)), *kind.variants)
        models += (_table(half, each, i) for i, each in enumerate(variants))
        if name in (USUAL[half], EQUATIONS):
            models.append(_table(half, kind, is_named=False))
    tagged = (Annotated[each, Tag(each.__name__)] for each in models)
    return Annotated[reduce(or_, tagged), Discriminator(lambda value: value)]


def _table(half: Half, kind: type[Parametrised], variant: int = 0, *, is_named: bool = True) -> type[BaseModel]:
    """A table of a kind, which it may leave out where that is the usual one."""
    known: dict[str, Any] = {name: (f.annotation, f) for name, f in fields_of(kind).items()}
    name = f"{half}_{kind.kind}{f'_{variant + 1}' if variant else ''}{'' if is_named else '_without_kind'}"
    if is_named:
        known = {"kind": (Literal[kind.kind], _described(f"the kind of the {half}", f'kind = "{kind.kind}"'))} | known
    doc = (kind.__doc__ or kind.kind).strip().partition("\n")[0]
    return create_model(name, __doc__=doc, __config__=STRICT, **known)


def _described(text: str, example: str) -> FieldInfo:
    return Field(description=text, examples=[example])


def _tidy(node: Any) -> Any:
    """Units in descriptions, which are what editors show, and of these the first paragraph; no defaults of tables."""
    if isinstance(node, list):
        return [_tidy(each) for each in node]
    if not isinstance(node, dict):
        return node
    left_out = {key for key in ("symbol", "unit") if node.get(key) == ""}
    left_out |= {"default"} if isinstance(node.get("default"), dict) and "$ref" in node else set()
    found = {key: _tidy(each) for key, each in node.items() if key not in left_out}
    if isinstance(text := found.get("description"), str):
        unit = found.get("unit", "1")
        found["description"] = text.partition("\n\n")[0] + (f", in {plain_unit(unit)}" if unit != "1" else "")
    return found
