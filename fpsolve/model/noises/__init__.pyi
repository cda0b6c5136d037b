from .markov_chain import MarkovChain as MarkovChain
from .non_gaussian import NonGaussianNoise as NonGaussianNoise
from .non_gaussian import ReducedNoise as ReducedNoise
from .ornstein_uhlenbeck import OrnsteinUhlenbeck as OrnsteinUhlenbeck
from .sine_wiener import SineWiener as SineWiener
from .telegraph import Telegraph as Telegraph
from .white import Interpretation as Interpretation
from .white import White as White
