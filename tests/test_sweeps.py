"""Sweeps: results do not depend on who works, nor on kills, full disks and dead workers on the way."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import chdir, contextmanager, nullcontext, suppress
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from fpsolve import pool
from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.errors import WorkersDied
from fpsolve.output import records
from fpsolve.output.records import Records
from fpsolve.pool import cluster
from fpsolve.workflow import run_case
from fpsolve.workflow.progress import Watch
from fpsolve.workflow.sets import SOLVED_RECORDS
from tests.conftest import heed_signals, sampled, started
from tests.kit import case_text, read_json

SIZE = 4
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
CASE = case_text(SECTIONS, "A sweep", epsilon=0.5)
MAIN = "from fpsolve.cli import main; raise SystemExit(main())"
PASSING = {"started", "wall_seconds", "command", "host"}
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals and limits of POSIX")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a case."""
    folder = tmp_path_factory.mktemp("sweeps")
    (folder / "sweep.toml").write_text(CASE, encoding="utf-8")
    return folder


def whole(folder):
    """Where this process alone has solved the case."""
    if not (folder / "whole").exists():
        run(folder, "whole", "--jobs", "1")
    return folder / "whole"


def begun(folder, out, *options, before=heed_signals):
    """A run in a process of its own."""
    return started(MAIN, "run", "sweep.toml", "--out", out, *options, before=before, cwd=folder)


def run(folder, out, *options):
    """A run to its end, in this process."""
    with chdir(folder):
        assert main(["run", "sweep.toml", "--out", out, *options]) == 0


def lines(folder, out):
    """All records that were written, the torn ones too."""
    paths = (folder / out / "sweep" / SOLVED_RECORDS).glob("*")
    return [line for path in paths for line in path.read_bytes().splitlines(keepends=True)]


def assert_same_results(folder, out):
    """results.nc bit for bit, but for seconds and times; and the curves of summary.json."""
    with (
        xr.open_dataset(folder / out / "sweep/results.nc") as one,
        xr.open_dataset(whole(folder) / "sweep/results.nc") as two,
    ):
        assert one.drop_vars("seconds").equals(two.drop_vars("seconds"))
        for name in set(one.data_vars) - {"seconds"}:
            assert one[name].values.tobytes() == two[name].values.tobytes(), name
            np.testing.assert_equal(one[name].attrs, two[name].attrs)
        kept = [{key: value for key, value in each.attrs.items() if key not in PASSING} for each in (one, two)]
        assert kept[0] == kept[1]
        assert one.attrs["complete"] == 1
    curves = [read_json(each / "sweep/summary.json")["curves"] for each in (folder / out, whole(folder))]
    assert [{**curve, "seconds": 0} for curve in curves[0]] == [{**curve, "seconds": 0} for curve in curves[1]]


def wait_for_records(place, out, count, process):
    """Until so many are written, or the run has ended."""
    for _ in range(6000):
        if len(lines(place, out)) >= count or process.poll() is not None:
            return
        time.sleep(0.01)


@pytest.mark.slow
def test_killed_again_and_again(place):
    """At most one set for each worker is solved twice, and the result is that of an undisturbed run."""
    out, killed = "killed", 0
    for _ in range(2):
        done = len(lines(place, out))
        process = begun(place, out, "--jobs", "2")
        wait_for_records(place, out, done + 3, process)
        killed += process.poll() is None
        process.kill()
        process.communicate(timeout=60)
    assert killed
    run(place, out, "--jobs", "1")
    assert_same_results(place, out)
    assert SIZE**2 <= len(lines(place, out)) <= SIZE**2 + 2 * killed
    before = lines(place, out)
    run(place, out, "--jobs", "1")
    assert lines(place, out) == before
    assert_same_results(place, out)


def limited():
    """Files may have 12 kB, which a disk that fills up during the sweep looks like."""
    import resource

    heed_signals()
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000))


@pytest.mark.slow
def test_a_full_disk(place):
    process = begun(place, "full", "--jobs", "1", before=limited)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 2
    assert "cannot be written" in said
    assert "Traceback" not in said
    done = len(lines(place, "full"))
    assert 0 < done < SIZE**2
    run(place, "full", "--jobs", "1")
    assert_same_results(place, "full")
    assert len(lines(place, "full")) == SIZE**2


@pytest.mark.slow
def test_torn_and_damaged_records_are_solved_again(place):
    shutil.copytree(whole(place), place / "torn")
    [path] = (place / "torn/sweep" / SOLVED_RECORDS).glob("*")
    content = path.read_bytes().splitlines(keepends=True)
    content[3] = content[3].replace(b"0.", b"1.", 1) if b"0." in content[3] else content[3][1:]
    content[5] = b"\0" * len(content[5])
    content[-1] = content[-1][: len(content[-1]) // 2]
    path.unlink()
    path.with_name("another.jsonl").write_bytes(b"".join(content))  # as another process left it
    run(place, "torn", "--jobs", "1")
    assert_same_results(place, "torn")
    assert len(lines(place, "torn")) - len(content) == 3


def test_what_is_no_file_holds_no_records(tmp_path):
    (tmp_path / "folder.jsonl").mkdir()
    (tmp_path / "lost.jsonl").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "pipe.jsonl")
    records = Records(tmp_path)
    assert not records.look().are_there
    records.remove()
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.slow
def test_a_changed_parameter_solves_only_what_it_changes(place):
    shutil.copytree(whole(place), place / "changed")
    omega, D0 = "[0.5, 0.7]", f'{{ start = 0.1, stop = 1.0, num = {SIZE}, scale = "log" }}'
    sets = f'vary={{ "noise.D0" = {D0}, "oscillator.omega" = {omega} }}'
    run(place, "changed", "--jobs", "1", "--set", sets)
    assert len(lines(place, "changed")) == SIZE**2 + SIZE  # omega = 0.5 is known
    run(place, "changed", "--jobs", "1", "--set", 'title="Another"', "--set", "figure.x=p")
    assert_same_numbers = read_json(place / "changed/sweep/summary.json")
    assert (assert_same_numbers["done"], assert_same_numbers["title"]) == (SIZE**2, "Another")
    assert len(lines(place, "changed")) == SIZE**2 + SIZE
    run(place, "changed", "--jobs", "1", "--fresh")
    assert len(lines(place, "changed")) == SIZE**2


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_solved(place):
    process = begun(place, "interrupted", "--jobs", "2")
    folder = place / "interrupted/sweep" / SOLVED_RECORDS
    wait_for_records(place, "interrupted", 4, process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "run it again to go on" in said
    assert "Traceback" not in said
    summary = read_json(place / "interrupted/sweep/summary.json")
    assert not summary["complete"]
    assert summary["done"] == len(summary["curves"]) >= 3
    with xr.open_dataset(place / "interrupted/sweep/results.nc") as found:
        assert found.attrs["complete"] == 0
        assert int((found.status != 3).sum()) == summary["done"]
    assert Records(folder).look().are_there
    run(place, "interrupted", "--jobs", "1")
    assert_same_results(place, "interrupted")


def apart():
    """A group of processes of its own, as a terminal makes."""
    os.setsid()
    heed_signals()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "code"), [(signal.SIGINT, 130)])
def test_what_a_terminal_sends_to_all_ends_a_run_in_one_sentence(place, kind, code):
    """Ctrl-C, and a terminal that is closed."""
    out = f"terminal-{code}"
    process = begun(place, out, "--jobs", "2", before=apart)
    wait_for_records(place, out, 1, process)
    os.killpg(process.pid, kind)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code, said
    assert "run it again to go on" in said
    assert len(said.splitlines()) == 1


def children(process):
    """The workers of a run."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(path.read_text().rpartition(")")[2].split()[1]) == process.pid:
                line = (path.parent / "cmdline").read_text()
                found += [int(path.parent.name)] if "spawn_main" in line else []
    return found


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes as Linux tells them")
def test_a_killed_worker_ends_a_run_and_the_same_command_goes_on(place):
    process = begun(place, "orphan", "--jobs", "2")
    wait_for_records(place, "orphan", 4, process)
    os.kill(children(process)[0], signal.SIGKILL)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 3
    assert said == (
        "a worker has died, perhaps for lack of memory; what was finished is kept, and the same command goes on\n"
    )
    done = len(lines(place, "orphan"))
    summary = read_json(place / "orphan/sweep/summary.json")
    assert 4 <= summary["done"] == done < SIZE**2
    run(place, "orphan", "--jobs", "2")
    assert_same_results(place, "orphan")  # as of one process, though others solved all
    assert len(lines(place, "orphan")) == SIZE**2


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes as Linux tells them")
def test_workers_end_with_a_run_that_is_killed_and_not_by_signals_of_a_terminal(place):
    """These they have masked: the run ends them."""
    process = begun(place, "left", "--jobs", "2")
    wait_for_records(place, "left", 1, process)
    workers = children(process)
    masks = [re.search(r"SigBlk:\s*(\w+)", Path(f"/proc/{each}/status").read_text()) for each in workers]
    process.kill()
    process.communicate(timeout=60)
    assert len(masks) == 2
    assert all(int(mask[1], 16) >> (kind - 1) & 1 for mask in masks for kind in (signal.SIGINT, signal.SIGHUP))
    for _ in range(100):
        if not any(Path(f"/proc/{each}").exists() for each in workers):
            return
        time.sleep(0.05)
    pytest.fail("workers go on")


@contextmanager
def dask_cluster(count=2):
    """The address of a scheduler, its workers and itself, each a process of its own, on the loopback."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    options = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "dask"]
    port = address.rpartition(":")[2]
    scheduler = subprocess.Popen(
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"], **options
    )
    worker = [*dask, "worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    workers = [subprocess.Popen(worker, **options) for _ in range(count)]
    try:
        from distributed import Client

        with Client(address, timeout=30, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=60)
        yield address, workers, scheduler
    finally:
        for each in [*workers, scheduler]:
            each.kill()
            each.wait()


@pytest.mark.slow
def test_a_cluster_gives_the_same_results_and_is_told_of_where_it_loses_all_workers(place, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "CONNECT_SECONDS", 5)
    case = load_case(place / "sweep.toml", ["vary={}"])
    with dask_cluster() as (address, workers, _):
        workers_of = cluster(address)  # works for one case after the other, as its client ends with each
        numbers = [run_case(case, place / out, pool=workers_of).results[0].moments.value for out in ("first", "second")]
        np.testing.assert_array_equal(*numbers)
        process = begun(place, "cluster", "--scheduler", address)
        wait_for_records(place, "cluster", 4, process)
        workers[0].kill()
        said = process.communicate(timeout=120)
        assert process.returncode == 0, said
        assert_same_results(place, "cluster")
        assert len(lines(place, "cluster")) <= SIZE**2 + 1
        seen = []

        def advance(*_, **__):
            seen.append(workers[1].kill() if not seen else None)

        watch = Watch(bar=lambda _: nullcontext(advance))
        with pytest.raises(WorkersDied, match="no worker is left"):
            run_case(load_case(place / "sweep.toml"), place / "deserted", pool=workers_of, watch=watch)
    assert 0 < len(lines(place, "deserted")) < SIZE**2


@pytest.mark.parametrize("jobs", sampled("1", "2"))
def test_a_single_set(place, jobs):
    run(place, f"single{jobs}", "--jobs", jobs, "--set", "vary={}")
    assert len(lines(place, f"single{jobs}")) == 1


def test_batches_follow_from_the_case_alone(place):
    from fpsolve.study.solve import batch_size

    case = load_case(place / "sweep.toml")
    assert case.planned == SIZE**2
    assert [batch_size(n) for n in (1, 49, 256, 512, 10_000, 10**7)] == [1, 1, 1, 2, 39, 64]


def test_the_first_sets_come_one_by_one(place):
    """This process, which begins alone, calls others once it sees that sets take long."""
    from fpsolve.study.solve import Order, batches, everything

    num = "{ start = 0.1, stop = 1.0, num = 40 }"
    case = load_case(place / "sweep.toml", [f'vary={{ "noise.D0" = {num}, "noise.tau0" = {num} }}'])
    found = list(batches(case, lambda number, varied: Order(number, varied, everything(case))))
    assert [len(batch) for batch in found[:8]] == [1] * 6 + [6] * 2
    assert [order.number for batch in found for order in batch] == list(range(1, 1601))


def test_records_are_read_once(tmp_path, monkeypatch):
    """However often one looks, as after an interrupt."""
    parsed = []
    original = records._parsed
    monkeypatch.setattr(records, "_parsed", lambda line: parsed.append(line) or original(line))
    known = Records(tmp_path)
    for number in range(5):
        records.append(tmp_path, f"key{number}", {"number": number})
        place = known.look().address(f"key{number}")
        assert len(parsed) == number + 1
    [path] = tmp_path.glob("*.jsonl")
    with path.open("ab") as file:
        file.write(b'{"key": "torn')
    assert known.look().address("key4") == place
    monkeypatch.undo()
    assert known.read(known.address("key3")) == {"number": 3}
    known.remove()
    records.append(tmp_path, "key0", {"number": 10})
    assert known.look().read(known.address("key0")) == {"number": 10}


@pytest.mark.slow
def test_a_drawing_that_fails_costs_no_numbers(place, monkeypatch):
    case = load_case(place / "sweep.toml", ["vary={}", "output={}", "moments.p=[1.0]"])
    before = run_case(case, place / "drawn").results[0]

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr("fpsolve.parts.eigenfunctions.stationary_density", fail)
    outcome = run_case(case, place / "drawn")
    assert not outcome.failures
    np.testing.assert_array_equal(outcome.results[0].moments.value, before.moments.value)
