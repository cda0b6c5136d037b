from .analysis.density import stationary_density as stationary_density
from .analysis.density import tilted_density as tilted_density
from .analysis.sensitivity import sensitivities as sensitivities
from .analysis.stability import boundary as boundary
from .case.case import load_case as load_case
from .errors import CaseError as CaseError
from .errors import FpsolveError as FpsolveError
from .errors import NotConverged as NotConverged
from .exponent.function import MomentLyapunovFunction as MomentLyapunovFunction
from .exponent.function import moment_lyapunov as moment_lyapunov
from .exponent.quantities import lyapunov_exponent as lyapunov_exponent
from .exponent.quantities import stability_index as stability_index
from .exponent.solver import ExponentSolver as ExponentSolver
from .fem.mesh import CylinderMesh as CylinderMesh
from .fem.mesh import make_mesh as make_mesh
from .model.noises.non_gaussian import NonGaussianNoise as NonGaussianNoise
from .model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck as OrnsteinUhlenbeck
from .model.problem import Problem as Problem
from .model.systems.plane_system import PlaneSystem as PlaneSystem
from .model.systems.vibro_impact import VibroImpactOscillator as VibroImpactOscillator
from .output.datasets import open_results as open_results
from .proofs.questions import prove as prove
from .simulation.estimators import simulate as simulate
from .workflow.cases import run as run
from .workflow.explore import explore as explore

__version__: str
