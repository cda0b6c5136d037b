"""What the README tells to type into Python runs, in its order."""

import re
from pathlib import Path

import matplotlib

import fpsolve

OWN = "0.0940860185", "-0.1479706579"
"""Of one's own equations, by moment hierarchies: Hermite polynomials of ξ, and Legendre polynomials of ξ/a."""
README = Path(__file__).parents[1] / "README.md"


def test_the_blocks_of_python_run(tmp_path, monkeypatch, capsys):
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    numbers = "output={ figure = false, quantities = ['moment', 'lyapunov_exponent', 'stability_index'] }"
    fpsolve.run(fpsolve.load_case(README.parent / "cases/fig1.toml", [numbers]))  # as the README does above them
    text = README.read_text(encoding="utf-8").replace("paths=4096", "paths=64, time=100.0")
    text = re.sub(r"( = boundary\(.*)\)\n", r"\1, nodes=5)\n", text)  # which takes a fifth of the time
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) >= 4
    names: dict[str, object] = {}
    for block in blocks:
        exec(block, names)
    assert {path.name for path in tmp_path.iterdir()} == {"results", "moments.nc", "moments.png", "eigenfunction.png"}
    printed = capsys.readouterr().out
    for number in ("0.014163143653", "0.013021271916", "-0.37345849855", "0.3179308", "0.9945938", "0.4579225", *OWN):
        assert number in printed  # as the comments beside them say
    matplotlib.pyplot.close("all")
