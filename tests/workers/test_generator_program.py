"""The door to generator programs, with programs that answer as they would."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.workers.child import RUNNING, kill_children
from r2sego_blender.workers.engine import engine_environment
from r2sego_blender.workers.generator_program import PROTOCOL, GeneratorProgram
from r2sego_blender.workers.processes import birth
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.response import Limits, RefusedRequestError

KILLED = r"ended with exit status \d+" if os.name == "nt" else "was killed by signal 9"
WHOLE = {"protocol": PROTOCOL, "backend": "Stand-in 1", "frames": 2}
CLIP = Request("clip", parameters={"frames": 2, "seed": 7})
TELL = """
import json, os, pathlib, subprocess, sys, time
folder = pathlib.Path(sys.argv[1])
def tell(folder=folder, **result):
    (folder / "result.tmp").write_text(json.dumps(result))
    (folder / "result.tmp").replace(folder / "result.json")
"""
WAITING = """
loaded = 0
while True:
    loaded += 1
    tell(folder, protocol=1, backend=f"clip {loaded} of {os.getpid()}", frames=2, waits=True)
    line = sys.stdin.readline()
    if not line:
        break
    folder = pathlib.Path(line.strip())
"""


@contextlib.contextmanager
def program_of(tmp_path: Path, body: str) -> Iterator[GeneratorProgram]:
    script = tmp_path / "generator.py"
    script.write_text(TELL + body)
    with contextlib.closing(GeneratorProgram([sys.executable, str(script)], "generator.py", "Mend it.")) as program:
        yield program


def answer(program: GeneratorProgram, folder: Path, limits: Limits = Limits()) -> dict:
    """What a program told of a clip; its own folder is "request" in ``folder``."""
    with ask(program, CLIP, limits=limits, folder=folder) as response:
        assert response.weights == ""
        return {"protocol": PROTOCOL, "backend": response.backend, "frames": response.values["frames"]}


def folder_of(tmp_path: Path, name: str = "clip") -> Path:
    (tmp_path / name).mkdir()
    return tmp_path / name


def wait_until(true, limit_s: float = 60.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def test_an_answer_is_what_the_program_left(tmp_path):
    with program_of(tmp_path, f"tell(**{WHOLE})") as program:
        assert answer(program, folder_of(tmp_path)) == WHOLE
        assert not RUNNING


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python knows no PYTHONSAFEPATH")
def test_a_program_finds_its_modules_where_the_add_on_started_the_engine(tmp_path, monkeypatch):
    for name, value in engine_environment().items():
        monkeypatch.setenv(name, value)
    (tmp_path / "model_of_ours.py").write_text("NAME = 'Stand-in 1'\n")
    body = "import model_of_ours\ntell(protocol=1, backend=model_of_ours.NAME, frames=2)"
    with program_of(tmp_path, body) as program:
        assert answer(program, folder_of(tmp_path)) == WHOLE


def test_a_program_that_waits_is_started_once(tmp_path):
    with program_of(tmp_path, WAITING) as program:
        first = answer(program, folder_of(tmp_path, "a"))["backend"]
        second = answer(program, folder_of(tmp_path, "b"))["backend"]
        number = int(first.split()[-1])
        assert (first, second) == (f"clip 1 of {number}", f"clip 2 of {number}")
        os.kill(number, signal.SIGTERM)  # Windows has no other
        wait_until(lambda: not birth(number))
        third = answer(program, folder_of(tmp_path, "c"))["backend"]
        assert third.startswith("clip 1 of ")
        number = int(third.split()[-1])
    assert not birth(number)


@pytest.mark.parametrize(
    ("body", "kind", "said"),
    [
        (
            "print('out of memory'); sys.exit(1)",
            NativeError,
            r"^generator\.py: the generator ended with exit status 1\. Mend it\. Its last words: out of m",
        ),
        (f"tell(**{WHOLE}); sys.exit(3)", NativeError, r"ended with exit status 3"),
        ("os.kill(os.getpid(), 9)", NativeError, rf"{KILLED}\. Mend it\."),
        ("", NativeError, r"left no result\.json that can be read\. Mend it\."),
        ("(folder / 'result.json').write_text('{')", NativeError, r"left no result\.json that can be read"),
        ("(folder / 'result.json').write_text('[]')", NativeError, r"left no result\.json that can be read"),
        ("tell(protocol=1, frames=2)", NativeError, r"the result\.json of the generator lacks backend"),
        ("tell(protocol=7, backend='x', frames=2)", NativeError, r"follows protocol 7\. This R2S-EGO"),
        (
            "tell(protocol=1, error='no weights', cure='Fetch them.')",
            MachineError,
            r"^generator\.py: no weights\. Fetch them\.$",
        ),
        ("tell(protocol=1, error='no GPU'); sys.exit(1)", MachineError, r"no GPU\. Mend it\.$"),
        (
            "tell(protocol=1, refused='nothing to see')",
            RefusedRequestError,
            r"^generator\.py: the generator refused, nothing to see\.$",
        ),
        ("time.sleep(60)", NativeError, r"had no answer after 1 s"),
    ],
)
def test_what_goes_wrong_is_told_in_a_line(tmp_path, body, kind, said):
    limits = Limits(seconds=1.0) if "sleep" in body else Limits()
    with program_of(tmp_path, body) as program:
        with pytest.raises(kind, match=said) as caught:
            answer(program, folder_of(tmp_path), limits)
        assert type(caught.value) is kind and "\n" not in str(caught.value)
        assert not RUNNING


def test_a_program_that_waits_reads_any_folder_in_a_system_of_few_letters(tmp_path, monkeypatch):
    for name, value in {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}.items():
        monkeypatch.setenv(name, value)
    with program_of(tmp_path, WAITING) as program:
        answer(program, folder_of(tmp_path, "a"))
        assert answer(program, folder_of(tmp_path, "Größe 部屋"))["backend"].startswith("clip 2 of ")


def test_a_program_that_refused_still_waits(tmp_path):
    body = "tell(protocol=1, refused='too dark', waits=True)\nfolder = pathlib.Path(input())\n" + WAITING
    with program_of(tmp_path, body) as program:
        with pytest.raises(RefusedRequestError, match="too dark"):
            answer(program, folder_of(tmp_path, "a"))
        assert len(RUNNING) == 1
        assert answer(program, folder_of(tmp_path, "b"))["backend"].startswith("clip 1 of ")


def test_cancelling_kills_the_program_and_what_it_started(tmp_path):
    body = """
inner = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
(folder / "inner").write_text(str(inner.pid))
inner.wait()
"""
    folder = folder_of(tmp_path)
    errors = []
    with program_of(tmp_path, body) as program:

        def ask():
            try:
                answer(program, folder)
            except NativeError as error:
                errors.append(str(error))

        thread = threading.Thread(target=ask)
        thread.start()
        wait_until(lambda: (folder / "request" / "inner").is_file() and (folder / "request" / "inner").read_text())
        outer, inner = next(iter(RUNNING)).pid, int((folder / "request" / "inner").read_text())
        assert birth(outer) and birth(inner)
        began_s = time.monotonic()
        kill_children()
        thread.join(2.0)
        wait_until(lambda: not birth(outer) and not birth(inner), 10.0)
        assert time.monotonic() - began_s < 10.0  # two seconds on a free machine
    assert len(errors) == 1 and re.search(KILLED, errors[0])


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no such signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_cancelled_command_leaves_no_generator_behind(tmp_path, number):
    folder = folder_of(tmp_path)
    script = tmp_path / "generator.py"
    script.write_text(TELL + "(folder / 'began').write_text(str(os.getpid()))\ntime.sleep(60)\n")
    command = f"""
from pathlib import Path
from r2sego_blender.workers.cancelling import cancel_at_once
from r2sego_blender.workers.generator_program import GeneratorProgram
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.request import Request
cancel_at_once()
program = GeneratorProgram([{sys.executable!r}, {str(script)!r}], "my", "")
with ask(program, Request("clip"), folder=Path({str(folder)!r})):
    pass
"""
    engine = subprocess.Popen([sys.executable, "-c", command], stderr=subprocess.PIPE)
    wait_until(lambda: (folder / "request" / "began").is_file() and (folder / "request" / "began").read_text(), 60.0)
    generator = int((folder / "request" / "began").read_text())
    assert birth(generator)
    engine.send_signal(number)
    _, said = engine.communicate(timeout=30.0)
    assert engine.returncode == 128 + number and b"cancelled" in said
    wait_until(lambda: not birth(generator), 10.0)


def test_a_program_that_cannot_be_started_is_named(tmp_path):
    with pytest.raises(MachineError, match=r"my: the generator could not be started: .*\. Mend it\."):
        answer(GeneratorProgram([str(tmp_path / "none")], "my", "Mend it."), folder_of(tmp_path))


def test_a_program_finds_what_it_is_asked_as_documented(tmp_path):
    with program_of(tmp_path, f"tell(**{WHOLE})") as program:
        answer(program, folder_of(tmp_path))
    asked = json.loads((tmp_path / "clip" / "request" / "request.json").read_text())
    assert (asked["protocol"], asked["frames"], asked["seed"]) == (PROTOCOL, 2, 7)


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_images_that_are_links_are_none(tmp_path):
    """A link to a device would never end; one to another's file is not the program's to show."""
    body = """
(folder / "frames").mkdir()
(folder / "frames" / "000.png").symlink_to("/dev/zero")
(folder / "frames" / "001.png").write_bytes(b"x")
(folder / "confidence").symlink_to(folder / "frames")
"""
    with (
        program_of(tmp_path, body + f"tell(**{WHOLE})") as program,
        ask(program, CLIP, folder=folder_of(tmp_path)) as response,
    ):
        assert set(response.files) == {"frames/001.png"}
