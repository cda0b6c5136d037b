"""Internals of measurements: kinds that are fitted, arrays of MATLAB, and limits of what is read."""

import sys

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.io import savemat

from fpsolve import FpsolveError
from fpsolve.measured import read_record, tables
from fpsolve.measured import text as text_tables
from fpsolve.measured.kinds import KINDS

FAMILIES = [each for families in KINDS.values() for each in families]


@pytest.mark.parametrize("family", FAMILIES, ids=lambda each: ",".join(each.names))
def test_kinds_have_the_covariance_and_the_density_of_their_noises(family):
    """C(0) is the variance, and 2∫ C cos ωt dt over t > 0 the density."""
    t, theta = np.linspace(0, 200, 200_001), np.array([1.3, 0.4, 0.7, 0.8][: len(family.names)])
    noise, c = family.make(*theta.tolist()), family.covariance(t, theta)
    assert c[0] == pytest.approx(noise.standard_deviation**2)
    for omega in (0.3, 2.0):
        assert family.density(np.array([omega]), theta)[0] == pytest.approx(noise.spectral_density(omega))
        assert 2 * trapezoid(c * np.cos(omega * t), t) == pytest.approx(noise.spectral_density(omega), rel=1e-4)


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_of_matlab_of_all_types_are_read_and_the_rest_is_left_out(compressed, tmp_path):
    kinds, wide = ("u1", "i2", "i4", "u8", "f4", "f8"), np.arange(12.0).reshape(6, 2)
    others = {"text": "a", "cell": np.array([1, "a"], dtype=object), "z": np.array([1j]), "deep": {"x": 1.0}}
    arrays = {f"x_{kind}": np.array([[1, 2, 100]], dtype=kind) for kind in kinds}
    savemat(tmp_path / "a.mat", {**arrays, "wide": wide, **others}, do_compression=compressed)
    found = {name: each.values.tolist() for name, each in tables.read_table(tmp_path / "a.mat").columns.items()}
    expected = {**{key: [1, 2, 100] for key in arrays}, "wide 1": wide[:, 0].tolist(), "wide 2": wide[:, 1].tolist()}
    assert found == expected


def test_universal_file_without_pyuff_says_how_it_is_installed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    (tmp_path / "a.uff").write_text("    -1\n    58\n", encoding="utf-8")
    with pytest.raises(FpsolveError, match=r"needs pyuff: pip install 'fpsolve\[measured\]'"):
        read_record(tmp_path / "a.uff")


def test_what_is_too_large_is_refused_before_it_is_read(tmp_path, monkeypatch):
    arrays = {f"a{k}": np.zeros(2**12) for k in range(4)}
    np.savez_compressed(tmp_path / "a.npz", **arrays)
    (tmp_path / "b.csv").write_text("t,x\n" + "1,2\n" * 5000, encoding="utf-8")
    savemat(tmp_path / "c.mat", arrays, do_compression=True)
    monkeypatch.setattr(tables, "MOST_NUMBERS", 2**13)
    monkeypatch.setattr(text_tables, "MOST_LINES", 4000)
    for name, most in (("a.npz", 2**13), ("b.csv", 4000), ("c.mat", 2**13)):
        with pytest.raises(FpsolveError, match=f"{most}"):
            read_record(tmp_path / name, rate=1.0)
