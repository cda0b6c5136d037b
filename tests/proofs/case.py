"""A case whose proofs take a second."""

from tests.kit import case_text

CASE = case_text("[moments]\np = [0.0, 2.0]\n", "Proofs", {"D0": 1.0, "r0": 0.9}, epsilon=0.2, omega=1.2)
