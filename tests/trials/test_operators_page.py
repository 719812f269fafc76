"""What docs/trials.md has a newcomer type leads to a judged trial, as it stands there."""

import contextlib
import os
import re
import select
import signal
import sys
import time
from pathlib import Path

import pytest

from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.records.index import RecordIndex

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="needs terminals")]

ROOT = Path(__file__).parents[2]
_LIMIT_S = 60.0


class Terminal:
    """A shell at a terminal of its own; ``wait`` reads on until a pattern comes."""

    def __init__(self, folder, environment):
        import pty

        self._pid, self._end = pty.fork()
        if self._pid == 0:
            os.chdir(folder)
            os.execvpe("sh", ["sh"], environment)
        self._unread = ""

    def type(self, text):
        os.write(self._end, text.encode())

    def wait(self, pattern):
        until_s = time.monotonic() + _LIMIT_S
        while not (found := re.search(pattern, self._unread)):
            assert time.monotonic() < until_s, f"waited for {pattern} in {self._unread[-2000:]}"
            if select.select([self._end], [], [], 0.1)[0]:
                self._unread += os.read(self._end, 1 << 16).decode(errors="replace")
        self._unread = self._unread[found.end() :]
        return found

    def close(self):
        """Ctrl-C for what runs there, then the shell's end."""
        self.type("\x03")
        self.type("exit\n")
        until_s = time.monotonic() + 10.0
        while os.waitpid(self._pid, os.WNOHANG) == (0, 0):
            if time.monotonic() > until_s:
                os.kill(self._pid, signal.SIGKILL)
            if select.select([self._end], [], [], 0.1)[0]:
                with contextlib.suppress(OSError):  # Linux says so where nobody is left
                    os.read(self._end, 1 << 16)
        os.close(self._end)


@pytest.fixture
def terminal(tmp_path):
    """Opens terminals in which ``r2sego`` is this checkout's."""
    program = tmp_path / ".venv" / "bin" / "r2sego"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m r2sego_blender "$@"\n')
    program.chmod(0o755)
    program.with_name("activate").write_text("true\n")
    environment = {**os.environ, "PATH": f"{program.parent}:{os.environ['PATH']}", "PS1": "$ ", "COLUMNS": "160"}
    opened = []

    def open_terminal(folder):
        opened.append(Terminal(folder, environment))
        return opened[-1]

    yield open_terminal
    for one in opened:
        one.close()


def test_the_first_judged_trial(terminal, tmp_path):
    page = (ROOT / "docs" / "trials.md").read_text(encoding="utf-8")
    section = page.split("## A first judged trial", 1)[1].split("\n## ", 1)[0]
    installed, planned, simulated, run, told = re.findall(r"```bash\n(.*?)```", section, re.DOTALL)
    assert "install" in installed
    first = terminal(tmp_path)
    first.type(planned)
    first.wait(r"page: \S+plan.html")
    first.type(simulated)
    device = first.wait(r"(/\S+/device)\s")[1]
    first.wait("playing idle")
    second = terminal(tmp_path / "try")
    stands_for = re.search(r"--device (\S+)", run)[1]
    second.type(run.replace(stands_for, device))
    for key, then in (("", "SET UP"), ("a", "ARMED"), ("s", "RUNNING")):
        second.type(key)
        second.wait(then)
    first.type("success\n")
    second.wait(r"support (3\.[2-9]|[4-9])")
    second.type("e")
    second.wait("S  U  C  C  E  S  S")
    first.type("idle\n")
    second.type("n")
    second.wait("SET UP")
    second.type("q")
    second.wait("success: 1")
    (entry,) = RecordIndex(tmp_path / "try" / "chairs.trials").entries()
    assert entry.judgement.outcome is Outcome.SUCCESS
    second.type(told)
    for line in ("trial   1  success", "record 1: success", "table3.md"):
        second.wait(line)
