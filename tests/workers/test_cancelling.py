"""Commands end at once when they are told to, leave nothing, and say what is kept."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bundles import new_bundle

from r2sego_blender.bundle.scene import Scene

ROOT = Path(__file__).parents[2]
ROOM = ROOT / "demo" / "room"


@pytest.fixture
def scene(tmp_path) -> Scene:
    return new_bundle(tmp_path / "room.r2s")


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None)])
def test_a_signal_ends_a_run_in_the_midst_of_it_and_leaves_nothing(tmp_path, number):
    target, temporary = tmp_path / "a.r2s", tmp_path / "temporary"
    temporary.mkdir()
    arguments = ["new", target, "--captures", ROOM / "captures", "--poses", ROOM / "cameras.json"]
    command = [sys.executable, "-m", "r2sego_blender", *map(str, arguments)]
    variables = {**os.environ, "TMPDIR": str(temporary)}
    process = subprocess.Popen(command, stderr=subprocess.PIPE, cwd=ROOT, env=variables)
    while not list(temporary.glob("r2sego-*/*")):  # it waits for a native call
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode == 128 + number
    assert said.decode().splitlines()[-1] == "r2sego: cancelled"
    assert [file.name for file in tmp_path.iterdir()] == ["temporary"]
    assert not list(temporary.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("hangs_up", [True, False])
def test_a_cancelled_refine_says_that_steps_are_kept_even_to_a_closed_terminal(scene, hangs_up):
    refining = (
        "import sys, time, r2sego_blender.pipeline as pipeline\n"
        "pipeline.refine = lambda *_: (print('begun', file=sys.stderr, flush=True), time.sleep(60))\n"
        "from r2sego_blender.commands.cli import main; main()\n"
    )
    process = subprocess.Popen([sys.executable, "-c", refining, "refine", scene.path], stderr=subprocess.PIPE, cwd=ROOT)
    assert process.stderr.readline() == b"begun\n"
    if hangs_up:
        process.stderr.close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=30) == 128 + signal.SIGTERM
    if not hangs_up:
        assert process.stderr.read().strip() == b"r2sego: cancelled; finished steps are kept"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGBREAK"])
def test_a_command_ends_on_every_way_of_interrupting_it(name):
    if not hasattr(signal, name):
        pytest.skip("Windows has it")
    interrupted = (
        "import signal, time, r2sego_blender.results.doctor as doctor\n"
        f"doctor.examine = lambda: (signal.raise_signal(signal.{name}), time.sleep(60))\n"
        "from r2sego_blender.commands.cli import main; main(['doctor'])\n"
    )
    command = [sys.executable, "-c", interrupted]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=50)
    assert (done.returncode, done.stderr.strip()) == (128 + getattr(signal, name), "r2sego: cancelled")


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals")
def test_a_run_that_is_cancelled_behind_its_bar_leaves_the_terminal_as_it_was():
    import pty

    working = (
        "import sys, time, r2sego_blender.results.doctor as doctor\n"
        "from r2sego_blender.core.progress import TerminalProgress\n"
        "def examine():\n"
        "    with TerminalProgress().task('Dense stereo', 3): time.sleep(60)\n"
        "doctor.examine = examine\n"
        "from r2sego_blender.commands.cli import main; main(['doctor'])\n"
    )
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", working]
    variables = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen(command, stderr=theirs, cwd=ROOT, env=variables)
    os.close(theirs)
    said = b""
    while b"0:00:01" not in said:
        said += os.read(ours, 4096)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 128 + signal.SIGINT
    said += os.read(ours, 65536)
    os.close(ours)
    assert b"r2sego: cancelled" in said
    assert said.rindex(b"\x1b[?25h") > said.rindex(b"\x1b[?25l"), "the cursor is hidden"


@pytest.mark.skipif(shutil.which("nohup") is None or os.name == "nt", reason="needs nohup")
def test_a_run_under_nohup_outlives_its_terminal(scene):
    waiting = (
        "import os, signal, r2sego_blender.results.status as status\n"
        "status.describe = lambda *_, **__: os.kill(os.getpid(), signal.SIGHUP)\n"
        "status.lines = lambda _: ['lives']\n"
        "from r2sego_blender.commands.cli import main; main()\n"
    )
    command = ["nohup", sys.executable, "-c", waiting, "status", scene.path]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout.strip()) == (0, "lives")


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_the_last_words_of_a_cancelled_command_are_its_own():
    """And not those of multiprocessing's tracker, which cleans up after the processes of rollouts."""
    code = (
        "import os, signal, time\n"
        "from r2sego_blender.robot.rollouts.spawning import SpawnContext\n"
        "from r2sego_blender.workers.cancelling import cancel_at_once\n"
        "cancel_at_once()\n"
        "kept = SpawnContext().Semaphore()\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "time.sleep(60)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=50)
    assert done.returncode == 128 + signal.SIGINT
    assert done.stderr.split("\n") == ["", "r2sego: cancelled", ""]
