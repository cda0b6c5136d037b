from .certificate import Certificate as Certificate
from .certificate import Enclosure as Enclosure
from .questions import StabilityIndexEnclosure as StabilityIndexEnclosure
from .questions import prove as prove
from .questions import prove_lyapunov_exponent as prove_lyapunov_exponent
from .questions import prove_stability_index as prove_stability_index
from .verify import objection as objection
