from .noise import noise_case as noise_case
from .prove import check_proof as check_proof
from .prove import prove_case as prove_case
