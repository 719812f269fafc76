"""The command tree: bad input gives one clear line with file, field and cure, and changes nothing."""

import importlib
import inspect
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bundles import new_bundle
from click.testing import CliRunner

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.frame.world_frame import ASSUMED_CAMERA_HEIGHT_M
from r2sego_blender.commands import bench as bench_commands
from r2sego_blender.commands.bench import bench
from r2sego_blender.commands.cli import main
from r2sego_blender.config.presets import PRESETS, with_overrides
from r2sego_blender.config.settings import Settings
from r2sego_blender.core import compiled
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.images import save_image
from r2sego_blender.robot.scope.scope import shipped_scopes
from tools.benchmarks.kills import FEW

ROOT = Path(__file__).parents[2]
ROOM = ROOT / "demo" / "room"


def r2sego(*arguments: object, **variables: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "r2sego_blender", *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, errors="replace", cwd=ROOT, env={**os.environ, **variables}
    )


def refused(done: subprocess.CompletedProcess) -> str:
    """The one line a command that failed printed last; it must be no traceback."""
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr.strip().splitlines()[-1]


@pytest.fixture
def photographs(tmp_path) -> Path:
    folder = tmp_path / "photographs"
    folder.mkdir()
    return folder


def noise(path: Path, seed: int) -> None:
    save_image(path, np.random.default_rng(seed).random((120, 160, 3), np.float32))


def bundle(folder: Path) -> Scene:
    return new_bundle(folder / "room.r2s")


@pytest.mark.parametrize("count", [0, 1, 2])
def test_new_wants_three_photographs(photographs, tmp_path, count):
    for index in range(count):
        noise(photographs / f"{index}.png", index)
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs))
    assert str(photographs) in line and "at least 3" in line
    assert not (tmp_path / "a.r2s").exists()


@pytest.mark.parametrize("poses", [[], ["--poses", ROOM / "cameras.json"]])
def test_new_refuses_fewer_than_three_first_photographs_at_once(tmp_path, poses):
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", ROOM / "captures", "--first", 2, *poses))
    assert line.startswith("r2sego: --first: ")


def test_new_names_the_folder_that_is_missing(tmp_path):
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", tmp_path / "nowhere"))
    assert "nowhere" in line


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--depth", ".", "--marker-side", 0.1], "the scale is given twice"),
        (["--camera-height", "robot", "--depth", "."], "the scale is given twice"),
        (["--camera-height", "tall"], "'tall' is no number"),
        (["--camera-height", "robot", "--robot", "nowhere.xml"], "nowhere.xml"),
    ],
)
def test_new_refuses_scales_that_make_no_sense(photographs, tmp_path, options, message):
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs, *options))
    assert message in line


def test_new_refuses_settings_that_are_none(photographs, tmp_path):
    setting = "captures.refine_poses=maybe"
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs, "--set", setting))
    assert "auto, always, never" in line and not (tmp_path / "a.r2s").exists()


def test_new_names_the_image_it_cannot_read(photographs, tmp_path):
    for index in range(3):
        noise(photographs / f"{index}.png", index)
    (photographs / "1.png").write_bytes(b"\x89PNG garbage")
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs))
    assert "1.png" in line and "cannot be read" in line


@pytest.mark.slow
def test_new_says_what_to_photograph_when_images_share_nothing(photographs, tmp_path):
    for index in range(4):
        noise(photographs / f"{index}.png", index)
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs))
    assert "share" in line and "keep half of each picture" in line
    assert list(tmp_path.iterdir()) == [photographs]


@pytest.mark.parametrize("text", ["<mujoco><worldbody><geom/></worldbody></mujoco>", "no xml"])
def test_new_refuses_a_robot_that_does_not_compile(photographs, tmp_path, text):
    robot = tmp_path / "robot.xml"
    robot.write_text(text)
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs, "--robot", robot))
    assert "robot.xml" in line


def test_new_refuses_a_scope_whose_policy_is_not_there(photographs, tmp_path):
    (tmp_path / "mine.toml").write_text(
        "[controller]\nkind = 'policy'\nfile = 'gone.onnx'\nlayout = 'falcon_g1_29dof'\n"
    )
    scope = ["--scope", tmp_path / "mine.toml"]
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs, *scope))
    assert f"{tmp_path / 'gone.onnx'}: " in line and "controller.file" in line


def test_new_learns_at_once_that_it_cannot_write(photographs, tmp_path):
    (tmp_path / "file").write_text("mine")
    for target in (Path("/proc/a.r2s"), tmp_path / "file" / "deep" / "a.r2s"):
        line = refused(r2sego("new", target, "--captures", photographs))  # of which there are none
        assert str(target) in line and "no scene can be written there" in line
    for index in range(2):
        noise(photographs / f"{index}.png", index)
    refused(r2sego("new", tmp_path / "other" / "a.r2s", "--captures", photographs))
    assert {path.name for path in tmp_path.iterdir()} == {"file", photographs.name}


def test_new_refuses_a_scale_it_cannot_read(photographs, tmp_path):
    line = refused(r2sego("new", tmp_path / "a.r2s", "--captures", photographs, "--known-length", "a:1:2"))
    assert "PHOTO:X,Y:X,Y:METRES" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "training.stepz=3"], "training."),
        (["--set", "training.steps_per_round=-3"], "It lies from 1"),
        (["--set", "rounds"], "key=value"),
        (["--rounds", "0"], "rounds is 0"),
    ],
)
def test_refine_refuses_unknown_settings_and_leaves_the_bundle(tmp_path, arguments, words):
    scene = bundle(tmp_path)
    before = content_digest(scene.path)
    assert words in refused(r2sego("refine", scene.path, *arguments))
    (scene.path / ".lock").unlink(missing_ok=True)
    assert content_digest(scene.path) == before


@pytest.mark.parametrize(("key", "warned"), [("captures.max_side_px", True), ("stereo.max_side_px", False)])
def test_refine_says_which_settings_came_too_late(tmp_path, key, warned):
    scene = bundle(tmp_path)
    done = r2sego("refine", scene.path, "--set", f"{key}=320")
    assert (f"{key}: counts for `r2sego new`; the captures stay" in done.stderr) == warned
    assert (key in Scene.open(scene.path).declaration.overrides) != warned


def test_refine_says_nothing_of_settings_that_the_captures_were_made_with(tmp_path):
    """Blender gives all that are declared, each time."""
    scene = bundle(tmp_path).declare(overrides={"captures.max_side_px": "320"})
    done = r2sego("refine", scene.path, "--preset", "preview", "--set", "captures.max_side_px=320")
    assert "the captures stay" not in done.stderr
    assert dict(Scene.open(scene.path).declaration.overrides) == {"captures.max_side_px": "320"}


def test_every_command_refuses_a_bundle_of_another_version(tmp_path):
    scene = bundle(tmp_path)
    declared = scene.path / "scene.toml"
    declared.write_text(declared.read_text().replace("format = 1", "format = 2"))
    for arguments in (
        ["refine", scene.path],
        ["status", scene.path],
        ["evaluate", scene.path, "--frozen", ROOM / "cameras.json"],
        ["export", scene.path, "--to", tmp_path / "out"],
    ):
        assert "format 2" in refused(r2sego(*arguments))


def test_what_is_not_there_yet_is_said(tmp_path):
    scene = bundle(tmp_path)
    assert "r2sego refine" in refused(r2sego("export", scene.path, "--to", tmp_path / "out"))
    assert "r2sego refine" in refused(r2sego("evaluate", scene.path, "--frozen", ROOM / "cameras.json"))
    assert "r2sego new" in refused(r2sego("status", tmp_path / "nothing.r2s"))


def test_json_progress_tells_an_error_as_a_line_of_json(tmp_path):
    done = r2sego("refine", tmp_path / "nothing.r2s", "--json-progress")
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 1
    assert events[-1]["event"] == "error" and "nothing.r2s" in events[-1]["text"]


def test_results_are_on_standard_output(tmp_path):
    room = tmp_path / "a.r2s"
    small = ["--captures", ROOM / "captures", "--poses", ROOM / "cameras.json"]
    made = r2sego("new", room, *small, "--set", "captures.max_side_px=160")
    assert made.returncode == 0, made.stderr
    assert made.stdout.splitlines()[0] == f"scene: {room}" and "scene:" not in made.stderr


@pytest.mark.parametrize("encoding", ["latin-1", "latin-1:surrogateescape"])  # the latter as on Windows
def test_a_terminal_that_cannot_write_a_name_ends_no_command(tmp_path, encoding):
    room = bundle(tmp_path).path
    (room / "captures" / "cameras.json").write_text('{"captures": []}')
    named = room.rename(tmp_path / "room \N{CAT FACE}.r2s")
    done = r2sego("status", named, PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    assert "room \\U0001f431.r2s: 0 captures" in done.stdout


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (MemoryError(), "r2sego: there is not enough memory."),
        (ImportError("No module named 'mujoco'"), "No module named 'mujoco'. `r2sego doctor` says"),
    ],
)
def test_a_machine_that_lacks_something_is_told_in_one_line(tmp_path, monkeypatch, error, told):
    def describe(*_, **__):
        raise error

    monkeypatch.setattr("r2sego_blender.results.status.describe", describe)
    done = CliRunner().invoke(main, ["status", str(bundle(tmp_path).path)])
    assert done.exit_code == 1
    assert told in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_command_within_a_program_that_has_compiled_leaves_numba_its_settings(tmp_path):
    """Numba reads all its settings anew when one has changed: the cache of kernels would go astray."""

    def settings():
        return {name: value for name, value in os.environ.items() if name.startswith("NUMBA")}

    before = settings(), compiled.numba.config.CACHE_DIR
    CliRunner().invoke(main, ["status", str(tmp_path)])
    compiled.numba.config.reload_config()
    assert before == (settings(), compiled.numba.config.CACHE_DIR)


@pytest.mark.parametrize("group", [[], ["bench"]])
def test_the_help_says_what_each_command_does_in_full(group):
    assert "..." not in CliRunner().invoke(main, [*group, "--help"]).output.partition("Commands:")[2]


def told_by_help(*command: str) -> str:
    return " ".join(CliRunner().invoke(main, [*command, "--help"]).output.split())


def test_the_help_tells_settings_and_scopes_as_they_are():
    texture, rounds = Settings().texture, with_overrides({}).rounds
    told = told_by_help("texture")
    assert f"by default {texture.faces}" in told and f"by default {texture.size_px}" in told
    preview = PRESETS["preview"]["rounds"]
    assert f"{rounds} in 'paper', {preview} in 'preview'" in told_by_help("refine")
    for command in ("new", "robot"):
        assert f"{', '.join(reversed(shipped_scopes()))} or a TOML file" in told_by_help(command)
    assert "0, the default, takes all" in told_by_help("new")
    assert f"{ASSUMED_CAMERA_HEIGHT_M} m above the floor" in told_by_help("new")


@pytest.mark.parametrize("name", bench.commands)
def test_the_help_of_a_benchmark_tells_the_defaults_that_hold(name):
    benchmark = importlib.import_module(f"tools.benchmarks.{name}")
    taken = inspect.signature(getattr(benchmark, f"bench_{name}")).parameters
    options = {option.name: option for option in bench.commands[name].params}
    for option in set(options) & set(taken):
        default = taken[option].default
        if isinstance(default, (int, str)):
            assert options[option].default == default and options[option].show_default, option
    help_text = told_by_help("bench", name)
    if name == "splats":  # which has others for splats of files
        assert f"{benchmark.SPLATS_GAUSSIANS} by default" in help_text
        assert f"or {benchmark.SIZE} of" in help_text


def test_doctor_names_what_is_installed():
    findings = json.loads(r2sego("doctor", "--json").stdout)
    versions = {package["name"]: package["version"] for package in findings["packages"]}
    assert findings["ready"] and versions["mujoco"] == "4.0.0"


@pytest.mark.skipif(shutil.which("mount") is None or os.name == "nt", reason="needs mount")
def test_a_full_disk_is_said_and_nothing_is_left(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("mounting a small file system needs root")
    try:
        arguments = ["new", disk / "a.r2s", "--captures", ROOM / "captures"]
        line = refused(r2sego(*arguments, "--poses", ROOM / "cameras.json"))
        assert "disk is full" in line and "kept" not in line
        assert list(disk.iterdir()) == []
    finally:
        subprocess.run(["umount", disk], check=True)


@pytest.mark.parametrize("command", ["rollouts", "select"])
@pytest.mark.parametrize("index", ["-1", "3"])
def test_rounds_that_are_not_declared_are_refused(tmp_path, command, index):
    scene = bundle(tmp_path)
    line = refused(r2sego(command, scene.path, "--round", index))
    assert f"no round {index}" in line and "0 to 2" in line
    assert scene.journal() == []


def test_benchmarks_are_run_from_a_checkout(tmp_path, monkeypatch):
    installed = tmp_path / "r2sego_blender" / "commands" / "bench.py"
    monkeypatch.setattr(bench_commands, "__file__", str(installed))
    done = CliRunner().invoke(main, ["bench", "conditions"])
    assert done.exit_code == 1
    assert f"{tmp_path}: the benchmarks are not installed" in done.stderr and "checkout" in done.stderr


@pytest.mark.slow
def test_new_goes_on_to_the_refined_scene_where_it_is_asked(tmp_path):
    room = tmp_path / "a.r2s"
    photographs = ["--captures", ROOM / "captures", "--poses", ROOM / "cameras.json"]
    options = [f"--set={setting}" for setting in FEW]
    made = r2sego("new", room, *photographs, *options, "--refine", "preview")
    assert made.returncode == 0, made.stderr
    told = dict(line.split(": ", 1) for line in made.stdout.splitlines())
    assert told["scene"] == str(room) and all(Path(told[name]).exists() for name in ("asset", "collision", "report"))
    opened = Scene.open(room)
    assert opened.declaration.preset == "preview" and opened.declaration.settings.rounds == 1


def test_ctrl_c_before_anything_has_begun_is_no_traceback(tmp_path):
    (tmp_path / "click.py").write_text("raise KeyboardInterrupt")
    done = r2sego("doctor", PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize("what", ["nothing", "a file", "a folder"])
def test_what_is_no_scene_is_named_for_what_it_is(tmp_path, what):
    place = tmp_path / "room.r2s"
    if what == "a file":
        place.write_text("")
    elif what == "a folder":
        place.mkdir()
    done = r2sego("status", place)
    assert done.returncode == 1
    assert ("scene.toml" in done.stderr) == (what == "a folder")
    assert ("there is no such folder" in done.stderr) == (what == "nothing")
    assert sorted(tmp_path.rglob("*")) == [place] * (what != "nothing")
