from .html import page_of as page_of
from .page import Column as Column
from .page import Drawing as Drawing
from .page import Grid as Grid
from .page import Note as Note
from .page import Sentence as Sentence
from .terminal import print_blocks as print_blocks
