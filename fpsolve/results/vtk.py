"""Files for ParaView: grids with field data, which are numbers, as meshio refuses texts, and the codes of letters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar
from xml.sax.saxutils import quoteattr

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import ParameterSet
from fpsolve.data import written
from fpsolve.files import write_text
from fpsolve.model.parameters import Parameter
from fpsolve.signals import signals_held

Shown = TypeVar("Shown")
Facts = Mapping[str, Any]
"""Field data by their names."""


def facts_of_set(parameter_set: ParameterSet) -> Facts:
    """The field data of a set: its number, its parameters, and in words those that are varied and those fixed.

    A parameter that is a word is in the name. The words are in ASCII, `fixed` with a line for each section.
    """
    known, sections = parameter_set.problem.parameters, dict[str, list[str]]()
    for key, parameter in known.items():
        if key not in parameter_set.varied:
            section, _, name = key.rpartition(".")
            sections.setdefault(section, []).append(f"{name} = {_valued(parameter)}")
    words = {
        "varied": ", ".join(f"{key} = {_valued(known[key])}" for key in parameter_set.varied),
        "fixed": "\n".join(f"{section}: {', '.join(each)}" for section, each in sections.items()),
    }
    facts: dict[str, Any] = {"set": float(parameter_set.number)}
    for key, value in parameter_set.parameters.items():
        facts |= {f"{key} = {value}": 1.0} if isinstance(value, str) else {key: value}
    return facts | {name: text.replace("²", "^2") for name, text in words.items() if text}


def _valued(parameter: Parameter) -> str:
    """The value of a parameter with its unit."""
    text, unit = written(parameter.value), parameter.quantity.unit_in_words
    return f"{text} ({unit})" if unit else text


def write_between(path: Path, places: Sequence[FloatArray], data: Mapping[str, Any], facts: Facts) -> None:
    """Write a .vtu file of the quadrilaterals, or the hexahedra, between the nodes of a grid.

    Args:
        path: of the file.
        places: x, y and z of the nodes, all of the shape of the grid.
        data: point data of this shape; the first is shown first.
        facts: field data.
    """
    grid = pyvista_module().StructuredGrid(*places).cast_to_unstructured_grid()
    write_points(path, grid, {name: values.ravel(order="F") for name, values in data.items()}, facts)


def nodes_of_quadrilateral(degree: int) -> Sequence[tuple[int, int]]:
    """The places of the nodes of a Lagrange quadrilateral along its sides, in VTK's order."""
    from vtkmodules.vtkCommonDataModel import vtkLagrangeQuadrilateral

    number: Any = vtkLagrangeQuadrilateral.PointIndexFromIJK
    places = [(i, j) for i in range(degree + 1) for j in range(degree + 1)]
    return sorted(places, key=lambda place: number(*place, [degree, degree]))


def write_points(path: Path, grid: Any, data: Mapping[str, FloatArray], facts: Facts) -> None:
    """Write a .vtu file of a grid with point data, of which the first is shown first, and field data."""
    for name, values in data.items():
        grid.point_data[name] = values.ravel()
    grid.GetPointData().SetActiveScalars(next(iter(data)))
    write_vtk(path, grid, facts)


def write_series(
    folder: Path, stem: str, by_p: Mapping[float, Shown], write: Callable[[Path, Shown], None]
) -> list[Path]:
    """Write `<stem>.pvd`, a time series over p, and by `write` the file of what is shown at each p.

    Returns:
        The files, the collection first.
    """
    names = {p: name_at(stem, p) for p in sorted(by_p)}
    for p, name in names.items():
        write(folder / name, by_p[p])
    collection = folder / f"{stem}.pvd"
    write_text(collection, collection_of((p, name, "") for p, name in names.items()))
    return [collection, *(folder / name for name in names.values())]


def write_vtk(path: Path, grid: Any, facts: Facts) -> None:
    """Write a grid with field data; as a text, for VTK itself is silent about a full disk."""
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLUnstructuredGridWriter

    for name, value in facts.items():
        grid.field_data[name] = (
            np.frombuffer(value.encode(), np.uint8) if isinstance(value, str) else np.atleast_1d(value)
        )
    writer = vtkXMLImageDataWriter() if path.suffix == ".vti" else vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.WriteToOutputStringOn()
    writer.Write()
    write_text(path, writer.GetOutputString())


def name_at(stem: str, p: float) -> str:
    """The file of an eigenfunction, seen from its collection."""
    return f"{stem}/p{p + 0.0:+}.vtu"


def collection_of(entries: Iterable[tuple[float, str, str]]) -> str:
    """The XML of a ParaView collection: times, the file for each, and a name for it that may be empty."""
    sets = [
        f'    <DataSet timestep="{time}"{f" name={quoteattr(name)}" if name else ""} file={quoteattr(file)}/>'
        for time, file, name in entries
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>'
    return "\n".join([head, *sets, "  </Collection>", "</VTKFile>", ""])


def pyvista_module() -> Any:
    """pyvista, which takes 350 ms. No signal interrupts the import of it and of VTK's writers."""
    with signals_held():
        import pyvista
        import vtkmodules.vtkIOXML  # noqa: F401
    return pyvista
