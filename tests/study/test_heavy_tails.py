"""What is printed and written of noise with algebraic tails."""

import re

import pytest

from fpsolve.case.case import CaseError
from fpsolve.cli import main
from tests.kit import case_in, case_text, read_json, solve_case

SECTIONS = "[moments]\np = [-0.4, 0.0]\n[vary]\n'noise.r0' = [0.9, 1.1]\n"
TAILS = {"tau0": 1.0, "r0": 1.0, "treatment": "exact"}


def text(sections=SECTIONS, **noise):
    return case_text(sections, "Heavy tails", TAILS | noise, epsilon=0.5, restitution=1.0, c1=0.0)


@pytest.mark.slow
def test_of_a_sweep_only_these_sets_fail(tmp_path):
    light, heavy = solve_case(case_in(tmp_path, text(), ["output.quantities=['moment', 'lyapunov_exponent']"]))
    assert (light.failures, light.moments.p.tolist()) == ((), [-0.4, 0.0])
    [failure] = heavy.failures
    assert failure.p == -0.4
    assert failure.reason.startswith("Λ(-0.4) is not computed: for r0 > 1")
    assert heavy.moments.p.tolist() == [0.0]
    assert heavy.lyapunov_exponent.value == pytest.approx(0.00705244889, rel=1e-6)


def test_alone_such_a_set_is_refused_at_once(tmp_path):
    with pytest.raises(CaseError, match=r"moments: Λ\(-0\.4\) is not computed: for r0 > 1"):
        case_in(tmp_path, text("[moments]\np = [-0.4, 0.0]\n", r0=1.1), name="heavy")


@pytest.mark.slow
def test_what_is_not_computed_is_said(tmp_path, capsys):
    path = tmp_path / "heavy.toml"
    path.write_text(text("[moments]\np = [0.0]\n", r0=1.1), encoding="utf-8")
    wanted = 'output.quantities=["lyapunov_exponent", "stability_index", "variance_rate", "excursions"]'
    main(["run", str(path), "--out", str(tmp_path), "--set", wanted])
    printed = capsys.readouterr()
    assert re.search("δ_p │ +not computed │", printed.out)
    said = " ".join(printed.err.split())
    for name in ("δ_p", "Λ″(0)"):
        assert f"{name} is not computed: for r0 > 1 the noise has algebraic tails" in said
    (curve,) = read_json(tmp_path / "heavy" / "summary.json")["curves"]
    assert curve["stability_index"] is None
