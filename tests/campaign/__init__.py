"""Random problems by families, each number with a second method; `python -m tests.campaign FAMILY first last`."""

from collections.abc import Callable, Iterable, Mapping

from tests.campaign import paper, paths, planar, same, spaces
from tests.campaign.numbers import Number

FAMILIES: Mapping[str, tuple[Callable[[int], Iterable[Number]], int]] = {
    "planar": (planar.numbers, 600),
    "walls": (planar.numbers_of_walls, 100),
    "paper": (planar.numbers_of_paper, 300),
    "tolerances": (same.numbers_of_tolerances, 2000),
    "units": (same.numbers_of_units, 300),
    "modes": (spaces.numbers_of_modes, 60),
    "loose": (spaces.numbers_of_loose, 40),
    "frames": (spaces.numbers_of_frames, 20),
    "stops": (spaces.numbers_of_stops, 30),
    "many": (spaces.numbers_of_many, 200),
    "delays": (spaces.numbers_of_delays, 24),
    "simulations": (paths.numbers_of_simulations, 300),
    "agreement": (paths.numbers_of_agreement, 18),
    "coverage": (spaces.numbers_of_coverage, 200),
    "responses": (paths.numbers_of_responses, 32),
    "fits": (paths.numbers_of_fits, 600),
    "sensitivities": (paper.numbers_of_sensitivities, 100),
    "charts": (paper.numbers_of_charts, 40),
    "proofs": (paper.numbers_of_proofs, 200),
}
"""By their names the numbers of a seed, and how many seeds there are."""
