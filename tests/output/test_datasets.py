"""results.nc: what it holds and means, read without fpsolve; many runs as one."""

import json
import math
import resource

import numpy as np
import pytest
import xarray as xr

import fpsolve
from fpsolve.cli import main
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.quantities import INDICES
from fpsolve.model.quantity import MOMENT
from fpsolve.output.datasets import write_dataset
from fpsolve.output.tables import write_results
from tests.kit import ALL, case_in, case_text, read_json

TEXT = case_text("[moments]\np = [2.0, 0.0, -1.0]\nrtol = 1e-4\n[output]\neigenfunctions = []\nfigure = false\n")
PRODUCT = '[vary]\n"noise.D0" = [1.0, 0.1]\n"noise.treatment" = ["exact", "ou-reduction"]\n'
ZIP = '[vary]\nmode = "zip"\n"oscillator.omega" = [1.0, 2.0, 2.0]\n"oscillator.c1" = [0.1, 0.1, 0.2]\n'
HOPELESS = '[vary]\n"oscillator.epsilon" = [0.01, 3.0]\n[budget]\nunknowns = 300\n'


def solved(folder, text, name="test", overrides=()):
    case = case_in(folder, text, overrides, name)
    try:
        results = fpsolve.run(case, folder / "out")
    except NotConverged as failure:
        results = failure.partial
    with xr.open_dataset(folder / "out" / name / "results.nc") as found:
        return case, results, found.load()


@pytest.mark.slow
def test_a_product_has_a_dimension_for_each_key(tmp_path):
    case, results, found = solved(tmp_path, TEXT + PRODUCT, overrides=[ALL])
    assert dict(found.sizes) == {"noise.D0": 2, "noise.treatment": 2, "p": 3}
    assert found.p.values.tolist() == [2.0, 0.0, -1.0]
    for result in results:
        here = found.sel(dict(result.curve.varied))
        np.testing.assert_array_equal(here.moment, result.moments.value)
        np.testing.assert_array_equal(here.moment_error, result.moments.error_estimate)
        np.testing.assert_array_equal(here.moment_derivative, result.moments.derivative)
        np.testing.assert_array_equal(here.moment_perturbation, result.moments.perturbation)
        for name, estimate in result.estimates.items():
            assert float(here[name]) == estimate.value
            assert float(here[f"{name}_error"]) == estimate.error_estimate
            assert float(here[f"{name}_perturbation"]) == INDICES[name].theory(result.curve.problem)
        assert int(here.status) == 0
        assert float(here.seconds) == round(result.seconds, 6) > 0
    assert found.attrs["oscillator.c1"] == 0.1
    assert "noise.D0" not in found.attrs
    assert json.loads(found.attrs["versions"])["fpsolve"] == fpsolve.__version__
    assert found.attrs["case_text"] == case.text == TEXT + PRODUCT
    for name, variable in found.data_vars.items():
        assert variable.attrs["long_name"], name
        assert variable.attrs["units"], name
    assert found.moment.attrs["equation"] == "(1), (19)"
    assert found.moment_perturbation.attrs["equation"] == "(37)"
    assert found.moment_error.attrs["comment"] == f"from {MOMENT.error_source}"
    assert found.lyapunov_exponent.attrs["equation"] == "(2)"
    assert found.stability_index_perturbation.attrs["equation"] == "(38)"
    assert found["noise.D0"].attrs == {"long_name": "noise intensity", "symbol": "$D_0$", "units": "1/time"}


def test_a_full_disk_is_an_error_and_leaves_nothing_behind(tmp_path):
    """A limit for files is what a full disk looks like."""
    case, results, _ = solved(tmp_path, TEXT)
    (tmp_path / "full").mkdir()
    _, most = limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4000, most))
    try:
        with pytest.raises(OSError, match="too large"):
            write_dataset(case, write_results(case, results, tmp_path, {}), tmp_path / "full", {})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list((tmp_path / "full").iterdir())


def test_sets_side_by_side_have_one_dimension(tmp_path):
    _, results, found = solved(tmp_path, TEXT + ZIP)
    assert dict(found.sizes) == {"set": 3, "p": 3}
    assert found["oscillator.omega"].dims == ("set",)
    assert found["oscillator.c1"].values.tolist() == [0.1, 0.1, 0.2]
    np.testing.assert_array_equal(found.moment, [result.moments.value for result in results])


def test_what_failed_is_nan_and_said(tmp_path):
    _, results, found = solved(tmp_path, TEXT + HOPELESS, overrides=["moments.rtol=1e-8"])
    assert found.status.values.tolist() == [0, 1]
    assert found.status.attrs["flag_meanings"].split()[1] == "partly"
    assert found.status.attrs["flag_values"].tolist() == [0, 1, 2, 3, 4, 5]
    bad = found.isel({"oscillator.epsilon": 1})
    assert results[1].moments.p.tolist() == [0.0]
    assert np.isnan(bad.moment).values.tolist() == [True, False, True]
    assert math.isnan(bad.lyapunov_exponent)
    assert np.isfinite(found.isel({"oscillator.epsilon": 0}).moment).all()
    assert found.attrs["complete"] == 1


def test_what_is_not_asked_for_is_not_there(tmp_path):
    sets = ['output.quantities=["lyapunov_exponent", "stability_index"]']
    _, results, found = solved(tmp_path, TEXT + PRODUCT, overrides=sets)
    names = {"lyapunov_exponent", "stability_index"}
    wanted = {f"{name}{ending}" for name in names for ending in ("", "_error", "_perturbation")}
    assert set(found.data_vars) == wanted | {"p_solved", "p_failed", "status", "seconds"}
    assert "p" not in found.dims
    assert json.loads(found.attrs["overrides"]) == sets
    folder = tmp_path / "out/test"
    [curve, *_] = read_json(folder / "summary.json")["curves"]
    assert names < set(curve)
    assert not {"moments", "variance_rate", "impact_rate", "sensitivities"} & set(curve)
    header = (folder / "curves.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert header[2:6] == ["lyapunov_exponent", "lyapunov_exponent_error", "stability_index", "stability_index_error"]
    assert not list(folder.glob("*.vtu"))
    assert all(result.sensitivities is None and not result.moments.p.size for result in results)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs over different keys, one of them without moments."""
    folder = tmp_path_factory.mktemp("runs")
    treatments = "vary={'noise.treatment' = ['exact', 'ou-reduction']}"
    solved(folder, TEXT, "alone", ["output.quantities=['moment']"])
    solved(folder, TEXT, "noises", [treatments, "output.quantities=['lyapunov_exponent']"])
    solved(folder, TEXT + PRODUCT, "product")
    solved(folder, TEXT + ZIP, "sets", ["moments.p=[2.0, 4.0]"])
    return folder / "out"


@pytest.mark.slow
def test_many_runs_are_one_dataset(runs, monkeypatch):
    monkeypatch.chdir(runs.parent)
    found = fpsolve.open_results("out/*")
    assert dict(found.sizes) == {"row": 3 + 2 + 4 * 3 + 3 * 2}
    assert len(found.to_dataframe()) == 23
    assert found["run"].values.tolist() == [*["alone"] * 3, *["noises"] * 2, *["product"] * 12, *["sets"] * 6]
    assert np.unique(found["set"]).tolist() == [*range(1, 11)]
    first = found.to_dataframe().groupby("set").first()
    assert first["oscillator.omega"].tolist() == [1.0] * 8 + [2.0] * 2
    assert first["noise.treatment"].tolist() == [
        "ou-reduction", *["exact", "ou-reduction"] * 3, *["ou-reduction"] * 3
    ]  # fmt: skip
    assert np.isnan(first.lyapunov_exponent).tolist() == [True, *[False] * 9]
    alone = fpsolve.open_results("out/alone")
    assert float(found.moment.sel(p=2.0)[0]) == float(alone.moment.sel(p=2.0).item())
    assert alone.p.values.tolist() == [2.0, 0.0, -1.0]
    for p, number in {2.0: 8, 4.0: 3, 0.0: 5}.items():
        chosen = found.sel(p=p)
        assert dict(chosen.sizes) == {"set": number}
        assert np.isfinite(chosen.moment).all()
    assert np.isnan(found.moment).values.tolist() == np.isnan(found.p).values.tolist()
    negative = found.where(found.lyapunov_exponent < 0, drop=True)
    assert len(negative.to_dataframe()) == np.sum(found.lyapunov_exponent < 0) > 0
    for name in ("alone", "product", "sets"):
        with xr.open_dataset(runs / name / "results.nc") as file:
            own = found.isel(row=found.run == name)
            np.testing.assert_array_equal(own.moment, file.moment.values.ravel())
            assert own.moment.attrs == file.moment.attrs


@pytest.mark.slow
def test_runs_of_other_noises_are_one_dataset(runs, tmp_path):
    noise = TEXT.partition("[noise]")[0] + '[noise]\nkind = "sine-wiener"\namplitude = 1.0\nsigma = 1.0\n'
    solved(tmp_path, noise + TEXT[TEXT.index("[moments]") :], "sine")
    found = fpsolve.open_results(runs / "alone", tmp_path / "out/sine")
    assert np.isnan(found["noise.sigma"]).values.tolist() == [True] * 3 + [False] * 3
    assert found["noise.treatment"].values.tolist() == ["ou-reduction"] * 3 + [""] * 3


def test_runs_without_moments_have_no_p(runs):
    found = fpsolve.open_results(runs / "noises")
    assert dict(found.sizes) == {"row": 2}
    assert np.isnan(found.p).all()
    assert len(found.to_dataframe()) == 2


@pytest.mark.parametrize("places", [("nowhere",), ("out/*.toml", "none*"), ()])
def test_no_results(tmp_path, monkeypatch, places):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FpsolveError, match=r"no results.nc in .*(nowhere|none\*|nothing); run a case first"):
        fpsolve.open_results(*places)


def test_the_unit_of_time_labels_files_and_tables(tmp_path, capsys):
    """And changes no number."""
    found = {}
    for unit, line in {"time": "", "s": '[units]\ntime = "s"\n'}.items():
        path = tmp_path / f"{unit}.toml"
        path.write_text(TEXT + line, encoding="utf-8")
        assert main(["run", str(path), "--out", str(tmp_path), "--set", "output.quantities=['moment']"]) == 0
        data, told = fpsolve.open_results(tmp_path / unit), capsys.readouterr().out
        assert data.moment.units == f"1/{unit}"
        assert ("Λ(p) in 1/s" in told) is (unit == "s")
        summary = read_json(tmp_path / unit / "summary.json")
        assert summary["units"] == {"time": unit}
        found[unit] = data.moment.values.tolist()
    assert found["s"] == found["time"]
