"""Workers that are programs: what they answer, and what becomes of those that break."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.core.progress import Progress
from r2sego_blender.workers.child import RUNNING
from r2sego_blender.workers.library_path import LIBRARY
from r2sego_blender.workers.processes import birth
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.program_worker import ProgramWorker
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.response import Limits, RefusedRequestError

PHOTOGRAPH = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
REQUEST = Request("depth", "stand-in", {"near_m": 0.5}, {"photograph": PHOTOGRAPH})
WHOLE = 'return Answer("Stand-in 1.2", "", {"depth": np.ones((4, 6), np.float32)})'


def depth_of(worker, limits=Limits(), **options) -> np.ndarray:
    with ask(worker, REQUEST, limits=limits, **options) as response:
        return response.array("depth", (4, 6))


def serving(body: str) -> str:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    return f'def depth(request, progress):\n{lines}\nserve({{"depth": depth}})\n'


def wait_until(true, limit_s: float) -> float:
    began_s = time.monotonic()
    while not true():
        assert time.monotonic() - began_s < limit_s
        time.sleep(0.01)
    return time.monotonic() - began_s


class Shown(Progress):
    """The tasks that were shown: title, total and how far each came."""

    def __init__(self):
        self.tasks = []

    def task(self, title, total):
        context = super().task(title, total)
        shown = self

        class Kept:
            def __enter__(self):
                self.task = context.__enter__()
                shown.tasks.append(self.task)
                return self.task

            def __exit__(self, *about):
                return context.__exit__(*about)

        return Kept()


def test_an_answer_has_its_arrays_and_where_they_are_from(worker_of):
    with ask(worker_of(), REQUEST) as response:
        assert (response.backend, response.weights) == ("Stand-in 1.2", "a" * 64)
        np.testing.assert_array_equal(
            response.array("depth", (4, 6)), 0.5 + PHOTOGRAPH[..., 0] / np.float32(255), strict=False
        )
        kept = response.file("depth")
    assert not kept.exists()


def test_a_worker_keeps_its_model_and_is_started_again_after_it_died(worker_of):
    worker, numbers = worker_of(), []
    for _ in range(2):
        with ask(worker, REQUEST) as response:
            numbers.append(response.values["process"])
    assert numbers[0] == numbers[1]
    (process,) = RUNNING
    os.kill(numbers[0], signal.SIGTERM)
    wait_until(lambda: process.poll() is not None, 10.0)  # it is no more before its parent knows of its end
    with ask(worker, REQUEST) as response:
        assert response.values["process"] != numbers[0]
    worker.close()
    assert not RUNNING


def test_progress_becomes_tasks(worker_of):
    body = "for done in range(4):\n    progress(done, 3, 'looking')\n    time.sleep(0.1)\n" + WHOLE
    shown = Shown()
    with ask(worker_of(serving(body)), REQUEST, shown):
        pass
    assert {(task.title, task.total) for task in shown.tasks} == {("looking", 3)}
    assert shown.tasks[-1].done >= 2


@pytest.mark.parametrize(
    "body",
    [
        "print('a model talks')\nprint('{\"done\": 1')\nsubprocess.run([sys.executable, '-c', 'input()'])\n" + WHOLE,
        "os.write(1, b'\\xff' * 200_000)\nos.write(2, b'x' * 2_000_000)\n" + WHOLE,
        "progress(-1, 3)\nprogress(5, 3)\nprogress(1, 1 << 62, '\\x1b[31m')\n" + WHOLE,
    ],
)
def test_what_a_model_prints_and_starts_disturbs_nothing(worker_of, body):
    assert (depth_of(worker_of(serving(body))) == 1.0).all()


def answering(outputs: str, weights: str = '""', backend: str = "x 1") -> str:
    return f'return Answer("{backend}", {weights}, {outputs})'


ONES = '{"depth": np.ones((4, 6), np.float32)}'
BREAKS = {
    "dies": ("os._exit(3)", "exit status 3"),
    "dies with status 0": ("os._exit(0)", "exit status 0"),
    "is killed": ("os.kill(os.getpid(), 9)", "signal 9|exit status"),
    "raises": ("raise RuntimeError('CUDA out of memory')", "RuntimeError: CUDA out of memory"),
    "hangs": ("time.sleep(60)", "said nothing for 1 s"),
    "talks for ever": ("while True:\n    progress(1, 2)", "no answer after 2 s"),
    "has NaN": (answering('{"depth": np.full((4, 6), np.nan, np.float32)}'), "no numbers"),
    "has an infinity": (answering('{"depth": np.full((4, 6), np.inf, np.float32)}'), "no numbers"),
    "has another size": (answering('{"depth": np.ones((6, 4), np.float32)}'), "6 x 4, not f 4 x 6"),
    "has more axes": (answering('{"depth": np.ones((1, 4, 6), np.float32)}'), "1 x 4 x 6, not f 4 x 6"),
    "has whole numbers": (answering('{"depth": np.ones((4, 6), np.int64)}'), "i8 4 x 6, not f 4 x 6"),
    "has no depth": (answering("{}"), "without depth"),
    "has too much": (answering('{"depth": np.ones((4, 600_000), np.float32)}'), "bytes"),
    "has too many files": (answering('{f"d{n}": np.ones(1) for n in range(30)}'), "files"),
    "has no backend": (answering(ONES, backend=" "), "backend"),
    "is of random weights": (answering(ONES, "RANDOM"), "random weights"),
    "has weights of no digest": (answering(ONES, '"model.pt"'), "digest"),
    "climbs": (answering('{"../depth": np.ones((4, 6), np.float32)}'), "no plain name"),
    "has a NaN among its values": (answering(ONES + ', {"a": np.nan}'), "finite"),
}


@pytest.mark.parametrize("how", BREAKS)
def test_a_worker_that_breaks_costs_one_request_and_is_named(worker_of, how):
    body, said = BREAKS[how]
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    worker = worker_of(serving(f"if not request.parameters.get('well'):\n{lines}\n{WHOLE}"))

    def works() -> bool:
        with ask(worker, Request("depth", "", {"well": True})) as response:
            return bool((response.array("depth", (4, 6)) == 1.0).all())

    assert works()
    seconds = {"hangs": (60.0, 1.0), "talks for ever": (2.0, 60.0)}.get(how, (60.0, 60.0))
    limits = Limits(*seconds, answer_bytes=1 << 20, files=20)
    began_s = time.monotonic()
    with pytest.raises(NativeError, match=said) as caught:
        depth_of(worker, limits)
    assert type(caught.value) is NativeError and caught.value.where == "stand-in"
    assert "Mend it" in str(caught.value) and "\n" not in str(caught.value)
    assert time.monotonic() - began_s < 2.0 + 2.0 or seconds == (60.0, 60.0)
    assert not RUNNING
    assert works()


def test_a_worker_that_writes_without_end_is_stopped_while_it_writes(worker_of, tmp_path):
    body = """
import threading
def depth(request, progress):
    folder = next(iter(request.files.values())).parents[1] / "response"
    with open(folder / "much", "wb") as file:
        while True:
            file.write(bytes(1 << 20))
            file.flush()
            progress(1, 2)
            time.sleep(0.005)
serve({"depth": depth})
"""
    limits = Limits(seconds=60.0, answer_bytes=8 << 20)
    with pytest.raises(NativeError, match="wrote more than"):
        depth_of(worker_of(body), limits, folder=tmp_path)
    assert (tmp_path / "response" / "much").stat().st_size < 600 << 20


@pytest.mark.parametrize(
    ("body", "kind"),
    [("raise UnusableError('no GPU', 'Buy one.')", MachineError), ("raise RefusedError('too dark')", NativeError)],
)
def test_what_a_worker_says_itself_is_told(worker_of, body, kind):
    worker = worker_of(serving(body))
    with pytest.raises(kind, match=r"no GPU\. Buy one|refused, too dark") as caught:
        depth_of(worker)
    assert len(RUNNING) == (isinstance(caught.value, RefusedRequestError))


def test_random_weights_are_let_through_where_a_test_says_so(worker_of):
    body = serving('return Answer("x 1", RANDOM, {"depth": np.ones((4, 6), np.float32)})')
    assert depth_of(worker_of(body), allow_random=True).shape == (4, 6)


def test_nothing_but_tests_lets_random_weights_through():
    allowing = [file for file in LIBRARY.rglob("*.py") if "allow_random=True" in file.read_text(encoding="utf-8")]
    assert allowing == []


def test_a_task_that_is_not_served_and_another_protocol_are_told(worker_of):
    with pytest.raises(MachineError, match="serves depth, not masks"), ask(worker_of(), Request("masks")):
        pass
    other = "import serving as s\ns.PROTOCOL = 7\n"
    with pytest.raises(NativeError, match="protocol 7, this R2S-EGO 1"):
        depth_of(
            worker_of("sys.path.insert(0, os.path.dirname(serve.__code__.co_filename))\n" + other + worker_of.depth)
        )


def test_an_error_in_the_block_ends_the_worker(worker_of):
    worker = worker_of()
    with pytest.raises(NativeError), ask(worker, REQUEST) as response:
        raise response.wrong("gave nonsense")
    assert not RUNNING


def test_a_program_that_cannot_be_started_is_named(tmp_path):
    with pytest.raises(MachineError, match="stand-in: the worker could not be started"):
        depth_of(ProgramWorker([str(tmp_path / "none")], "stand-in", "Mend it."))


ENGINE = """
import sys
from r2sego_blender.core.scratch import ScratchFolder
from r2sego_blender.workers.cancelling import cancel_at_once
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.program_worker import ProgramWorker
from r2sego_blender.workers.protocol.request import Request
cancel_at_once()
with ask(ProgramWorker([sys.executable, sys.argv[1]], "stand-in", ""), Request("depth")):
    pass
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_cancelling_takes_less_than_2_s_and_leaves_no_orphan_after_5_s(tmp_path, worker_of, number):
    """Also what the worker started goes, also where the engine had no time to say so."""
    told = tmp_path / "told"
    script = worker_of.script(
        serving(
            "import signal\n"
            "for number in (signal.SIGINT, signal.SIGTERM):\n    signal.signal(number, signal.SIG_IGN)\n"
            "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
            f"pathlib.Path({str(told)!r}).write_text(f'{{os.getpid()}} {{child.pid}} ')\n"
            "time.sleep(600)"
        )
    )
    engine = subprocess.Popen([sys.executable, "-c", ENGINE, str(script)], cwd=Path(__file__).parents[3])
    wait_until(lambda: told.is_file() and told.read_text().endswith(" "), 60.0)
    numbers = [int(word) for word in told.read_text().split()]
    assert all(map(birth, numbers))
    began_s = time.monotonic()
    engine.send_signal(number)
    engine.wait(30.0)
    ended_s = time.monotonic() - began_s
    gone_s = ended_s + wait_until(lambda: not any(map(birth, numbers)), 10.0)
    print(f"signal {number}: cancelled after {ended_s:.2f} s, nothing left after {gone_s:.2f} s")
    assert ended_s < 2.0 and gone_s < 5.0
