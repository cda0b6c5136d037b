from .equations import EquationSystem as EquationSystem
from .equations import Wall as Wall
from .modal import ModalSystem as ModalSystem
from .parametric import ParametricOscillator as ParametricOscillator
from .plane_system import PlaneSystem as PlaneSystem
from .vibro_impact import ImpactLaw as ImpactLaw
from .vibro_impact import VibroImpactOscillator as VibroImpactOscillator
