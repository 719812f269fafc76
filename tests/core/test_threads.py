import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from progress_recorder import ProgressRecorder

from r2sego_blender.core.progress import SILENT
from r2sego_blender.core.resources import available_cores
from r2sego_blender.core.threads import in_threads

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
