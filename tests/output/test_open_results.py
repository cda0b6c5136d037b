"""Results of several runs as one dataset."""

import shutil

import numpy as np
import pytest

from fpsolve import FpsolveError, load_case, open_results, run
from tests.solving import case_text

CASE = case_text("[moments]\np = [2.0]\n[output]\nquantities = ['moment']\n")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Runs over different keys, one of them without moments."""
    folder = tmp_path_factory.mktemp("results")
    for name, texts in {
        "single": (),
        "frequencies": ("vary={'oscillator.omega' = [1.0, 2.0]}", "moments.p=[1.0]"),
        "noises": ("vary={'noise.treatment' = ['exact', 'ou-reduction']}", "output.quantities=['lyapunov_exponent']"),
    }.items():
        path = folder / f"{name}.toml"
        path.write_text(CASE, encoding="utf-8")
        run(load_case(path, texts), folder)
    return folder


def test_runs_over_different_keys_are_one_dataset(place):
    found = open_results(place / "*")
    assert found.sizes == {"set": 5, "p": 2}
    assert found.run.values.tolist() == ["frequencies"] * 2 + ["noises"] * 2 + ["single"]
    assert found["oscillator.omega"].values.tolist() == [1.0, 2.0, 1.0, 1.0, 1.0]
    assert found["noise.treatment"].values.tolist() == [*["ou-reduction"] * 2, "exact", *["ou-reduction"] * 2]
    assert np.isnan(found.moment.sel(p=2.0)).values.tolist() == [True, True, True, True, False]
    assert np.isnan(found.lyapunov_exponent).values.tolist() == [True, True, False, False, True]
    assert len(found.to_dataframe()) == 10


def test_runs_without_moments_have_no_p(place):
    found = open_results(place / "noises")
    assert dict(found.sizes) == {"set": 2}
    assert len(found.to_dataframe()) == 2


def test_where_there_are_no_results(place):
    with pytest.raises(FpsolveError, match=r"no results.nc in .*nowhere; run a case first"):
        open_results(place / "nowhere")


@pytest.mark.parametrize("damage", ["short", "changed"])
def test_damaged_results_are_named(place, tmp_path, damage):
    path = shutil.copytree(place / "single", tmp_path / "single") / "results.nc"
    content = path.read_bytes()
    path.write_bytes(content[:3000] if damage == "short" else b"????".join(content.rsplit(b"OHDR", 1)))
    with pytest.raises(FpsolveError, match=r"single.results\.nc cannot be read: .*; run its case again"):
        open_results(tmp_path / "single")
