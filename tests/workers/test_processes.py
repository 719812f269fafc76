"""Who lives, as the system tells it."""

import os
import shutil

import pytest

from r2sego_blender.workers.processes import _told_by_ps, birth


def test_a_process_has_one_birth_and_one_that_is_not_there_none():
    assert birth(os.getpid()) == birth(os.getpid()) != ""
    assert birth(0) == "" and birth(2**22 + 5) == ""


@pytest.mark.skipif(shutil.which("ps") is None or os.name == "nt", reason="there is no ps")
def test_ps_tells_the_same_birth_to_who_has_another_language_and_time_zone(monkeypatch):
    """On macOS, where a job is begun in Blender from the Dock and followed in one from a terminal."""
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    begun = _told_by_ps(os.getpid())
    monkeypatch.setenv("TZ", "America/New_York")
    monkeypatch.setenv("LC_ALL", "de_DE.UTF-8")
    assert _told_by_ps(os.getpid()) == begun != ""
    assert begun.split()[-1].isdigit()
    assert _told_by_ps(2**22 + 5) == ""
