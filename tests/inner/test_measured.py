"""Internals of measurements: kinds that are fitted, arrays of MATLAB, libraries that are missing, memory."""

import os
import pickle

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.io import savemat

from fpsolve import FpsolveError
from fpsolve.measured import read_record
from fpsolve.measured.files import KINDS as KINDS_OF_FILES
from fpsolve.measured.files import read_table
from fpsolve.measured.kinds import KINDS

FAMILIES = [each for families in KINDS.values() for each in families]


@pytest.mark.parametrize("family", FAMILIES, ids=lambda each: ",".join(each.names))
def test_kinds_have_the_covariance_and_the_density_of_their_noises(family):
    """C(0) is the variance, and 2∫ C cos ωt dt over t > 0 the density."""
    t, [values] = np.linspace(0, 200, 200_001), family.values(np.array([1.3, 0.4, 0.7, 0.8][: len(family.names)]))
    noise, c = family.noise.at(values), family.covariance(t, **values)
    assert c[0] == pytest.approx(noise.standard_deviation**2)
    for omega in (0.3, 2.0):
        assert family.density(np.array([omega]), **values)[0] == pytest.approx(noise.spectral_density(omega))
        assert 2 * trapezoid(c * np.cos(omega * t), t) == pytest.approx(noise.spectral_density(omega), rel=1e-4)


def test_arrays_of_matlab_of_all_types_are_read_and_the_rest_is_left_out(tmp_path):
    kinds, wide = ("u1", "i2", "i4", "u8", "f4", "f8"), np.arange(12.0).reshape(6, 2)
    others = {"text": "a", "cell": np.array([1, "a"], dtype=object), "z": np.array([1j]), "cube": np.ones((2, 2, 2))}
    arrays = {f"x_{kind}": np.array([[1, 2, 100]], dtype=kind) for kind in kinds}
    savemat(tmp_path / "a.mat", {**arrays, "wide": wide, "deep": {"x": wide[:, 0]}, **others})
    found = {name: each.tolist() for name, each in read_table(tmp_path / "a.mat").columns.items()}
    first, second = wide.T.tolist()
    expected = {
        **{key: [1, 2, 100] for key in arrays},
        "wide 1": first,
        "wide 2": second,
        "deep.x": first,
        "cell": ["1", "a"],
        "cube": ["float64 of shape (2, 2, 2)"],
    }
    assert found == expected


@pytest.mark.parametrize("ending", ["uff", "mseed", "tdms", "lvm", "parquet", "xlsx"])
def test_file_without_its_library_says_how_it_is_installed(ending, tmp_path, monkeypatch):
    """The process that reads it finds a library that is none before that of the environment."""
    library, _ = KINDS_OF_FILES[f".{ending}"]
    (tmp_path / f"{library}.py").write_text("raise ImportError", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    (tmp_path / f"a.{ending}").write_bytes(b"PK\0")
    with pytest.raises(FpsolveError, match=rf"needs {library}: pip install 'fpsolve\[measured\]'"):
        read_record(tmp_path / f"a.{ending}")


def test_file_that_would_take_all_memory_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros(2**27))
    with pytest.raises(FpsolveError, match="is no file that numpy reads"):
        read_record(tmp_path / "a.npz", rate=1.0, unit="1")


@pytest.mark.parametrize("name", ["a.mseed", "a.lvm.pkl"])
def test_a_pickle_in_the_place_of_a_file_or_beside_it_is_not_run(name, tmp_path):
    class Runs:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "made"),)

    (tmp_path / "a.lvm").write_text("LabVIEW Measurement\t\n", encoding="utf-8")
    (tmp_path / name).write_bytes(pickle.dumps(["obspy.core.stream", Runs()]))
    with pytest.raises(FpsolveError, match="is no file that"):
        read_record(tmp_path / name.removesuffix(".pkl"))
    assert not (tmp_path / "made").exists()
