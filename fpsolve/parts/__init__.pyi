from .eigenfunctions import write_density as write_density
from .eigenfunctions import write_eigenfunctions as write_eigenfunctions
from .every import PARTS as PARTS
from .part import Entry as Entry
from .part import Job as Job
from .part import Part as Part
