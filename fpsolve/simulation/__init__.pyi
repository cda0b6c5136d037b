from .estimators import simulate as simulate
from .monte_carlo import MomentEstimate as MomentEstimate
from .monte_carlo import MonteCarlo as MonteCarlo
from .response import Response as Response
from .response import stationary_response as stationary_response
