from .chart import chart_case as chart_case
from .check import check_case as check_case
from .check import compare as compare
from .check import expected as expected
from .prove import check_proof as check_proof
from .prove import prove_case as prove_case
