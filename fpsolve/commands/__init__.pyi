from .options import Options as Options
from .options import Reporting as Reporting
from .options import Working as Working
from .options import Writing as Writing
