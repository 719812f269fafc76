"""A Blender that stays: it answers, tells its errors, and never outlives who asked."""

import os
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from room_meshes import observed_proxy

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError, MachineError, NativeError
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.workers.blender_renderer import BlenderWorker
from r2sego_blender.workers.child import RUNNING, kill_children

ROOT = Path(__file__).parents[2]
CAMERA = Camera(32, 24, 30.0, 30.0, 16.0, 12.0, look_at((0.0, -2.0, 1.0), (0.0, 0.0, 0.0)))
linux = pytest.mark.skipif(sys.platform != "linux", reason="looks processes up in /proc")


def ground(height_m: float = 0.0) -> GeometryProxy:
    """One square of the ground."""
    corners = [[-9, -9, height_m], [9, -9, height_m], [9, 9, height_m], [-9, 9, height_m]]
    return observed_proxy(corners, [[0, 1, 2], [0, 2, 3]])


@pytest.fixture(scope="module")
def proxy_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("proxy") / "proxy.npz"
    ground().save(file)
    return file


@pytest.fixture
def blender():
    """A worker of pip bpy, or of the Blender that R2SEGO_TEST_BLENDER names."""
    program = os.environ.get("R2SEGO_TEST_BLENDER", "")
    if not program:
        pytest.importorskip("bpy", reason="pip bpy is not installed")
    worker = BlenderWorker(program)
    yield worker
    worker.close()
    assert worker.process_id is None
    assert not RUNNING


@pytest.fixture
def stand_in(tmp_path):
    """A worker of a program whose Python body runs in Blender's place."""
    if os.name == "nt":
        pytest.skip("the stand-in is a script with a #! line")
    started = []

    def make(body: str, frame_limit_s: float = 20.0) -> BlenderWorker:
        program = tmp_path / "blender"
        ready = "print('Blender 4.5.15 (hash)'); print(json.dumps({'ready': 1, 'blender': '4.5.15'}))"
        program.write_text(f"#!{sys.executable} -u\nimport json, os, sys, time\n{ready}\n{body}\nsys.stdin.read()\n")
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        started.append(BlenderWorker(str(program), frame_limit_s))
        return started[-1]

    yield make
    for worker in started:
        worker.close()


def gone(pid: int) -> bool:
    stat_file = Path(f"/proc/{pid}/stat")
    return not stat_file.exists() or stat_file.read_text().rpartition(")")[2].split()[0] == "Z"


def gone_within(pid: int, seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and not gone(pid):
        time.sleep(0.02)
    return gone(pid)


def test_one_process_renders_one_proxy_after_the_other(blender, tmp_path):
    pytest.importorskip("OpenEXR", reason="OpenEXR is not installed")
    from r2sego_blender.generation.conditions.blender_conditions import BlenderRenderer
    from r2sego_blender.generation.conditions.conditions import ZBufferRenderer

    path = [CAMERA, CAMERA.scaled(0.5)]
    pids = set()
    for height_m in (0.0, 0.4):
        renderer = BlenderRenderer(ground(height_m), "cycles", blender)
        for found, wanted in zip(renderer.render(path), ZBufferRenderer(ground(height_m)).render(path), strict=True):
            # At this flat angle a thousandth of a pixel is so much.
            np.testing.assert_allclose(found.depth, wanted.depth, rtol=3e-4)
            np.testing.assert_array_equal(found.validity, wanted.validity)
        pids.add(blender.process_id)
    assert len(pids) == 1
    assert renderer.name == f"Cycles {blender.version}"


def test_an_error_in_blender_is_an_error_here_and_it_goes_on(blender, proxy_file, tmp_path):
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(b"no proxy")
    with pytest.raises(GeometryError, match=r"damaged\.npz"):
        blender.render(damaged, [CAMERA], "cycles", tmp_path / "a")
    pid = blender.process_id
    with pytest.raises(NativeError, match="KeyError"):
        blender.render(proxy_file, [CAMERA], "no engine", tmp_path / "b")
    frames = []
    files = blender.render(proxy_file, [CAMERA] * 3, "cycles", tmp_path / "c", frames.append)
    assert [file.name for file in files] == ["000.exr", "001.exr", "002.exr"]
    assert sorted(set(frames)) == [0, 1, 2]
    assert blender.process_id == pid


@linux
def test_cancelling_ends_a_render_under_way_and_the_next_starts_anew(blender, proxy_file, tmp_path):
    big = CAMERA.scaled(60)
    pid = 0

    def cancel(frame: int) -> None:
        nonlocal pid
        pid = blender.process_id
        threading.Timer(0.3, kill_children).start()

    with pytest.raises(NativeError, match="ended without a result"):
        blender.render(proxy_file, [big] * 50, "cycles", tmp_path / "a", cancel)
    assert gone_within(pid, 2.0)
    assert len(blender.render(proxy_file, [CAMERA], "cycles", tmp_path / "b")) == 1
    assert blender.process_id != pid


@linux
@pytest.mark.parametrize("busy", [False, True], ids=["while it waits", "while it renders"])
def test_it_ends_with_its_parent(proxy_file, tmp_path, busy):
    pytest.importorskip("bpy", reason="pip bpy is not installed")
    code = (
        "import sys, time; from pathlib import Path; sys.path[:0] = ['tests/workers', 'tests/rooms']\n"
        "from test_blender_renderer import CAMERA; from r2sego_blender.workers.blender_renderer import *\n"
        "worker = BlenderWorker(); worker.version; print(worker.process_id, flush=True)\n"
        f"tell = lambda frame: print('frame', flush=True)\n"
        f"if {busy}: worker.render(Path({str(proxy_file)!r}), [CAMERA.scaled(60)] * 99, 'cycles',"
        f" Path({str(tmp_path)!r}), tell)\n"
        "time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    pid = int(parent.stdout.readline())
    if busy:
        assert parent.stdout.readline() == "frame\n"
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    assert gone_within(pid, 10.0)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("time.sleep(60)", "silent"),
        ("print('libEGL is missing', file=sys.stderr); sys.exit(3)", "exit status 3.*libEGL is missing"),
        ("os.abort()", "ended without a result"),
        ("print(json.dumps({'done': True}))", "no complete result"),
    ],
    ids=["hung", "dead", "aborted", "nothing written"],
)
def test_a_blender_that_gives_nothing_is_told(stand_in, proxy_file, tmp_path, body, words):
    worker = stand_in(f"sys.stdin.readline(); {body}", frame_limit_s=1.0)
    with pytest.raises(NativeError, match=words):
        worker.render(proxy_file, [CAMERA], "cycles", tmp_path / "out")


def test_what_blender_prints_does_not_disturb(stand_in):
    assert stand_in("print('Fra:1'); print('[1]'); sys.stderr.write('x' * 300000)").version == "4.5.15"


def test_another_protocol_is_refused(stand_in):
    worker = stand_in("")
    program = Path(worker._blender)
    program.write_text(program.read_text().replace("'ready': 1", "'ready': 99"))
    with pytest.raises(MachineError, match="protocol"):
        _ = worker.version
    assert worker.process_id is None


@pytest.mark.parametrize("blender", ["/no/such/blender", "bin/blender"])
def test_a_blender_that_is_not_there_is_told(blender):
    with pytest.raises(MachineError, match="R2SEGO_BLENDER"):
        _ = BlenderWorker(blender).version


def test_settings_choose_the_renderer(monkeypatch):
    from r2sego_blender.generation.conditions.renderers import make_renderer

    assert make_renderer(ground(), GenerationSettings()).name == "z-buffer"
    monkeypatch.setenv("R2SEGO_BLENDER", "/no/such/blender")
    with pytest.raises(MachineError, match="/no/such/blender"):
        make_renderer(ground(), GenerationSettings(renderer="eevee"))
