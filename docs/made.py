"""The pages that follow from the code: the gallery of cases, the reference, the keys of case files, validation."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import shutil
from pathlib import Path

from keys import PAGE, default_of, keys, range_of, row, table
from sphinx_gallery.scrapers import figure_rst

import fpsolve
from fpsolve.commands import check_case
from fpsolve.data import plain_unit
from fpsolve.model.parameters import Parametrised

ROOT = Path(__file__).parents[1]
CASES = [*sorted(ROOT.glob("cases/*.toml")), *sorted(ROOT.glob("cases/systems/*.toml"))]
CHARTS = {path.name for path in (ROOT / "docs/charts").glob("*")}
"""Cases whose chart takes long; theirs is drawn from what `fpsolve chart` wrote once."""
SLOW = "filtered", "two_noises", "coupled", "coupled_ou", "rattling"
"""Cases with a dimension more, which are drawn at fewer p, to two digits."""
ROOMS = {
    "model": "linear systems, and their noises",
    "exponent": "Λ(p), its eigenpairs and what follows from them",
    "analysis": "densities, sensitivities, where stability ends",
    "nonlinear": "the stationary response of the nonlinear oscillator",
    "measured": "from measured spectra and records to noises",
    "simulation": "Monte Carlo, independent of the finite elements",
    "proofs": "bounds that hold with certainty",
    "theory": "what is known in closed form",
    "fem": "meshes and the matrices of the generator",
    "case": "case files",
    "solve": "what a case asks of each parameter set becomes numbers",
    "results": "numbers become a table and its files",
    "tell": "a table becomes words and pictures",
    "commands": "a file for each command",
}


def write_all(folder: Path) -> None:
    """Write what Sphinx reads, into a folder that no other file is in."""
    folder.mkdir(exist_ok=True)
    write_gallery(folder / "cases")
    write_reference(folder / "reference")
    _write(folder / "expected.part.md", expected())
    _write(folder / "oracles.part.md", oracles())
    _write(PAGE, keys())


def _write(path: Path, text: str) -> None:
    """Write a file unless it says so already, so that an unchanged page is not built again."""
    path.parent.mkdir(exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


# The gallery


def write_gallery(folder: Path) -> None:
    """A script for each case, beside a copy of the case file."""
    folder.mkdir(exist_ok=True)
    _write(folder / "GALLERY_HEADER.rst", GALLERY)
    shutil.copytree(ROOT / "meshes", folder.parent / "meshes", dirs_exist_ok=True)
    for path in CASES:
        shutil.copy(path, folder / path.name)
        if path.with_suffix("").is_dir():  # its matrices
            shutil.copytree(path.with_suffix(""), folder / path.stem, dirs_exist_ok=True)
        _write(folder / f"plot_{path.stem}.py", script(path))


GALLERY = """\
Gallery
=======

These are all case files that come with fpsolve, with their figures. Each page shows the file, and the lines of Python
that draw the figure. On the command line, for example, ``fpsolve run cases/fig1.toml`` does the same.
"""


def script(path: Path) -> str:
    """The script that draws the figure of a case."""
    case, text = fpsolve.load_case(path), path.read_text(encoding="utf-8")
    words = re.match(r"(?:#:.*\n)?((?:#.*\n)*)", text).group(1).replace("# ", "").replace("#", "")
    own = not case.method.has_pairs or case.problem.noise.has_algebraic_tails  # there are no other p
    few = case.figure.x == "p" and case.moments.values.size < 8 and not own
    sets = [] if own else ["output={ quantities = ['moment', 'lyapunov_exponent', 'stability_index'] }"]
    if few:
        names = "['moment', 'response']" if "response" in case.asked else "['moment']"
        sets = [f"output={{ quantities = {names} }}", "expect=[]", "figure={}"]
        count, digits = (7, ", rtol = 1e-2") if path.stem in SLOW else (13, "")
        sets += [f"moments={{ p = {{ start = 0.0, stop = 3.0, num = {count} }}{digits} }}"]
    title = re.sub(r"^(Fig\. \d\S*): (.*)", r"\1: \2", case.title)
    head = f'"""\n{title}\n{"=" * len(title)}\n\n{_rst(words)}\n"""\n\n'
    shown = f"# %%\n# The case file:\n#\n# .. literalinclude:: /generated/cases/{path.name}\n#    :language: toml\n"
    shown_there = "The figure of the case" if not few else "Λ(p) over a range of p"
    shown_there += ", and the stationary response" if "response" in case.asked else ""
    run = f"""
# %%
# {shown_there}:

import fpsolve

case = fpsolve.load_case("{path.name}", {_listed(sets)})
results = fpsolve.run(case)
{"" if few or not case.method.has_pairs else SUMMARY_NUMBERS}"""
    if path.stem in CHARTS:
        return head + shown + CHART.format(file=path.name, name=path.stem)
    return head + shown + run + KINDS.get(path.stem, "")


SUMMARY_NUMBERS = """for result in results[:6]:
    print(dict(result.parameter_set.varied), "lambda =", result.lyapunov_exponent, "delta_p =", result.stability_index)
"""
CHART = """
# %%
# Its chart takes up to minutes. So these lines draw it from the files that ``fpsolve chart`` wrote, which are in
# docs/charts of the repository. To draw a chart of your own, write its folder of results instead:

import matplotlib.pyplot as plt
import pandas

import fpsolve
from fpsolve.drawing import label_axes, scale_axis

case = fpsolve.load_case("{file}")
x, y = case.chart.x, case.chart.y
figure, axes = plt.subplots(layout="constrained")
table = pandas.read_csv("../../charts/{name}/chart.csv")
for number, target in enumerate(case.chart.lines):
    for branch, line in table[table.line == str(target)].groupby("branch"):
        axes.plot(line.x, line.y, color=f"C{{number}}", label=target.latex if branch == 1 else None)
label_axes(axes, case.about(x.key).attributes, case.about(y.key).attributes)
scale_axis(axes.xaxis, x.scale, (x.start, x.stop))
scale_axis(axes.yaxis, y.scale, (y.start, y.stop))
axes.set_title(case.title)
axes.legend()
plt.show()
"""
KINDS = {
    "fig1": "",
    "chart": "",
    "strong": """
# %%
# The eigenfunction T of p = 2, which spans decades:

from fpsolve import ExponentSolver
from fpsolve.tell import draw_eigenfunction

# sphinx_gallery_thumbnail_number = -1
pair = ExponentSolver(case.problem, rtol=1e-4).pair(2.0)
draw_eigenfunction(pair).save("results/strong/eigenfunction.png")
""",
    "ornstein_uhlenbeck": """
# %%
# The stationary density of phase and noise:

from fpsolve import ExponentSolver
from fpsolve.analysis import stationary_density

# sphinx_gallery_thumbnail_number = -1
stationary_density(ExponentSolver(case.problem).pair(0.0)).plot()
""",
    "response": "# sphinx_gallery_thumbnail_number = -1\n",
    "hoisted": """
# %%
# The measured spectrum, and that of the noise that was fitted to it:

import matplotlib.pyplot as plt
import numpy as np

from fpsolve.measured import fit_noise, read_spectrum

# sphinx_gallery_thumbnail_number = -1
sea = read_spectrum("../../../cases/measured/buoy.csv", of="acceleration", sided="one", column="acceleration")
sea = sea.scaled(1 / 9.80665)  # a relative stiffness, a/g
natural = np.sqrt(case.problem.values["system.stiffness"])
fit = fit_noise(sea, "filter", frequency=natural)
figure, axes = plt.subplots(layout="constrained")
axes.semilogy(sea.frequencies, sea.density, "o", label="measured")
omega = np.linspace(*sea.frequencies[[0, -1]], 400)
axes.semilogy(omega, [fit.spectral_density(each) for each in omega], label="fitted")
axes.axvline(2 * natural, color="0.6", label="twice the natural frequency")
axes.set(xlabel="frequency (rad/s)", ylabel="spectral density of the relative stiffness (s)")
axes.legend()
plt.show()
""",
}
"""The first cases of the gallery, which show one of each kind, and what they draw beside Λ(p)."""


class OneOfEachKindFirst:
    """The order of the gallery."""

    def __init__(self, folder: str) -> None:
        self.names = [f"plot_{name}.py" for name in KINDS]

    def __call__(self, name: str) -> tuple[int, str]:
        return self.names.index(name) if name in self.names else len(self.names), name


def _rst(text: str) -> str:
    return re.sub(r"([*|\\])", r"\\\\\1", text).replace('"""', "'''")


def _listed(texts: list[str]) -> str:
    return "[\n" + "".join(f'    "{text}",\n' for text in texts) + "]"


def pictures_of_results(block, block_vars, gallery_conf):
    """Scrape the pictures that a block wrote into results/, each once."""
    name = Path(block_vars["src_file"])
    folder = name.parent / "results" / name.stem.removeprefix("plot_")
    made = []
    for picture in sorted(folder.glob("*.png")):
        target = next(block_vars["image_path_iterator"])
        picture.replace(target)
        made.append(target)
    return figure_rst(made, gallery_conf["src_dir"])


# The reference


def write_reference(folder: Path) -> None:
    """A page for `fpsolve` itself and one for each room."""
    top = [*fpsolve.__all__]
    _write(folder / "fpsolve.rst", _page("fpsolve", "what ``import fpsolve`` offers", top))
    for room, words in ROOMS.items():
        names = importlib.import_module(f"fpsolve.{room}").__all__
        again = sorted(set(names) & set(top))
        links = ", ".join(f":py:obj:`fpsolve.{name}`" for name in again)
        page = _page(f"fpsolve.{room}", words, [name for name in names if name not in top])
        also = f"\nAlso here, described with fpsolve itself: {links}.\n" if again else ""
        _write(folder / f"{room}.rst", page + also)


def _page(module: str, words: str, names: list[str]) -> str:
    title = f"{module}: {words.replace('``', '')}"
    lines = [title, "=" * len(title), ""]
    for name in sorted(names, key=str.lower):
        item = getattr(importlib.import_module(module), name)
        kind = "class" if inspect.isclass(item) else "function" if inspect.isroutine(item) else "data"
        if kind == "data":
            lines += [f".. py:data:: {module}.{name}", "", f"   Of the type ``{type(item).__name__}``.", ""]
            continue
        lines += [f".. auto{kind}:: {module}.{name}", *["   :members:", "   :show-inheritance:"] * (kind == "class")]
        lines.append("")
    return "\n".join(lines) + "\n"


def plain_docstring(app, what, name, obj, options, lines):
    """Take what a docstring says as text: stars and bars are mathematics; indented formulas stay as they are."""
    out, block = [], False
    if lines and lines[0].startswith("bool(x)"):  # the words of Python about a property made of a built-in function
        lines.clear()
    if lines and what in ("property", "attribute"):  # what stands before a colon would be taken as its type
        lines[0] = lines[0].replace(": ", " – ", 1)
    for line in lines:
        is_indented, before = line.startswith("    "), out[-1] if out else ""
        if not line.strip():
            out.append(line)
            continue
        if is_indented and not block and not before.strip() and not _in_section(out):
            out += ["::", ""]
            block = True
        elif not is_indented:
            block = False
        if block or line.lstrip().startswith((">>>", "...")):
            out.append(line)
            continue
        pieces = line.split("`")
        pieces[::2] = [re.sub(r"(?<=\w)_(?!\w)", r"\\_", re.sub(r"([*|\\])", r"\\\1", each)) for each in pieces[::2]]
        out.append(re.sub(r"(`[^`]+`)(?=\w)", r"\1\\ ", "`".join(pieces)))
    lines[:] = out


def _in_section(lines: list[str]) -> bool:
    """Whether the last line that is not indented is the head of a section of arguments and the like."""
    for line in reversed(lines):
        if line and not line.startswith(" "):
            return line.rstrip() in ("Args:", "Returns:", "Raises:", "Attributes:")
    return False


def plain_signature(app, what, name, obj, options, signature, returned):
    """Leave out how pydantic keeps a parameter."""
    if what != "class" or not hasattr(obj, "__pydantic_fields__"):
        return None
    shown = [
        key if each.is_required() else f"{key}={default_of(each.get_default(call_default_factory=True))}"
        for key, each in obj.__pydantic_fields__.items()
    ]
    return f"({', '.join(shown)})", ""


def plain_types(app, what, name, obj, options, lines):
    """Write types as users write them."""
    for number, line in enumerate(lines):
        if line.startswith(":vartype "):
            line = re.sub(r"numpy[\w.]*NDArray\[[^\[\]]*\]", "numpy.ndarray", line)
            lines[number] = line.replace("collections.abc.", "").replace("contextlib.", "")


def parameter_list(app, what, name, obj, options, lines):
    """Add the parameters of a kind of system or noise, with units and ranges."""
    if what != "class" or not (inspect.isclass(obj) and issubclass(obj, Parametrised)):
        return
    for key, each in obj.__pydantic_fields__.items():
        stated = dict(each.json_schema_extra or {}).get("unit")
        unit = f", in {plain_unit(stated)}" if stated else ""
        about = f"{each.description}{unit}; {range_of(each)}" if range_of(each) else f"{each.description}{unit}"
        lines += ["", f"* ``{key}``: {_rst(about).replace(chr(92) * 2, chr(92))}"]
    lines.append("")


# Validation


def oracles() -> str:
    """What each independent code of the tests is, in its own words."""
    text = table("code", "what it computes, and how")
    for path in sorted((ROOT / "tests/oracles").glob("*.py")):
        if doc := ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))):
            text += row(f"`{path.stem}`", doc.partition("\n\n")[0].replace("*", "\\*").replace("_", "\\_"))
    return text


def expected() -> str:
    """What every case expects beside what is computed now."""
    text = table("case", "quantity, and the source of the expected value", "expected", "computed", "difference")
    for path in CASES:
        for each in check_case(fpsolve.load_case(path)).comparisons:
            if not each.met:
                raise ValueError(f"{path}: {each}")
            asked = each.expectation
            what = asked.quantity if asked.p is None else f"Λ({asked.p:g})"
            where = ", ".join(f"{key} = {value}" for key, value in each.varied.items())
            difference = f"{abs(each.value - asked.value):.0e}"
            name = f"{{doc}}`{path.stem} </generated/gallery/plot_{path.stem}>`"
            what = f"{what.replace('_', ' ')}, {where}" if where else what.replace("_", " ")
            cell = f"{what}<br><small>{asked.source}</small>" if asked.source else what
            text += row(name, cell, f"{asked.value:.13g}", f"{each.value:.13g}", difference)
    return text
