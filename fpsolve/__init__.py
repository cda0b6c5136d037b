"""Moment Lyapunov exponents of a vibro-impact oscillator under coloured noise, by finite elements."""
