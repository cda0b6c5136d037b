"""What a stationary density does near rest, where ρ(a) ~ a^(−δ_p − 1) and ρ(x, ẋ) ~ a^(−δ_p − 2)."""

from __future__ import annotations


class NearRest:
    """What has a `stability_index`, δ_p of the linear system, or None."""

    stability_index: float | None

    @property
    def has_hump(self) -> bool:
        """Whether ρ(a) vanishes at rest: δ_p < −1."""
        return self.stability_index is not None and self.stability_index < -1

    @property
    def has_crater(self) -> bool:
        """Whether ρ(x, ẋ) vanishes at rest: δ_p < −2."""
        return self.stability_index is not None and self.stability_index < -2
