from .table import Column as Column
from .table import Table as Table
