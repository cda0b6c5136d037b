"""What is said of faulty case files and files of sets, word by word; see tests/snapshots.py."""

import pytest

from tests import snapshots


@pytest.mark.parametrize("entry", snapshots.entries(), ids=lambda entry: entry.id)
def test_refusal(entry, tmp_path):
    assert entry.outcome(tmp_path) == entry.said
