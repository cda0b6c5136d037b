"""For authors of a noise: whether what it states agrees with itself, each member with what others make of it."""

from fpsolve.model.checks import check_noise

__all__ = ["check_noise"]
