"""Whether a session runs a study is seen from another process, and forgotten with the session."""

import subprocess
import sys
import threading

import pytest

from r2sego_blender.core.errors import TrialError
from r2sego_blender.core.file_locks import try_lock
from r2sego_blender.trials.running.session_lock import alone, is_run

_HOLDS = """
import sys
from pathlib import Path
from r2sego_blender.trials.running.session_lock import alone
with alone(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_session_is_seen_until_it_is_killed(tmp_path):
    assert not is_run(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-c", _HOLDS, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout.readline() == b"held\n"
        assert is_run(tmp_path) and is_run(tmp_path)
        with pytest.raises(TrialError), alone(tmp_path):
            pass
        holder.kill()
    assert not is_run(tmp_path)
    with alone(tmp_path):
        assert is_run(tmp_path)
    assert not is_run(tmp_path)


def test_a_session_starts_while_somebody_looks_whether_one_runs(tmp_path):
    with alone(tmp_path):
        (lock,) = (tmp_path / "records").iterdir()
    looks = lock.open("rb")
    assert try_lock(looks)
    threading.Timer(0.1, looks.close).start()
    with alone(tmp_path):
        assert is_run(tmp_path)
