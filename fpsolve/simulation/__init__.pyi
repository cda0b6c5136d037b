from .estimators import MomentEstimate as MomentEstimate
from .estimators import MonteCarlo as MonteCarlo
from .estimators import simulate as simulate
from .response import Response as Response
from .response import simulated_response as simulated_response
