"""A test whose process dies, or that never ends, is a failed run at once that names it."""

import os
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

OTHERS = "import time\ndef test_short(): pass\ndef test_long(): time.sleep({long_s})\ndef test_last(): pass\n"
WITHIN_S = 60.0


@pytest.fixture
def run(tmp_path):
    """``run({file: source}, *options)``: what a small run of tests with our plugins says; its status."""

    def go(files, *options):
        (tmp_path / "conftest.py").write_text(
            "import dead_workers, own_process\n"
            "def pytest_configure(config):\n"
            "    for part in (dead_workers, own_process): part.pytest_configure(config)\n"
        )
        (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = own_process\n")
        for name, source in files.items():
            (tmp_path / name).write_text(textwrap.dedent(source))
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *options, str(tmp_path)],
            env=environment | {"PYTHONPATH": os.pathsep.join((str(Path(__file__).parent), str(tmp_path)))},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=4 * WITHIN_S,
        )
        return done.stdout, done.returncode

    return go


def spread(*options):
    """The options of ``make test``, with two workers."""
    return "-n", "2", "--dist", "loadfile", "--no-loadscope-reorder", *options


@pytest.mark.parametrize(
    "dying",
    [
        "import os\ndef test_fine(): pass\ndef test_dies(): os.abort()\ndef test_after(): pass\n",
        "import os, pytest\n@pytest.fixture\ndef broken(): os._exit(0)\ndef test_dies(broken): pass\n",
    ],
    ids=["aborts", "exits in its fixture"],
)
def test_a_dead_worker_ends_the_run_and_its_test_is_named(run, dying):
    """However much the other worker has still to do, and however many files wait."""
    others = {f"test_other_{index}.py": OTHERS.format(long_s=300) for index in range(4)}
    started_s = time.monotonic()
    said, status = run({"test_a.py": dying} | others, *spread())
    assert time.monotonic() - started_s < WITHIN_S
    assert status == 1
    assert "FAILED test_a.py::test_dies - worker 'gw" in said
    assert "a test worker died in test_a.py::test_dies" in said


LATE_NEWS = """
    import time
    import pytest
    from xdist.workermanage import Marker, WorkerController

    told = WorkerController.process_from_remote

    def told_late(self, eventcall):
        if eventcall is Marker.END: time.sleep(3)
        told(self, eventcall)

    WorkerController.process_from_remote = told_late

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logreport(report):
        if "test_fine" in report.nodeid and report.when == "teardown" and hasattr(report, "node"):
            report.node.gateway._io.popen.wait(60)
"""


def test_work_sent_to_a_worker_that_is_dead_already_ends_the_run_alike(run):
    """xdist has more to send, the pipe is broken, and the worker's end is told later."""
    dies = "import os\ndef test_fine(): pass\ndef test_dies(): os.abort()\ndef test_after(): pass\n"
    others = {f"test_other_{index}.py": OTHERS.format(long_s=300) for index in range(4)}
    said, status = run({"late_news.py": LATE_NEWS, "test_a.py": dies} | others, *spread("-p", "late_news"))
    assert status == 1
    assert "a test worker died in test_a.py::test_dies" in said


def test_a_test_that_never_ends_is_ended_and_named(run):
    """With the setting of pyproject.toml, here shorter."""
    limits = ("-o", "faulthandler_timeout=3", "-o", "faulthandler_exit_on_timeout=true")
    hangs = "import time\ndef test_hangs(): time.sleep(300)\n"
    said, status = run({"test_a.py": hangs, "test_b.py": OTHERS.format(long_s=300)}, *spread(*limits))
    assert status == 1
    assert "a test worker died in test_" in said  # the one that began first


def test_a_worker_that_dies_before_its_first_test_is_no_success(run):
    """xdist knows no test to blame then."""
    dies = "import os\nif os.environ.get('PYTEST_XDIST_WORKER') == 'gw0': os.abort()\ndef test_fine(): pass\n"
    said, status = run({"test_a.py": dies, "test_b.py": OTHERS.format(long_s=0)}, *spread())
    assert status == 1
    assert "worker gw0 crashed" in said


ABORTS = """
    import os, signal, sys, time
    import pytest

    pytestmark = pytest.mark.own_process

    @pytest.fixture(scope="module")
    def process():
        yield os.getpid()
        print("the module is left", file=sys.stderr, flush=True)

    def test_before(process): assert process == os.getpid() != int(os.environ["RUN"])
    @pytest.mark.parametrize("how", ["abort", "kill"])
    def test_dies(how):
        print("Couldn't open libEGL.so.1", flush=True)
        os.abort() if how == "abort" else os.kill(os.getpid(), signal.SIGKILL)
    def test_fails(process): assert process == "another"
    def test_is_skipped(): pytest.skip("not here")
    def test_after(process, capfd, tmp_path):
        os.write(1, b"heard")
        assert capfd.readouterr().out == "heard" and tmp_path.is_dir()
"""


@pytest.mark.skipif(os.name == "nt", reason="names signals")
@pytest.mark.parametrize("options", [(), spread()], ids=["alone", "spread"])
def test_a_death_in_a_process_of_its_own_fails_one_test_only(run, options, monkeypatch):
    monkeypatch.setenv("RUN", str(os.getpid()))
    said, status = run({"test_a.py": ABORTS, "test_b.py": OTHERS.format(long_s=0)}, *options)
    assert status == 1
    assert "3 failed, 5 passed, 1 skipped" in said
    for how, name in (("abort", "SIGABRT"), ("kill", "SIGKILL")):
        assert f"test_a.py::test_dies[{how}]: the process of this test ended in the midst of it, signal {name}" in said
    assert "Couldn't open libEGL.so.1" in said  # what it said last
    assert "FAILED test_a.py::test_fails - " in said


def test_a_test_that_never_ends_in_its_own_process_is_ended(run):
    files = {
        "test_a.py": "import time, pytest, own_process\nown_process.LIMIT_S = 5.0\n"
        "@pytest.mark.own_process\ndef test_hangs(): time.sleep(300)\n"
    }
    said, status = run(files)
    assert status == 1 and "test_a.py::test_hangs: the process of this test did not end within 5 s" in said
