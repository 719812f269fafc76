"""A native call succeeds only with exit 0 and a complete manifest."""

import json
import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

import r2sego_blender
from r2sego_blender.core.errors import CaptureError, NativeError
from r2sego_blender.workers import child, external_environment, library_path
from r2sego_blender.workers.engine import engine_environment
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


@pytest.fixture
def under_pip(tmp_path, monkeypatch) -> tuple[Path, Path]:
    """This library as pip installs it, beside a package that another environment has too: that
    folder, and the other environment's python."""
    packages, others = tmp_path / "site-packages", tmp_path / "other"
    for folder, words in ((packages, "of the engine"), (others, "of the model")):
        (folder / "model_weights").mkdir(parents=True)
        (folder / "model_weights" / "__init__.py").write_text(f"whose = {words!r}\n")
    shutil.copytree(library_path.LIBRARY, packages / "r2sego_blender", ignore=shutil.ignore_patterns("__pycache__"))
    (packages / "r2sego_blender" / "workers" / "asking.py").write_text(
        "import sys\n"
        "from ..core.errors import MachineError\n"
        "def ask(request):\n"
        "    import model_weights\n"
        "    if 'refuse' in request: raise MachineError('no GPU', where='here')\n"
        "    from .. import __file__ as place\n"
        "    return {'whose': model_weights.whose, 'place': place, 'path': sys.path}\n"
    )
    python = tmp_path / "python"
    python.write_text(
        f'#!/bin/sh\nPYTHONPATH="${{PYTHONPATH:+$PYTHONPATH:}}{others}" exec "{sys.executable}" -S "$@"\n'
    )  # -S: an interpreter that has not this one's packages
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    return packages, python


ASK = """
import json, sys
from r2sego_blender.core.errors import MachineError
from r2sego_blender.workers.asking import ask
from r2sego_blender.workers.child import call_in_child
try:
    call_in_child(ask, {"refuse": True}, python=sys.argv[1])
except MachineError as error:
    print(json.dumps(call_in_child(ask, {}, python=sys.argv[1]) | {"where": error.where}))
"""


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands for the environment")
@pytest.mark.parametrize("started_by", ["pip", "the add-on"])
def test_another_environment_gets_this_package_and_no_other(under_pip, tmp_path, monkeypatch, started_by):
    packages, python = under_pip
    monkeypatch.setenv("PYTHONPATH", str(packages))
    if started_by == "the add-on":
        monkeypatch.setenv("PYTHONSAFEPATH", "1")
    (tmp_path / "here" / "model_weights").mkdir(parents=True)  # where the person stands
    (tmp_path / "here" / "model_weights" / "__init__.py").write_text("whose = 'nobody'\n")
    done = subprocess.run([sys.executable, "-c", ASK, python], capture_output=True, text=True, cwd=tmp_path / "here")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["whose"] == "of the model" and answer["where"] == "here"
    assert Path(answer["place"]).parent == packages / "r2sego_blender"
    assert str(packages) not in answer["path"] and str(tmp_path / "here") not in answer["path"]


def test_external_programs_keep_what_the_person_put_on_the_path(monkeypatch, tmp_path):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("R2SEGO_TEST", "kept")
    assert engine_environment()["PYTHONPATH"].split(os.pathsep)[0] == str(library_path.LIBRARY.parent)
    monkeypatch.setenv("PYTHONPATH", engine_environment()["PYTHONPATH"])
    environment = library_path.external_variables()
    assert (environment["PYTHONPATH"], environment["R2SEGO_TEST"]) == (str(tmp_path), "kept")
    monkeypatch.setenv("PYTHONPATH", str(library_path.LIBRARY.parent))
    assert "PYTHONPATH" not in library_path.external_variables()


def test_inside_blender_the_module_is_named_as_the_child_knows_it(monkeypatch):
    """The add-on's library has a longer name there."""
    monkeypatch.setattr(child, "_PACKAGE", "bl_ext.user_default.r2sego.r2sego_blender")
    monkeypatch.setattr(
        external_environment.checked_request, "__module__", f"{child._PACKAGE}.workers.external_environment"
    )  # it declines a request that names no protocol, so it has run
    with pytest.raises(NativeError, match="follows protocol None"):
        child.call_in_child(external_environment.checked_request, {})


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
