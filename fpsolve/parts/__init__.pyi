from .eigenfunctions import write_density as write_density
from .eigenfunctions import write_eigenfunctions as write_eigenfunctions
from .every import QUESTIONS as QUESTIONS
from .question import Entry as Entry
from .question import Job as Job
from .question import Question as Question
