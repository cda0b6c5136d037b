"""A case of a triangular system: what there is on the ray that the phase never leaves, and across it."""

import numpy as np
import pytest

from fpsolve.messages import Code
from fpsolve.output.tables import write_results
from fpsolve.page.terminal import print_blocks
from fpsolve.show.notes import notes
from fpsolve.study.solve import Numerics, everything, solve_curve
from tests.kit import case_in, from_record, read_json

CASE = """
title = "Triangular"
[system]
variables = ["x", "y"]
drift = ["-0.3*x + 0.4*load*x", "0.5*x - 1.0*y - load*y"]
noises = { load = "noise.axial" }
[noise.axial]
kind = "ornstein-uhlenbeck"
alpha = 1.0
standard_deviation = 0.5
[moments]
p = [0.0, 1.0, 2.0, 3.0]
[output]
quantities = ["moment", "lyapunov_exponent"]
"""


def test_both_classes_are_told_by_name_from_records_too(tmp_path):
    """S(0) = 2 · 0.25: p(−0.3) + ¼p²·0.16 across the ray x = 0, and −p + ¼p² on it."""
    case = case_in(tmp_path, CASE, name="triangular")
    [curve] = case.curves()
    solved = solve_curve(curve, everything(case), Numerics.of(case))
    result = solved.result
    assert [
        str(note) for note in result.notes if "the ray at phi = 1.5708: λ is -1 on the ray and -0.3 across it" in note
    ]
    summaries = []
    for each in (result, from_record(case, solved)):
        write_results(case, [each], tmp_path, {})
        summaries += read_json(tmp_path / "summary.json")["curves"]
    assert summaries[0] == summaries[1]
    along, across = summaries[0]["classes"]
    assert [each["name"] for each in (along, across)] == [
        f"{how} the ray at phi = 1.5708" for how in ("along", "across")
    ]
    p, total = (np.array([row[name] for row in summaries[0]["moments"]]) for name in ("p", "moment"))
    for found, growth, strength in ((along, -1.0, 1.0), (across, -0.3, 0.4)):
        assert abs(found["lyapunov_exponent"] - growth) < 1e-9
        expected = p * growth + 0.25 * p**2 * strength**2
        np.testing.assert_allclose([row["moment"] for row in found["moments"]], expected, atol=1e-9)
        assert [row["p"] for row in found["moments"]] == p.tolist()
        assert np.all(total >= expected - 1e-9)


BLOCKS = """
title = "Blocks"
[system]
variables = ["y", "x", "v"]
drift = ["-0.4*y", "v", "-x - 0.3*v - load*x + y"]
noises = { load = "noise.axial" }
[noise.axial]
kind = "white"
s = 0.8
[moments]
p = [-2.0, -0.5, 1.0, 2.0]
[output]
quantities = ["moment", "lyapunov_exponent", "stability_index", "sensitivities"]
"""


def test_blocks_are_told_by_their_variables(tmp_path, capsys):
    """Λ(1) and Λ(2) are those of x and v alone; p < 0 is told in one sentence."""
    case = case_in(tmp_path, BLOCKS, name="blocks")
    [curve] = case.curves()
    solved = solve_curve(curve, everything(case), Numerics.of(case))
    result = solved.result
    assert [note for note in result.notes if "the blocks of variables (y), (x, v) are solved one by one" in note]
    assert [(each.p, each.reason.code) for each in result.failures] == [
        (p, Code.NEGATIVE_OF_SEVERAL) for p in (-2.0, -0.5)
    ]
    print_blocks(notes(case, [result]))
    said = capsys.readouterr().err
    assert said.count("Λ(p) for p < 0 is not computed") == 1
    assert "(y), (x, v) do not all drive each other" in " ".join(said.split())
    assert from_record(case, solved).classes[1].variables == ("x", "v")
    write_results(case, [result], tmp_path, {})
    [summary] = read_json(tmp_path / "summary.json")["curves"]
    slow, own = summary["classes"]
    assert [each["name"] for each in (slow, own)] == ["y", "x, v"]
    assert slow["lyapunov_exponent"] == pytest.approx(-0.4, abs=1e-9)
    for total, part in zip(summary["moments"], own["moments"], strict=True):
        assert total["moment"] == part["moment"]
    assert summary["stability_index"] > 0
