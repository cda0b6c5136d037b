"""λ and Λ(p) of an oscillator in weak noise by its spectral density alone.

Averaging ẍ + 2ζω ẋ + ω²(1 + ξ) x = 0 over the phase makes d ln‖x‖ a Brownian motion with the drift λ and the variance
rate ω²S(2ω)/8, so that

    λ = −ζω + ω²S(2ω)/8,   Λ(p) = −ζω p + p(p + 2) ω²S(2ω)/16.

For ẍ + 2(ζω + ½ξ)... noise in the damping, ẍ + (2ζω − ξ) ẋ + ω²x = 0,

    λ = −ζω + S(2ω)/8,   Λ(p) = −ζω p + p(p + 2) S(2ω)/16 + p² S(0)/8.
"""
