"""A case whose proofs take a second."""

CASE = """
title = "Proofs"
[oscillator]
epsilon = 0.2
omega = 1.2
restitution = 0.8
c1 = 0.1
[noise]
D0 = 1.0
tau0 = 0.5
r0 = 0.9
[moments]
p = [0.0, 2.0]
"""
