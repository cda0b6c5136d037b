"""Files that are written whole, and folders that one run has for itself."""

import errno
import os
import signal
import subprocess
import sys

import pytest

from fpsolve.errors import OutputError
from fpsolve.files import LOCK, alone, atomic, writable, write_text

FAILURES = [
    OSError(errno.ENOSPC, "No space left on device"),
    PermissionError(errno.EACCES, "Permission denied", "/somewhere/.fpsolve-12345678.csv"),
    OSError("encoder error"),
]


@pytest.mark.parametrize("failure", FAILURES)
def test_a_failure_names_the_file_that_was_wanted(tmp_path, failure):
    path = tmp_path / "table.csv"
    with pytest.raises(OSError, match=r"table\.csv") as raised, atomic(path):
        raise failure
    assert type(raised.value) is type(failure)
    assert (raised.value.filename, raised.value.strerror) == (str(path), failure.strerror or "encoder error")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_to_take_a_place_names_it(tmp_path):
    path = tmp_path / "table.csv"
    path.mkdir()
    with pytest.raises(OutputError) as raised, writable(tmp_path):
        write_text(path, "1, 2")
    assert str(raised.value) == f"{path} cannot be written: Is a directory; choose another folder"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failure_without_a_number_is_told_by_its_text(tmp_path):
    with pytest.raises(OutputError) as raised, writable(tmp_path):
        raise OSError("encoder error")
    assert str(raised.value) == f"{tmp_path} cannot be written: encoder error; choose another folder"


def test_a_folder_that_cannot_be_made_names_the_file(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OSError, match=r"table\.csv") as raised:
        write_text(tmp_path / "file/table.csv", "1, 2")
    assert raised.value.filename == str(tmp_path / "file/table.csv")


HOLD = """
import sys
from pathlib import Path
from fpsolve.files import alone
with alone(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that has the folder for itself, until its input ends."""
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "held\n"
            yield process
        finally:
            process.kill()


def test_a_folder_is_kept_from_another_process(tmp_path, holder):
    with pytest.raises(OutputError, match=r"is being written by another run; wait for it, or choose another folder"):
        alone(tmp_path).__enter__()
    holder.communicate(timeout=60)
    with alone(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_lock_ends_with_a_killed_process(tmp_path, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait(timeout=60)
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]
    with alone(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_kept_from_the_same_process(tmp_path):
    with alone(tmp_path), pytest.raises(OutputError, match="another run"), alone(tmp_path):
        raise AssertionError
    with alone(tmp_path):
        pass


@pytest.fixture
def locking(monkeypatch):
    """Replaces the lock of the operating system."""
    fcntl = pytest.importorskip("fcntl")
    original = fcntl.flock

    def replace(lock):
        monkeypatch.setattr(fcntl, "flock", lambda *arguments: lock(original, *arguments))

    return replace


def test_a_lock_that_its_owner_removes_is_taken_anew(tmp_path, locking):
    """One run opens the file of another, which ends before the first has locked it."""
    opened = []

    def after_the_other_ended(original, handle, operation):
        if not opened:
            (tmp_path / LOCK).unlink()
        opened.append(handle)
        return original(handle, operation)

    locking(after_the_other_ended)
    with alone(tmp_path):
        assert len(opened) == 2
        assert (tmp_path / LOCK).exists()


@pytest.mark.parametrize("name", ["ENOSYS", "ENOLCK", "EOPNOTSUPP"])
def test_a_file_system_without_locks_keeps_nobody_out(tmp_path, locking, name):
    def refused(*_):
        raise OSError(getattr(errno, name), "no locks")

    locking(refused)
    with alone(tmp_path), alone(tmp_path):
        write_text(tmp_path / "table.csv", "1, 2")
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_a_lock_that_fails_for_another_reason_is_an_output_error(tmp_path, locking):
    def failed(*_):
        raise OSError(errno.EIO, "Input/output error")

    locking(failed)
    with pytest.raises(OutputError, match="Input/output error"), alone(tmp_path):
        raise AssertionError


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o002, 0o664), (0o077, 0o600)])
def test_the_umask_says_who_may_read_a_file(tmp_path, mask, mode):
    """Colleagues may, where it lets them; a file of `tempfile` only its owner."""
    former = os.umask(mask)
    try:
        write_text(tmp_path / "table.csv", "1, 2")
        with atomic(tmp_path / "new.nc") as temporary:  # a library may replace the file
            temporary.unlink()
            temporary.write_bytes(b"")
        assert os.umask(mask) == mask
    finally:
        os.umask(former)
    assert [path.stat().st_mode & 0o777 for path in sorted(tmp_path.iterdir())] == [mode, mode]
