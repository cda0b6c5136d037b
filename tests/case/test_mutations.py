"""Case files and mesh files with random faults: each is read, or refused with sentences; nothing else happens."""

import random
from pathlib import Path

import pytest

from fpsolve.case.case import load_case
from fpsolve.commands.options import BAD_INPUT
from fpsolve.errors import CaseError, MeshError
from fpsolve.fem.mesh import make_mesh, read_mesh, write_mesh
from tests.snapshots import good

COUNT = 48
"""Mutations of each kind; two thousand take a minute."""
CASES = sorted((Path(__file__).parents[2] / "cases").rglob("*.toml"))
GOOD = good("bad")
VALUES = [
    *("0", "-1", "1e308", "5e-324", "nan", "inf", "-0.0", "true", '"x"', "[]", "{}", "1e400", "9" * 400, "0x10"),
    *("", "[[]]", "[1, 2]", "{ a = 1 }", "1979-05-27", "07:32:00", '"\\u0000"', "'''\n'''", "[\n1,\n]", "[{}]"),
    *("{ start = 0, stop = 1, num = 2 }", '{ start = 1, stop = 2, num = 3, scale = "log" }', "{ noise.D0 = [2] }"),
    *('["exact"]', '["moment", "moment"]', '"noise.D0"', '"lyapunov_exponent"', "[1e308, -1e308]"),
]
PIECES = [*"=[]\"'\n#,.", "[[expect]]", "[vary]", *"\x00\ufeffép", "where", "{"]


def mutated(text, rng):
    """A text with one to four faults."""
    for _ in range(rng.randint(1, 4)):
        lines = text.splitlines() or [""]
        i = rng.randrange(len(lines))
        kind = rng.randrange(7)
        if kind == 0:
            del lines[i]
        elif kind == 1:
            lines.insert(i, rng.choice(lines))
        elif kind == 2:
            name = lines[i].partition("=")[0]
            lines[i] = f"{name}= {rng.choice(VALUES)}"
        elif kind == 3:
            at = rng.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:at] + rng.choice(PIECES) + lines[i][at:]
        elif kind == 4:
            at = rng.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:at] + lines[i][at + rng.randint(1, 3) :]
        elif kind == 5:
            lines[i] = lines[i].replace("=", "= [") + " ]" * rng.randint(0, 1)
        else:
            lines[i] = "".join(rng.sample(lines[i], len(lines[i])))
        text = "\n".join(lines) + "\n"
    return text


def refusals(path, overrides=()):
    """The sentences with which a case is refused, empty ones for lines that it does not have; none where it is read."""
    lines = range(1, path.read_bytes().count(b"\n") + 2)
    try:
        load_case(path, overrides)
    except CaseError as error:
        return [fault.sentence * (fault.line is None or fault.line in lines) for fault in error.faults] or [""]
    return []


@pytest.mark.parametrize("seed", range(4))
def test_mutated_cases_are_read_or_refused(seed, tmp_path):
    rng = random.Random(seed)
    refused = 0
    for _ in range(COUNT // 2):
        path = tmp_path / "case.toml"
        text = rng.choice([GOOD, rng.choice(CASES).read_text(encoding="utf-8")])
        cut = rng.choice([0, 0, rng.randrange(len(text))])
        path.write_text(mutated(text[cut:] + text[:cut], rng), encoding="utf-8")
        faults = refusals(path, rng.sample(GOOD.splitlines(), rng.randint(0, 1)))
        refused += bool(faults)
        assert all(faults)
        assert "pydantic" not in " ".join(faults)
        assert list(tmp_path.iterdir()) == [path]
    assert refused > COUNT // 10


def test_mutated_bytes_are_read_or_refused(tmp_path):
    rng = random.Random(5)
    path = tmp_path / "case.toml"
    for _ in range(COUNT // 4):
        data = bytearray(rng.choice(CASES).read_bytes())
        for _ in range(rng.randint(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(bytes(data))
        assert all(refusals(path))


SETS = "noise.D0,noise.r0,noise.treatment\n" + "".join(
    f"{0.1 + i},0.9,{'exact' if i % 2 else 'ou-reduction'}\n" for i in range(8)
)


@pytest.mark.parametrize("seed", range(3))
def test_mutated_files_of_sets_are_read_or_refused(seed, tmp_path):
    rng, refused = random.Random(seed), 0
    path, sets = tmp_path / "case.toml", tmp_path / "sets.csv"
    text = (CASES[0].parent / "minimal.toml").read_text(encoding="utf-8").partition("[vary]")[0]
    path.write_text(f'{text}[vary]\nfile = "sets.csv"\n', encoding="utf-8")
    for _ in range(COUNT):
        data = bytearray(mutated(SETS, rng).encode())
        if rng.random() < 0.5:
            data[rng.randrange(len(data))] = rng.choice([*b',";\r\n-.e\0', rng.randrange(256)])
        sets.write_bytes(bytes(data))
        faults = refusals(path)
        refused += bool(faults)
        assert all("sets.csv" in fault for fault in faults)
    assert COUNT // 10 < refused < COUNT


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
def test_mutated_meshes_are_read_or_refused(ending, tmp_path):
    original, path = tmp_path / f"good{ending}", tmp_path / f"bad{ending}"
    write_mesh(make_mesh(phi_cells=2, phi_degree=3, xi_cells=2, xi_degree=3), original)
    rng, refused = random.Random(7), 0
    for _ in range(COUNT // 3):
        data = bytearray(original.read_bytes())
        for _ in range(rng.randint(1, 6)):
            if rng.random() < 0.5:
                data[rng.randrange(len(data))] = rng.randrange(256)
            else:
                at = rng.randrange(len(data))
                del data[at : at + rng.randint(1, 40)]
        path.write_bytes(bytes(data))
        try:
            read_mesh(path)
        except MeshError:
            refused += 1
    assert refused > COUNT // 10


@pytest.mark.parametrize("seed", range(2))
def test_mutated_cases_run_or_are_refused(seed):
    from tests.mutated_cases import faults

    codes, found = faults(seed, COUNT // 4)
    assert found == []
    assert codes[BAD_INPUT]
