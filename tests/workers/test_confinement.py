"""What a process has given up it cannot do any more, and it does the rest as before."""

import json
import subprocess
import sys

import pytest

from r2sego_blender.workers.confinement import READING, WRITING, confine
from r2sego_blender.workers.library_path import IMPORT_LIBRARY, LIBRARY

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux alone can take rights away here")

ATTEMPTS = """
import json, os, signal, socket, subprocess, sys
from pathlib import Path
from r2sego_blender.workers.confinement import bound_memory, confine
own, other = Path(sys.argv[1]), int(sys.argv[2])
not_taken = confine()
def succeeds(attempt):
    try:
        attempt()
    except (OSError, MemoryError):
        return False
    return True
def lookup():
    socket.getaddrinfo("localhost", 80)
made = {
    "write": lambda: (own / "new").write_text("x"),
    "overwrite": lambda: (own / "there").write_text("x"),
    "append": lambda: os.close(os.open(own / "there", os.O_WRONLY | os.O_APPEND)),
    "truncate": lambda: os.truncate(own / "there", 0),
    "delete": lambda: (own / "there").unlink(),
    "rename": lambda: (own / "there").rename(own / "elsewhere"),
    "link": lambda: (own / "link").symlink_to("/etc/passwd"),
    "folder": lambda: (own / "folder").mkdir(),
    "temporary": lambda: Path("/tmp/r2sego-confined").write_text("x"),
    "read": lambda: (own / "there").read_text(),
    "list": lambda: list(own.iterdir()),
    "passwords": lambda: Path("/etc/passwd").read_text(),
    "socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_STREAM),
    "datagram": lambda: socket.socket(socket.AF_INET6, socket.SOCK_DGRAM),
    "local": lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM),
    "program": lambda: subprocess.run([sys.executable, "-c", ""]),
    "kill": lambda: os.kill(other, 0),
    "by another": lambda: os.waitpid(-1, 0) if os.fork() else (own / "forked").write_text("x"),
}
could = {name: succeeds(attempt) for name, attempt in made.items()}
import numpy
could["import"] = float(numpy.ones((300, 300)).sum()) == 90000.0
not_taken += bound_memory(100_000_000)
could["50 MB"] = succeeds(lambda: bytearray(50_000_000))
could["200 MB"] = succeeds(lambda: bytearray(200_000_000))
print(json.dumps([not_taken, could]))
"""


def test_files_others_and_the_network_are_out_of_reach(tmp_path):
    (tmp_path / "there").write_text("kept")
    script = f"{IMPORT_LIBRARY}\n{ATTEMPTS}".replace("r2sego_blender.", f"{LIBRARY.name}.")
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        done = subprocess.run(
            [sys.executable, "-c", script, str(tmp_path), str(other.pid)], capture_output=True, text=True
        )
        other.stdin.close()
    assert done.returncode == 0, done.stderr
    not_taken, could = json.loads(done.stdout.splitlines()[-1])
    assert could.pop("import") and could.pop("50 MB")
    if WRITING in not_taken:
        assert READING in not_taken
        pytest.skip(f"this system cannot take away {', '.join(not_taken)}")
    assert not_taken == []
    forked = could.pop("by another")
    assert not any(could.values()), could
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"there": "kept"}, forked


def test_a_system_that_can_take_nothing_says_so(monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    assert set(confine()) == {"writing files", "reading other files", "the network"}
