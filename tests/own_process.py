"""Tests marked ``own_process`` run in a process beside the one that collected them.

What aborts there, as Blender does without EGL, is the failure of one test and says which. The file's
other tests go on in a new process; until then all share one, and so the fixtures of their module.
"""

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

ASKED = "R2SEGO_TESTS_ASKED"
"""Set in the process beside: which test to run comes by stdin, what came of it goes to stdout."""

LIMIT_S = 900.0
"""A test that takes longer never ends."""

_TOLD_LINES = 25  # of what a dead process had said


def pytest_configure(config):
    config.pluginmanager.register(Asked(config) if os.environ.get(ASKED) else Asking(config))


class Asking:
    """In the process that collected: every marked test's reports come from the process beside."""

    def __init__(self, config):
        self._config = config
        self._beside = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item, nextitem):
        if item.get_closest_marker("own_process") is None:
            return None
        hook = item.ihook
        hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        follows = nextitem is not None and nextitem.path == item.path
        for report in self._reports(item, nextitem.nodeid if follows else None):
            hook.pytest_runtest_logreport(report=report)
        hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        if not follows:
            self.pytest_unconfigure()
        return True

    def pytest_unconfigure(self):
        if self._beside is not None:
            self._beside.close()
            self._beside = None

    def _reports(self, item, follows):
        if self._beside is None:
            self._beside = Beside(item)
        try:
            for data in self._beside.run(item.nodeid, follows):
                yield self._config.hook.pytest_report_from_serializable(config=self._config, data=data)
        except ProcessDiedError as died:
            self.pytest_unconfigure()
            yield pytest.TestReport(
                item.nodeid, item.location, dict.fromkeys(item.keywords, 1), "failed", f"{item.nodeid}: {died}", "call"
            )


class ProcessDiedError(Exception):
    pass


class Beside:
    """A pytest of one file that runs the tests it is asked for."""

    def __init__(self, item):
        self._folder = tempfile.TemporaryDirectory(prefix="r2sego-beside-", ignore_cleanup_errors=True)
        self._log = Path(self._folder.name, "log")
        own = ("PYTEST_ADDOPTS", "PYTEST_CURRENT_TEST")  # of the run that asks
        environment = {
            name: value for name, value in os.environ.items() if name not in own and not name.startswith("PYTEST_XDIST")
        }
        options = [f"--rootdir={item.config.rootpath}", f"--basetemp={Path(self._folder.name, 'tests')}"]
        if item.config.inipath:
            options += ["-c", str(item.config.inipath)]
        # Without pytest's capture all that is said is in the log, even that of a process that dies.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-s", *options, str(item.path)],
            env=environment | {ASKED: "1"},
            cwd=item.config.invocation_params.dir,
            encoding="utf-8",
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log.open("wb"),
        )
        self._lines = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout:
            if line.startswith("{"):  # pytest speaks there until it is configured
                self._lines.put(json.loads(line))
        self._lines.put(None)

    def run(self, nodeid, follows):
        """The reports of one test, as data. Raises ProcessDiedError."""
        with contextlib.suppress(OSError):  # then there is no answer either
            self._process.stdin.write(json.dumps({"run": nodeid, "follows": follows}) + "\n")
            self._process.stdin.flush()
        while True:
            try:
                said = self._lines.get(timeout=LIMIT_S)
            except queue.Empty:
                self._process.kill()
                raise self._died(f"did not end within {LIMIT_S:.0f} s") from None
            if said is None:
                raise self._died(f"ended in the midst of it, {_of(self._process.wait())}")
            if said.get("done"):
                return
            yield said["report"]

    def _died(self, how):
        lines = self._log.read_text(encoding="utf-8", errors="replace").splitlines()[-_TOLD_LINES:]
        return ProcessDiedError("\n".join([f"the process of this test {how}; it said last:", *lines]))

    def close(self):
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=60.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        self._process.stdout.close()
        self._folder.cleanup()


def _of(status):
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"


class Asked:
    """In the process beside: run what is asked for, until nobody asks any more."""

    def __init__(self, config):
        self._config = config
        self._told = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)  # what tests and Blender print goes to the log

    def pytest_runtestloop(self, session):
        items = {item.nodeid: item for item in session.items}
        for line in sys.stdin:
            asked = json.loads(line)
            item, follows = items[asked["run"]], items.get(asked["follows"])
            self._config.hook.pytest_runtest_protocol(item=item, nextitem=follows)
            self._tell(done=True)
        return True

    def pytest_runtest_logreport(self, report):
        data = self._config.hook.pytest_report_to_serializable(config=self._config, report=report)
        self._tell(report=data)

    def _tell(self, **said):
        self._told.write(json.dumps(said) + "\n")
        self._told.flush()
