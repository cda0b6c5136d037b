"""What all parameters have in common: strict types, ranges, and words for messages, tables and figures."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]
STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
