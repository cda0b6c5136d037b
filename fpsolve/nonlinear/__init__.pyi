from .response import StationaryResponse as StationaryResponse
from .response import stationary_response as stationary_response
