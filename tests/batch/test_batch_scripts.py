"""The scripts run as ``python batch/….py -- …`` with pip bpy."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import fake_bundle
import pytest

from r2sego_blender.commands.scripts import run_script

pytest.importorskip("bpy", reason="pip bpy is not installed")

BATCH = Path(__file__).parents[2] / "batch"


@pytest.fixture
def run(blender_environment, tmp_path):
    """Run a script with these arguments, from another folder."""

    def run(script, *arguments, **environment):
        return subprocess.run(
            [sys.executable, str(BATCH / script), "--", *map(str, arguments)],
            env={**blender_environment, **environment},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=1200,
        )

    return run


def test_import_scene_makes_a_blend(run, bundle_path, tmp_path):
    done = run("import_scene.py", "room.r2s", "room.blend", "--round", 0)
    assert done.returncode == 0, done.stderr
    assert "3 captures" in done.stdout
    assert f"{len(fake_bundle.TARGETS)} target views" in done.stdout
    blend = tmp_path / "room.blend"
    look = f"import bpy; bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); print(bpy.data.objects.keys())"
    opened = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True)
    for name in ("capture_0", "Sparse points", "Proxy, round 0", "Candidates, round 0", "Target 02"):
        assert repr(name) in opened.stdout, opened.stderr


def test_import_scene_says_what_is_wrong(run, tmp_path):
    done = run("import_scene.py", tmp_path, "room.blend")
    assert done.returncode == 1
    assert done.stderr.startswith("r2sego: ")
    assert "scene.toml" in done.stderr


def test_what_blender_refuses_is_told_in_one_line(run, bundle_path, tmp_path):
    done = run("import_scene.py", "room.r2s", tmp_path / "nowhere" / "room.blend")
    assert done.returncode == 1
    assert "r2sego: Cannot open file" in done.stderr and "Traceback" not in done.stderr


def test_any_error_ends_a_script_with_a_status(capsys):
    """Blender itself would end with 0, and a farm would take the frame for rendered."""

    def fail(arguments):
        raise ZeroDivisionError("in the middle")

    with pytest.raises(SystemExit) as ended:
        run_script(fail)
    assert ended.value.code == 1
    assert "ZeroDivisionError: in the middle" in capsys.readouterr().err


def test_a_file_that_is_not_there_is_told_in_one_line(capsys, tmp_path):
    with pytest.raises(SystemExit) as ended:
        run_script(lambda arguments: (tmp_path / "nowhere.json").stat().st_size)
    said = capsys.readouterr().err
    assert ended.value.code == 1
    assert "nowhere.json" in said and len(said.splitlines()) == 1


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("is_operator", [False, True])
def test_a_script_that_is_interrupted_leaves_what_it_runs(number, is_operator):
    """A job that it waits for is stopped on the way out (``Job.wait``). Blender has a handler of its own for
    Ctrl-C, and makes a RuntimeError of whatever leaves an operator."""
    waiting = (
        "import signal, time\n"
        "from r2sego_blender.commands.scripts import run_script\n"
        "signal.signal(signal.SIGINT, signal.SIG_DFL)\n"
        "def main(arguments):\n"
        "    try:\n"
        "        print('begun', flush=True)\n"
        "        time.sleep(60)\n"
        "    except BaseException as error:\n"
        "        print('left')\n"
        f"        if {is_operator}: raise RuntimeError('Error: Python: Traceback') from error\n"
        "        raise\n"
        "run_script(main)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", waiting], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=BATCH.parent
    )
    assert process.stdout.readline() == "begun\n"
    process.send_signal(number)
    said, errors = process.communicate(timeout=30)
    assert (said, process.returncode) == ("left\n", 128 + number)
    assert "Traceback" not in errors and len(errors.splitlines()) == 1


@pytest.mark.parametrize(("script", "command"), [("refine.py", "refine"), ("export_collision.py", "export")])
def test_engine_scripts_pass_everything_on(run, tmp_path, script, command):
    engine = tmp_path / "engine"
    engine.write_text(f"#!{sys.executable}\nimport json, sys\nprint(json.dumps(sys.argv[1:]))\nsys.exit(7)\n")
    engine.chmod(0o755)
    done = run(script, "room.r2s", "--preset", "preview", R2SEGO_PYTHON=str(engine))
    assert done.returncode == 7
    said = json.loads(done.stdout.strip().splitlines()[-1])
    assert said == ["-m", "r2sego_blender", command, "room.r2s", "--preset", "preview"]


def test_the_real_engine_answers_in_one_line(run, tmp_path):
    done = run("refine.py", "missing.r2s")
    assert done.returncode == 1
    assert "missing.r2s" in done.stderr
    assert "Traceback" not in done.stderr


def test_without_a_python_for_the_engine_it_says_so(run):
    done = run("refine.py", "room.r2s", R2SEGO_PYTHON="/nowhere/python")
    assert done.returncode == 1
    assert "/nowhere/python" in done.stderr
