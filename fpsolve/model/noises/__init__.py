"""The kinds of noise, one file for each: parameters, coefficients, stationary law, and how they change."""
