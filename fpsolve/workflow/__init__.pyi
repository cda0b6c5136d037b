from .cases import Outcome as Outcome
from .cases import run as run
from .cases import run_case as run_case
from .measurement import noise_case as noise_case
from .progress import Phase as Phase
from .progress import Watch as Watch
from .simulation import simulate_case as simulate_case
from .simulation import simulate_curve as simulate_curve
