import os
import subprocess
import sys
import threading
from pathlib import Path

import numba
import pytest
from progress_recorder import ProgressRecorder

from r2sego_blender.core import threads as threads_module
from r2sego_blender.core.progress import SILENT
from r2sego_blender.core.resources import available_cores
from r2sego_blender.core.threads import in_threads, in_threads_of_kernels, kernel_callers

TASKS = Path("/proc/self/task")


def test_results_come_in_the_order_of_the_items_whoever_is_done_first():
    later = threading.Event()

    def work(item):
        if item == 0 and available_cores() > 1:
            assert later.wait(60.0)
        if item == 1:
            later.set()
        return 10 * item

    assert list(in_threads(work, range(200), SILENT, "Tens")) == [10 * item for item in range(200)]
    assert list(in_threads(work, [], SILENT, "None")) == []


def test_an_error_ends_it_and_what_has_not_begun_never_does():
    begun = []

    def work(item):
        begun.append(item)
        if item == 3:
            raise ValueError("three")
        threading.Event().wait(0.01)
        return item

    results = in_threads(work, range(10_000), SILENT, "Some")
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(results)
    assert len(begun) < 5_000


def test_who_takes_no_more_waits_for_what_has_begun_alone():
    begun = []

    def work(item):
        begun.append(item)
        threading.Event().wait(0.01)
        return item

    results = in_threads(work, range(10_000), SILENT, "Some")
    assert next(results) == 0
    results.close()
    assert len(begun) < 5_000


def test_each_item_is_a_unit_of_progress():
    progress = ProgressRecorder()
    assert list(in_threads(str, range(5), progress, "Five")) == ["0", "1", "2", "3", "4"]
    assert [(task.title, task.total, task.done) for task in progress.tasks] == [("Five", 5, 5)]


@pytest.mark.parametrize(
    ("cores", "count", "at_a_time", "expected"),
    [
        (2, 3, 0, [1, 1, 2]),  # the last one has no other beside it
        (2, 4, 0, [1, 1, 1, 1]),
        (2, 1, 0, [2]),
        (2, 3, 1, [2, 2, 2]),
        (1, 3, 0, [1, 1, 1]),
        (8, 3, 0, [2, 2, 2]),
        (8, 0, 0, []),
    ],
)
def test_those_that_run_at_a_time_share_the_cores(monkeypatch, cores, count, at_a_time, expected):
    given = threading.local()
    monkeypatch.setattr(numba, "threading_layer", lambda: "omp")
    monkeypatch.setattr(numba, "get_num_threads", lambda: cores)
    monkeypatch.setattr(numba, "set_num_threads", lambda threads: setattr(given, "threads", threads))
    found = in_threads_of_kernels(lambda item: (item, given.threads), range(count), at_a_time)
    assert list(found) == list(enumerate(expected))


def test_where_numbas_threads_bear_one_caller_it_is_one_after_the_other(monkeypatch):
    monkeypatch.setattr(numba, "threading_layer", lambda: threads_module._ONE_CALLER)
    at_work, most = threading.Semaphore(1), numba.get_num_threads()

    def work(item):
        assert at_work.acquire(blocking=False), "another is at work"
        threading.Event().wait(0.01)
        at_work.release()
        return item, numba.get_num_threads()

    assert kernel_callers() == 1
    assert list(in_threads_of_kernels(work, range(5))) == [(item, most) for item in range(5)]


def test_who_asked_keeps_its_threads(with_threads):
    def asked():
        before = numba.get_num_threads()
        list(in_threads_of_kernels(str, range(3)))
        return before, numba.get_num_threads()

    for count in (1, numba.config.NUMBA_NUM_THREADS):
        assert with_threads(count, asked) == (count, count)


@pytest.mark.skipif(not TASKS.is_dir(), reason="this system does not list a process's threads")
def test_a_command_has_no_thread_that_waits_for_linear_algebra():
    code = f"import {{}}os, numpy, scipy.linalg; print(len(os.listdir({str(TASKS)!r})))"
    free = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}

    def threads(first, **more):
        command = [sys.executable, "-c", code.format(first)]
        return int(subprocess.run(command, env=free | more, capture_output=True, check=True, text=True).stdout)

    assert threads("r2sego_blender.commands.cli, ") == 1
    if available_cores() > 1:
        asked = threads("r2sego_blender.commands.cli, ", OPENBLAS_NUM_THREADS="2")
        assert asked == threads("", OPENBLAS_NUM_THREADS="2") > 1
