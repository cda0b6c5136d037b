from .estimators import MomentEstimate as MomentEstimate
from .estimators import MonteCarlo as MonteCarlo
from .estimators import simulate as simulate
from .response import Response as Response
from .response import stationary_response as stationary_response
