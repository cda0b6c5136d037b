from .cases import Outcome as Outcome
from .cases import chart_case as chart_case
from .cases import check_case as check_case
from .cases import run as run
from .cases import run_case as run_case
from .cases import simulate_case as simulate_case
from .progress import Phase as Phase
from .progress import Watch as Watch
