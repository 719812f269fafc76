"""A native call succeeds only with exit 0 and a complete manifest."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

import r2sego_blender
from r2sego_blender.core.errors import CaptureError, NativeError
from r2sego_blender.geometry.collision import coacd_regions
from r2sego_blender.workers import child, library_path
from r2sego_blender.workers.processes import birth


def double(request: dict) -> dict:
    return {"value": 2 * request["value"]}


def leave(request: dict) -> dict:
    os._exit(0)


def abort(request: dict) -> dict:
    os.abort()


def crash(request: dict) -> dict:
    raise ZeroDivisionError("last words")


def refuse(request: dict) -> dict:
    raise CaptureError("no images", where="a/b", cure="Add some.")


def hang(request: dict) -> dict:
    time.sleep(60)


def hang_at(request: dict) -> dict:
    Path(request["told"]).write_text(str(os.getpid()))
    time.sleep(60)


def leave_files(request: dict) -> dict:
    Path(request["told"]).write_text(tempfile.mkdtemp())
    os.abort()


@pytest.fixture
def call(monkeypatch):
    """``call_in_child`` for this file's functions: the child imports this file by its name."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    for function in (double, leave, abort, crash, refuse, hang, hang_at, leave_files):
        monkeypatch.setattr(function, "__module__", Path(__file__).stem)
    return child.call_in_child


def test_the_result_comes_back(call):
    assert call(double, {"value": 21}) == {"value": 42}


@pytest.mark.parametrize("function", [leave, abort, crash])
def test_an_end_without_a_manifest_is_an_error_even_with_status_zero(call, function):
    with pytest.raises(NativeError, match="ended without a result"):
        call(function, {})


def test_the_last_words_are_passed_on(call):
    with pytest.raises(NativeError, match="last words"):
        call(crash, {})


def test_an_error_of_the_family_is_raised_again_as_itself(call):
    with pytest.raises(CaptureError, match="no images") as caught:
        call(refuse, {})
    assert (caught.value.where, caught.value.cure) == ("a/b", "Add some.")


def test_a_call_that_takes_too_long_is_ended(call):
    with pytest.raises(NativeError, match="longer than 1 s"):
        call(hang, {}, timeout_s=1.0)
    assert not child.RUNNING


def test_temporary_files_of_an_aborted_child_go_with_it(call, tmp_path):
    with pytest.raises(NativeError):
        call(leave_files, {"told": str(tmp_path / "told")})
    left = Path((tmp_path / "told").read_text())
    assert left.parent.name.startswith("r2sego-") and not left.parent.exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the system's doing, on Linux")
def test_a_killed_process_takes_its_native_calls_along(tmp_path):
    """As the system kills when memory runs out, or a farm's manager."""
    told = tmp_path / "told"
    asking = (
        "import sys, test_child\n"
        "from r2sego_blender.workers.child import call_in_child\n"
        "call_in_child(test_child.hang_at, {'told': sys.argv[1]})\n"
    )
    paths = {"PYTHONPATH": f"{Path(__file__).parent}{os.pathsep}{library_path.LIBRARY.parent}"}
    asks = subprocess.Popen(
        [sys.executable, "-c", asking, str(told)], env={**os.environ, **paths, "TMPDIR": str(tmp_path)}
    )
    try:
        deadline_s = time.monotonic() + 60.0
        while not told.exists() or not told.read_text():
            assert asks.poll() is None and time.monotonic() < deadline_s
            time.sleep(0.05)
        pid = int(told.read_text())
        assert birth(pid)
    finally:
        asks.kill()
        asks.wait()
    deadline_s = time.monotonic() + 10.0
    while birth(pid) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert not birth(pid)


def test_inside_blender_the_module_is_named_as_the_child_knows_it(monkeypatch):
    """The add-on's library has a longer name there."""
    monkeypatch.setattr(child, "_PACKAGE", "bl_ext.user_default.r2sego.r2sego_blender")
    monkeypatch.setattr(coacd_regions.cut, "__module__", f"{child._PACKAGE}.geometry.collision.coacd_regions")
    with pytest.raises(NativeError, match="KeyError: 'region'"):  # of a request without one, so it has run
        child.call_in_child(coacd_regions.cut, {})


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_cancelled_command_leaves_no_temporary_folder(tmp_path, number):
    temporary = tmp_path / "temporary"
    command = f"""
import pathlib, signal, sys, threading, time
sys.path.insert(0, {str(Path(__file__).parent)!r})
from r2sego_blender.workers.cancelling import cancel_at_once
from r2sego_blender.core.scratch import ScratchFolder
from r2sego_blender.workers.child import call_in_child
from test_child import hang
cancel_at_once()
def cancel():
    temporary = pathlib.Path({str(temporary)!r})
    while not list(temporary.glob("*/request.json")):
        time.sleep(0.05)
    print(len(list(temporary.iterdir())), flush=True)
    signal.raise_signal({int(number)})  # none comes from outside on Windows
threading.Thread(target=cancel).start()
with ScratchFolder() as folder:
    open(folder + "/large", "w").close()
    call_in_child(hang, {{}})
"""
    temporary.mkdir()
    paths = [str(Path(__file__).parent), str(Path(r2sego_blender.__file__).parents[1])]
    environment = os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(temporary))
    environment |= {"PYTHONPATH": os.pathsep.join(paths)}
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, env=environment, timeout=120)
    assert (done.stdout.strip(), done.returncode) == ("2", 128 + number) and "cancelled" in done.stderr
    assert list(temporary.iterdir()) == []
