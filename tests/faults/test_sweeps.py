"""Sweeps: a fault of each kind loses nothing that is finished, and results do not depend on who worked."""

import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import zlib
from collections import Counter
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from fpsolve import load_case
from tests import kit
from tests.conftest import heed_signals, started
from tests.kit import sets

SIZE = 3
"""Sets each way."""
SECTIONS = f"""
[moments]
p = {{ start = -2.0, stop = 4.0, num = 4 }}
[vary]
"noise.D0" = {{ start = 0.1, stop = 1.0, num = {SIZE}, scale = "log" }}
"oscillator.omega" = {{ start = 0.5, stop = 3.0, num = {SIZE} }}
[output]
figure = false
quantities = ["moment", "lyapunov_exponent", "stability_index", "variance_rate", "critical_impact_factor"]
"""
CASE = kit.case_text(SECTIONS, "A sweep", epsilon=0.5)
FEW = "--set", 'vary={"noise.D0" = [0.1, 0.4, 1.0]}', "--set", "moments.p=[2.0]", "--set", kit.LEAN
"""Three sets that are solved at once."""
MAIN = "from fpsolve.cli import main; print('begun', flush=True); raise SystemExit(main())"
PASSING = {"started", "wall_seconds", "command", "host"}
PROC = Path("/proc")
pytestmark = pytest.mark.skipif(not (PROC / "self/stat").exists(), reason="finds processes as Linux tells them")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a case, and where this process alone has solved it, in whole."""
    folder = tmp_path_factory.mktemp("sweeps")
    run(folder, "whole", "--jobs", "1")
    return folder


def run(folder, out, *options):
    """A run to its end, in this process."""
    ended = kit.run(folder, "run", "sweep.toml", "--out", out, *options, sweep=CASE)
    assert ended.code == 0, ended.err


def begun(folder, out, *options, before=heed_signals):
    """A run in a process of its own."""
    process = started(MAIN, "run", "sweep.toml", "--out", out, *options, before=before, cwd=folder)
    assert process.stdout.readline() == "begun\n"
    return process


def lines(folder, out):
    return kit.records_in(folder / out / "sweep")


def summary(folder, out):
    found = kit.read_json(folder / out / "sweep/summary.json")
    return {**found, "sets": [{**parameter_set, "seconds": 0} for parameter_set in found["sets"]]}


def assert_same_results(folder, out, other="whole"):
    """results.nc bit for bit, but for seconds and times; and the parameter sets of summary.json.

    A set that was cut between two p has several records. It begins anew at the others, so that its numbers are the same
    within their errors.
    """
    records = Counter(line.split(b'"')[3] for line in lines(folder, out) if sets([line]))
    parameter_sets = load_case(folder / "sweep.toml").sets()
    cut = [each.number - 1 for each in parameter_sets if records[each.digest.encode()] > 1]
    paths = [folder / each / "sweep/results.nc" for each in (out, other)]
    with xr.open_dataset(paths[0]) as one, xr.open_dataset(paths[1]) as two:
        is_cut = np.isin(np.arange(one.status.size).reshape(one.status.shape), cut)
        assert cut or one.drop_vars("seconds").equals(two.drop_vars("seconds"))
        for name in set(one.data_vars) - {"seconds", "messages"}:
            found, known = one[name].values, two[name].values
            assert found[~is_cut].tobytes() == known[~is_cut].tobytes(), name
            if (error := f"{name}_error") in one:
                assert np.all(abs(found - known)[is_cut] <= (one[error] + two[error]).values[is_cut]), name
            np.testing.assert_equal(one[name].attrs, two[name].attrs)
        kept = [{key: value for key, value in each.attrs.items() if key not in PASSING} for each in (one, two)]
        assert kept[0] == kept[1]
        assert one.attrs["complete"] == 1
    parameter_sets = zip(summary(folder, out)["sets"], summary(folder, other)["sets"], strict=True)
    assert all(one == two for k, (one, two) in enumerate(parameter_sets) if k not in cut)
    assert not any((folder / out).rglob(".fpsolve-*"))


def wait_for_sets(folder, out, count, process):
    """Until so many are begun, or the run has ended."""
    for _ in range(12_000):
        if len(sets(lines(folder, out))) >= count or process.poll() is not None:
            return
        time.sleep(0.01)


def children(process):
    """The workers of a run."""
    found = []
    for path in PROC.glob("[0-9]*/stat"):
        with suppress(OSError):
            is_own = int(path.read_text().rpartition(")")[2].split()[1]) == process.pid
            found += [int(path.parent.name)] if is_own and "spawn_main" in (path.parent / "cmdline").read_text() else []
    return found


def limited():
    """Files may have 12 kB, which a disk that fills up during the sweep looks like."""
    import resource

    heed_signals()
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000))


def apart():
    """A group of processes of its own, as a terminal makes."""
    os.setsid()
    heed_signals()


def of_kind(name):
    return lambda process: process.send_signal(getattr(signal, name))


AGAIN = "run it again to go on\n"
DIED = "a worker has died, perhaps for lack of memory; what was finished is kept, and the same command goes on\n"
FAULTS = {
    # jobs, how the process begins, what befalls it, its exit code, what it says at the end
    "kill": ("2", heed_signals, of_kind("SIGKILL"), -9, ""),
    "interrupt": ("2", heed_signals, of_kind("SIGINT"), 130, AGAIN),
    "Ctrl-C in a terminal": ("2", apart, lambda process: os.killpg(process.pid, signal.SIGINT), 130, AGAIN),
    "a killed worker": ("2", heed_signals, lambda process: os.kill(children(process)[0], signal.SIGKILL), 3, DIED),
    "a full disk": ("1", limited, lambda process: process.wait(120), 2, "; choose another --out\n"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_sweep_that_ends_early_keeps_what_is_solved_and_the_same_command_goes_on(place, name):
    jobs, before, befall, code, words = FAULTS[name]
    process = begun(place, name, "--jobs", jobs, before=before)
    wait_for_sets(place, name, 3, process)
    workers = children(process)
    befall(process)
    _, said = process.communicate(timeout=120)
    told = [line for line in said.splitlines(keepends=True) if not line.startswith("sweep, solving: ")]
    assert (process.returncode, len(told)) == (code, bool(words)), said
    assert said.endswith(words)
    assert len(workers) == (2 if jobs == "2" else 0)
    done, is_full = lines(place, name), name == "a full disk"
    assert (1 if is_full else 3) <= len(sets(done)) < SIZE**2
    if words and not is_full:
        left, whole = summary(place, name), summary(place, "whole")["sets"]
        assert not left["complete"]
        assert 1 <= left["done"] <= len(left["sets"]) <= len(sets(done))
        assert left["done"] <= sum(
            parameter_set in whole for parameter_set in left["sets"]
        )  # of others a part is known
    for _ in range(200):
        if not any((PROC / f"{each}").exists() for each in workers):
            break
        time.sleep(0.05)
    else:
        pytest.fail("workers go on")
    run(place, name, "--jobs", jobs)
    more = lines(place, name)
    assert len(sets([each for each in more if each not in done]) & sets(done)) <= int(jobs)  # those that had begun
    assert_same_results(place, name)
    assert {each for each in done if each.endswith(b"\n")} <= {*more}
    assert len(sets(more)) == SIZE**2
    run(place, name, "--jobs", jobs)
    assert sorted(lines(place, name)) == sorted(more)


@pytest.mark.slow
def test_sweep_killed_at_any_moment_leaves_whole_files(place):
    rng, out = random.Random(9), "any"
    for kind in (signal.SIGKILL, signal.SIGTERM, signal.SIGKILL):
        before, process = {*lines(place, out)}, begun(place, out, "--jobs", "2")
        time.sleep(rng.uniform(0.5, 4))
        process.send_signal(kind)
        _, said = process.communicate(timeout=120)
        assert process.returncode in (0, -kind, 143)  # -kind as Python itself begins or ends
        assert "Traceback" not in said
        assert {line for line in before if line.endswith(b"\n")} <= {*lines(place, out)}
        if (place / out / "sweep/summary.json").exists():
            left = summary(place, out)
            assert left["complete"] == (left["done"] == left["planned"])
            assert len(left["sets"]) >= left["done"]  # of others a part is known
    run(place, out, "--jobs", "1")
    assert_same_results(place, out)


def test_torn_and_damaged_records_are_solved_again_and_what_is_no_record_is_left(tmp_path):
    for out in ("whole", "torn"):
        run(tmp_path, out, "--jobs", "1", *FEW)
    folder = tmp_path / "torn/sweep/records"
    [path] = folder.glob("*.jsonl")
    content = path.read_bytes().splitlines(keepends=True)
    key, _, record = content[0].removesuffix(b"}\n").partition(b', "record": ')
    strange = json.dumps({name: [0] for name in json.loads(record)}).encode()
    key = re.sub(rb'"crc32": \d+', b'"crc32": %d' % zlib.crc32(strange), key)
    content[0] = content[0].replace(b"0.", b"1.", 1)
    content[1] = b"\0" * 40 + b"\n"
    content[2] = content[2][: len(content[2]) // 2]
    path.write_bytes(key + b', "record": ' + strange + b"}\n" + b"".join(content))  # the first has another form
    (folder / "folder.jsonl").mkdir()
    (folder / "lost.jsonl").symlink_to(tmp_path / "nowhere")
    os.mkfifo(folder / "pipe.jsonl")
    run(tmp_path, "torn", "--jobs", "1", *FEW)
    assert_same_results(tmp_path, "torn")
    assert len(sets(lines(tmp_path, "torn"))) == 3
    run(tmp_path, "torn", "--jobs", "1", "--fresh", *FEW)
    assert len(sets(lines(tmp_path, "torn"))) == 3
    assert {each.name for each in folder.iterdir()} > {"folder.jsonl", "lost.jsonl", "pipe.jsonl"}


def test_changed_parameter_solves_only_what_it_changes(tmp_path):
    for more, count in (
        ((), 3),
        (("--set", 'vary={"noise.D0" = [0.1, 0.7]}'), 4),
        (("--set", 'title="Another"'), 4),
        (("--fresh",), 3),
    ):
        run(tmp_path, "changed", "--jobs", "1", *FEW, *more)
        assert len(sets(lines(tmp_path, "changed"))) == count
        assert summary(tmp_path, "changed")["done"] == (2 if "vary" in str(more) else 3)
        assert summary(tmp_path, "changed")["title"] == ("Another" if "title" in str(more) else "A sweep")


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_single_set_is_solved_once_by_any_number_of_processes(tmp_path, jobs):
    run(tmp_path, jobs, "--jobs", jobs, *FEW, "--set", "vary={}")
    assert len(sets(lines(tmp_path, jobs))) == 1


@contextmanager
def dask_cluster(count=2):
    """The address of a scheduler, and its workers, each a process of its own, on the loopback."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    address, dask = f"tcp://127.0.0.1:{port}", [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"]
    worker = [*dask, "worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    options = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    running = [subprocess.Popen(each, **options) for each in (scheduler, *[worker] * count)]
    try:
        from distributed import Client

        with Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=120)
        yield address, running[1:]
    finally:
        for each in running:
            each.kill()
            each.wait()


@pytest.mark.slow
def test_cluster_gives_the_same_results_and_a_run_ends_where_it_loses_all_workers(place):
    pytest.importorskip("distributed")
    with dask_cluster() as (address, workers):
        for out, code, words in (("cluster", 0, ""), ("deserted", 3, "no worker is left")):
            process = begun(place, out, "--scheduler", address)
            wait_for_sets(place, out, 3, process)
            workers.pop().kill()
            _, said = process.communicate(timeout=240)
            assert process.returncode == code, said
            assert words in said
            if not code:
                run(place, "again", *FEW, "--scheduler", address)
    assert len(sets(lines(place, "again"))) == 3
    assert_same_results(place, "cluster")
    shutil.copytree(place / "deserted", place / "gone on")
    assert 3 <= len(sets(lines(place, "gone on"))) < SIZE**2
    run(place, "gone on", "--jobs", "1")
    assert_same_results(place, "gone on")
