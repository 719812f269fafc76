"""Locks of files: one holder at a time, none left by a process that was killed."""

import errno
import os
import subprocess
import sys

import pytest

from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.file_locks import try_lock


def test_a_locked_file_is_not_free_until_it_is_closed(tmp_path):
    with (tmp_path / "lock").open("a+") as first, (tmp_path / "lock").open("a+") as second:
        assert try_lock(first) and not try_lock(second)
        first.close()
        assert try_lock(second)


def test_a_killed_process_leaves_no_lock(tmp_path):
    holding = (
        "import sys, time\n"
        "from r2sego_blender.core.file_locks import try_lock\n"
        "file = open(sys.argv[1], 'a+')\n"
        "print(try_lock(file), flush=True)\n"
        "time.sleep(60)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", holding, tmp_path / "lock"], stdout=subprocess.PIPE, text=True)
    with process, (tmp_path / "lock").open("a+") as file:
        assert process.stdout.readline() == "True\n"
        assert not try_lock(file)
        process.kill()
        process.wait(timeout=30)
        assert try_lock(file)


@pytest.mark.skipif(os.name == "nt", reason="flock")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_a_disk_without_locks_is_not_taken_for_another_process(tmp_path, monkeypatch, number):
    import fcntl

    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with (tmp_path / "lock").open("a+") as file, pytest.raises(SceneError, match="cannot lock") as error:
        try_lock(file)
    assert error.value.cure
