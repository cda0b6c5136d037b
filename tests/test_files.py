"""Files that are written whole, and folders that one run has for itself."""

import errno
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


def test_a_lock_that_its_owner_removes_is_taken_anew(tmp_path, monkeypatch):
    """One run opens the file of another, which ends before the first has locked it."""
    from fpsolve import files

    original, opened = files._is_ours, []

    def after_the_other_ended(handle):
        if not opened:
            (tmp_path / files.LOCK).unlink()
        opened.append(handle)
        return original(handle)

    monkeypatch.setattr(files, "_is_ours", after_the_other_ended)
    with alone(tmp_path):
        assert len(opened) == 2
        assert (tmp_path / files.LOCK).exists()
