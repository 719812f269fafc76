"""The bundle: atomic, resumable, honest about versions and full disks."""

import dataclasses
import errno
import json
import os
import shutil
import subprocess
import sys
import threading
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from expected_errors import refused

from r2sego_blender.bundle.creating import create_bundle, require_place
from r2sego_blender.bundle.declaration import Declaration
from r2sego_blender.bundle.journal import Journal
from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.config.presets import entries
from r2sego_blender.config.settings import Settings, setting
from r2sego_blender.config.slots import GENERATORS, REGISTRARS, RENDERERS, SURFACES, TRAINERS
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import SceneError, SettingsError
from r2sego_blender.core.scratch import remove_scratch
from r2sego_blender.evaluation.scene_evaluation import evaluate_scene
from r2sego_blender.pipeline import refine
from r2sego_blender.results.collision_report import check_scene
from r2sego_blender.results.export import export_scene
from r2sego_blender.results.texture import texture_scene

IDENTITY = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))
DECLARATION = Declaration("photos", IDENTITY, ground="floor plane", scale_source="metric poses")


def make_scene(folder: Path) -> Scene:
    return create_bundle(folder / "room.r2s", DECLARATION, lambda f: (f / "captures").mkdir())


def test_open_reads_what_create_declared(tmp_path):
    scene = make_scene(tmp_path)
    changed = scene.declare(preset="preview", overrides={"training.steps_per_round": 7})
    assert Scene.open(scene.path).declaration == changed.declaration
    assert Scene.open(scene.path).declaration.settings.training.steps_per_round == 7


def test_what_another_declared_meanwhile_stays(tmp_path):
    scene = make_scene(tmp_path)
    turned = tuple(map(tuple, np.diag([-1.0, -1.0, 1.0, 1.0]).tolist()))
    Scene.open(scene.path).declare(world_from_capture=turned, ground="corrected")
    changed = scene.declare(preset="preview").declaration
    assert changed == Scene.open(scene.path).declaration
    assert (changed.world_from_capture, changed.ground) == (turned, "corrected")
    assert changed.preset == "preview"


def test_another_preset_begins_without_the_overrides_of_before():
    changed = DECLARATION.with_settings(None, {"rounds": "2"}).with_settings("paper", {"seed": "7"})
    assert (changed.preset, dict(changed.overrides)) == ("paper", {"rounds": "2", "seed": "7"})
    other = changed.with_settings("preview", {"seed": "1"})
    assert (other.preset, dict(other.overrides)) == ("preview", {"seed": "1"})
    assert dict(DECLARATION.overrides) == {}


@pytest.mark.parametrize(
    ("slot", "key", "known"),
    [
        ("surface", "proxy.surface", SURFACES.labels),
        ("conditions", "generation.renderer", RENDERERS.labels),
        ("generator", "generation.generator", GENERATORS.labels),
        ("registration", "registration.registrar", REGISTRARS.labels),
        ("splat_trainer", "training.backend", TRAINERS.labels),
    ],
)
def test_the_list_of_backends_follows_the_settings(tmp_path, slot, key, known):
    scene = make_scene(tmp_path)
    entry = next(e for e in entries() if e.key == key)
    assert scene.declaration.backends[slot] == known[entry.default]
    assert set(known) == set(entry.choices)
    for name, told in known.items():
        scene = scene.declare(overrides={key: name})
        assert Scene.open(scene.path).declaration.backends[slot] == told
        assert f'{slot} = "{told}"' in (scene.path / "scene.toml").read_text()


def test_the_controller_is_the_one_that_drove_the_last_rollouts(tmp_path):
    scene = make_scene(tmp_path)
    declared = scene.backends["controller"]
    assert declared.startswith("embedded: reference motion")
    for index, (name, told) in enumerate(
        [
            ("reference motions", declared),
            ("replay sit.csv", "embedded: replay sit.csv, tracked in MuJoCo"),
            ("policy walk.onnx", "policy walk.onnx"),
        ],
        start=9,  # ten comes after nine
    ):
        folder = scene.round_folder(index) / "rollouts"
        folder.mkdir(parents=True)
        (folder / "rollouts.json").write_text(json.dumps({"rollouts": [{"controller": name}]}))
        assert scene.backends["controller"] == told
    for damaged in ("{", '{"rollouts": 7}', '{"rollouts": [{"controller": null}]}', "[]"):
        (folder / "rollouts.json").write_text(damaged)
        assert scene.backends["controller"] == declared


def test_create_leaves_nothing_when_filling_fails(tmp_path):
    with pytest.raises(ZeroDivisionError):
        create_bundle(tmp_path / "new" / "deep" / "a.r2s", DECLARATION, lambda folder: 1 / 0)
    assert list(tmp_path.iterdir()) == []
    assert make_scene(tmp_path / "new" / "deep").captures_folder.is_dir()


def test_create_refuses_an_existing_place(tmp_path):
    make_scene(tmp_path)
    with refused(SceneError, tmp_path / "room.r2s", "exists"):
        make_scene(tmp_path)


def test_of_two_that_make_one_scene_the_later_is_told(tmp_path):
    (tmp_path / "other").mkdir()
    first, place = make_scene(tmp_path / "other"), tmp_path / "room.r2s"
    with refused(SceneError, place, "exists"):
        create_bundle(place, DECLARATION, lambda folder: first.path.rename(place))
    assert {path.name for path in tmp_path.iterdir()} == {"other", "room.r2s"}
    assert Scene.open(place).declaration == first.declaration


@pytest.mark.parametrize("text", ["format = 99", "format = 1", "format = ", "\xff"])
def test_open_names_the_file_and_the_cure(tmp_path, text):
    scene = make_scene(tmp_path)
    (scene.path / "scene.toml").write_text(text, encoding="latin-1")
    with pytest.raises(SceneError, match=r"scene\.toml") as caught:
        Scene.open(scene.path)
    assert caught.value.cure


@pytest.mark.parametrize(
    ("section", "wrong", "told"),
    [
        ("settings", {"overrides": [1]}, "settings.overrides"),
        ("settings", {"overrides": {"no.such": 1}}, "there is no setting 'no.such'"),
        ("settings", {"overrides": {"rounds": float("inf")}}, "rounds is inf. Write a whole number"),
        ("settings", {"preset": "no"}, "there is no preset 'no'"),
        ("registration", {"world_from_capture": [[1.0, 2.0]]}, "registration.world_from_capture"),
        ("registration", {"world_from_capture": [[0.0] * 4] * 5}, "registration.world_from_capture"),
        ("registration", {"world_from_capture": [[float("nan")] * 4] * 4}, "registration.world_from_capture"),
        ("registration", {"world_from_capture": 1.0}, "registration.world_from_capture"),
        ("priors", 3, "priors is not a table"),
        ("priors", {"mesh_library": ["a", "b"]}, "priors.mesh_library is ['a', 'b']"),
        ("robot", {"scope": 3}, "robot.scope is 3"),
        ("robot", {"model": False}, "robot.model is False"),
    ],
)
def test_a_wrong_declaration_is_an_error_that_names_its_file(tmp_path, section, wrong, told):
    scene = make_scene(tmp_path)
    file = scene.path / "scene.toml"
    data = tomllib.loads(file.read_text())
    data[section] = data[section] | wrong if isinstance(wrong, dict) else wrong
    file.write_text(tomli_w.dumps(data))
    with pytest.raises((SceneError, SettingsError)) as caught:
        Scene.open(scene.path)
    assert str(caught.value).startswith(f"{file}: ") and told in str(caught.value) and caught.value.cure


def test_settings_may_be_declared_without_quotes(tmp_path):
    scene = make_scene(tmp_path)
    file = scene.path / "scene.toml"
    text, _, _ = file.read_text().partition("[settings.overrides]")
    by_hand = "[settings.overrides]\ntraining.max_gaussians = 5000\ntraining.sh_degree = 2\nrounds = 5\n"
    file.write_text(text + by_hand)
    declared = Scene.open(scene.path).declaration
    assert declared.overrides == {"training.max_gaussians": 5000, "training.sh_degree": 2, "rounds": 5}
    assert (declared.settings.training.max_gaussians, declared.settings.rounds) == (5000, 5)


def test_open_refuses_a_folder_that_is_no_bundle(tmp_path):
    with refused(SceneError, tmp_path / "scene.toml", cure="`r2sego new`"):
        Scene.open(tmp_path)


def test_declare_refuses_unknown_settings_and_keeps_the_file(tmp_path):
    scene = make_scene(tmp_path)
    before = (scene.path / "scene.toml").read_bytes()
    with pytest.raises(SettingsError):
        scene.declare(overrides={"no.such": 1})
    assert (scene.path / "scene.toml").read_bytes() == before


def test_a_step_runs_once_and_again_when_what_it_reads_changes(tmp_path):
    scene = make_scene(tmp_path)
    source = scene.path / "source.txt"
    source.write_text("one")
    runs = []

    def compute(file: Path) -> None:
        runs.append(source.read_text())
        file.write_text(source.read_text())

    def step(parameters=None):
        return Runner(scene).step("geometry/copy.txt", compute, inputs=["source.txt"], parameters=parameters)

    step()
    step()
    assert runs == ["one"]
    source.write_text("two")
    assert step().read_text() == "two"
    step(parameters={"a": 1})
    assert runs == ["one", "two", "two"]
    step(parameters={"a": 1})
    assert len(runs) == 3


def test_a_setting_added_later_makes_nothing_again_until_it_is_set(tmp_path):
    """The digest as it was before a dataclass had the field."""
    scene = make_scene(tmp_path)

    @dataclasses.dataclass(frozen=True)
    class Before:
        rate: float = setting(0.5, "A rate.")
        threads: int = setting(2, "How fast.", changes_result=False)

    @dataclasses.dataclass(frozen=True)
    class Now(Before):
        engine: str = setting("ours", "An engine.", choices=("ours", "theirs"), added=True)

    runs = []

    def made_again(parameters) -> bool:
        before = len(runs)
        Runner(scene).step("a.txt", lambda file: runs.append(file.write_text("a")), parameters=[parameters])
        return len(runs) > before

    assert made_again(Before())
    assert not any(made_again(same) for same in (Now(), Now(threads=3), Before(threads=3)))
    assert all(made_again(other) for other in (Now(engine="theirs"), Now(), Now(rate=0.6)))
    assert not made_again(Before(rate=0.6))


def test_a_failed_step_keeps_the_earlier_result(tmp_path):
    scene = make_scene(tmp_path)

    def write(folder: Path) -> None:
        (folder / "a.txt").write_text("good")

    def fail(folder: Path) -> None:
        (folder / "a.txt").write_text("bad")
        raise OSError(errno.ENOSPC, "No space left on device")

    Runner(scene).step("geometry/maps", write, parameters=1)
    digest = content_digest(scene.geometry_folder)
    with refused(SceneError, "room.r2s/geometry/maps", "disk is full"):
        Runner(scene).step("geometry/maps", fail, parameters=2)
    assert content_digest(scene.geometry_folder) == digest
    assert Runner(scene).step("geometry/maps", write, parameters=3).is_dir()


def test_a_step_killed_as_its_result_took_its_place_is_run_again(tmp_path, monkeypatch):
    """Settings a, then b killed before the journal has them, then a again: what is there is of b."""
    scene = make_scene(tmp_path)

    def made(content):
        written = Runner(scene).step("a.txt", lambda file: file.write_text(content), parameters=content)
        return written.read_text()

    assert made("a") == "a"
    write = Journal.write

    def killed(self, **told):
        if "step" in told:
            raise KeyboardInterrupt
        write(self, **told)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(Journal, "write", killed)
        made("b")
    assert (scene.path / "a.txt").read_text() == "b"
    assert made("a") == "a" == made("a")


def test_a_damaged_result_is_made_again_and_an_edited_one_kept(tmp_path):
    scene = make_scene(tmp_path)

    def step(name, **reading):
        return Runner(scene).step(name, lambda file: file.write_text('{"a": 1}'), **reading)

    for name in ("read.json", "last.json"):
        step(name)
    read = scene.path / "read.json"
    read.write_text('{"a": 2}')
    assert step("read.json", read=lambda: json.loads(read.read_text())).read_text() == '{"a": 2}'
    read.write_text('{"a":')
    assert step("read.json", read=lambda: json.loads(read.read_text())).read_text() == '{"a": 1}'
    (scene.path / "last.json").write_text('{"a": 2}')  # what no step reads has no edits
    assert step("last.json").read_text() == '{"a": 1}'
    assert len(scene.journal()) == 4


def test_a_clock_set_back_does_not_shorten_a_step(tmp_path, monkeypatch):
    scene, clock = make_scene(tmp_path), iter([2000.0, 1000.0])
    monkeypatch.setattr("r2sego_blender.bundle.runner.time.time", lambda: next(clock))
    Runner(scene).step("a.txt", lambda file: file.write_text("a"))
    assert 0.0 <= scene.journal()[0]["seconds"] < 60.0


def test_a_bundle_that_is_cancelled_in_the_making_leaves_nothing(tmp_path):
    def fill(folder):
        (folder / "captures").mkdir()
        remove_scratch()  # what a cancelled process does
        raise KeyboardInterrupt(list(tmp_path.iterdir()))

    with pytest.raises(KeyboardInterrupt) as left:
        create_bundle(tmp_path / "room.r2s", make_scene(tmp_path / "other").declaration, fill)
    assert left.value.args[0] == [tmp_path / "other"]


def test_a_step_that_is_cancelled_leaves_nothing_of_its_result(tmp_path):
    scene = make_scene(tmp_path)

    def compute(folder):
        (folder / "half").write_text("x")
        remove_scratch()  # what a cancelled process does
        raise KeyboardInterrupt([file.name for file in (scene.path / "geometry").iterdir()])

    with pytest.raises(KeyboardInterrupt) as left:
        Runner(scene).step("geometry/depth", compute)
    assert left.value.args[0] == []


def test_the_lock_excludes_another_process(tmp_path):
    scene = make_scene(tmp_path)
    code = (
        "import sys, pathlib; from r2sego_blender.bundle.scene import Scene\n"
        "with Scene.open(pathlib.Path(sys.argv[1])).locked(): print('locked')"
    )
    with scene.locked():
        other = subprocess.run([sys.executable, "-c", code, str(scene.path)], capture_output=True, text=True)
        assert "another process" in other.stderr
    other = subprocess.run([sys.executable, "-c", code, str(scene.path)], capture_output=True, text=True)
    assert other.stdout.strip() == "locked"


def test_what_a_killed_process_left_of_a_new_bundle_goes_with_the_next(tmp_path):
    """And not what another is still making."""
    script = (
        "import pathlib, sys, test_scene\n"
        "def fill(folder):\n"
        "    (folder / 'captures').mkdir()\n"
        "    print(folder.name, flush=True)\n"
        "    sys.stdin.read()\n"
        "test_scene.create_bundle(pathlib.Path(sys.argv[1]), test_scene.DECLARATION, fill)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, tmp_path / "cut.r2s"],
        cwd=Path(__file__).parent,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, Path(__file__).parents[1:3]))},
    ) as making:
        left = tmp_path / making.stdout.readline().strip()
        first = make_scene(tmp_path)
        assert left.is_dir() and (left / "captures").is_dir()
        making.kill()
    create_bundle(tmp_path / "next.r2s", DECLARATION, lambda folder: None)
    assert {path.name for path in tmp_path.iterdir()} == {first.path.name, "next.r2s"}
    with first.locked():
        pass


@pytest.mark.parametrize(
    "work",
    [
        refine,
        lambda scene: evaluate_scene(scene, scene.path / "none.json"),
        lambda scene: texture_scene(scene, Settings()),
        lambda scene: export_scene(scene, scene.path.parent / "out"),
        check_scene,
    ],
    ids=["refine", "evaluate", "texture", "export", "check-collision"],
)
def test_the_lock_excludes_other_threads_and_not_its_own(tmp_path, work):
    """As of ``pipeline.refine``, which a command calls while it holds the scene."""
    scene = make_scene(tmp_path)
    told = []

    def try_it():
        try:
            work(scene)
        except SceneError as error:
            told.append(str(error))

    with scene.locked():
        with Scene.open(scene.path).locked():
            pass
        other = threading.Thread(target=try_it)
        other.start()
        other.join()
    assert len(told) == 1 and "another process is working" in told[0]
    with scene.locked():
        assert scene.journal() == []


def test_a_scene_that_may_only_be_read_is_said_to_be(tmp_path, monkeypatch):
    def refuse(file, *_, **__):
        raise PermissionError(errno.EACCES, "Permission denied", str(file))

    scene = make_scene(tmp_path)
    monkeypatch.setattr(Path, "open", refuse)
    with refused(SceneError, scene.path, "written"), scene.locked():
        pass


@pytest.mark.skipif(os.name == "nt", reason="links need privileges")
def test_a_link_to_nowhere_is_no_place_for_a_scene(tmp_path):
    (tmp_path / "room.r2s").symlink_to("/nowhere")
    with refused(SceneError, tmp_path / "room.r2s", "exists"):
        require_place(tmp_path / "room.r2s")


def test_rounds_done_counts_unbroken_assets(tmp_path):
    scene = make_scene(tmp_path)
    for index in (0, 1, 3):
        scene.round_folder(index).mkdir(parents=True)
        (scene.round_folder(index) / "asset.ply").write_text("")
    assert scene.rounds_done() == 2


def test_a_scene_is_called_as_its_folder(tmp_path, monkeypatch):
    scene = make_scene(tmp_path)
    (scene.path / "report").mkdir()
    for place, path in ((tmp_path, scene.path), (scene.path, "."), (scene.path / "report", "..")):
        monkeypatch.chdir(place)
        assert Scene.open(path).name == scene.path.name == "room.r2s"


def test_the_newest_round_is_a_declared_one(tmp_path):
    scene = make_scene(tmp_path)
    assert scene.newest_round("views") == -1
    for index in range(3):
        (scene.round_folder(index) / "views").mkdir(parents=True)
    assert scene.newest_round("views") == 2
    assert scene.declare(overrides={"rounds": 2}).newest_round("views") == 1
    assert scene.newest_round("views/000") == -1


def test_the_journal_is_json_lines_with_digests(tmp_path):
    scene = make_scene(tmp_path)
    Runner(scene).step("a.txt", lambda file: file.write_text("a"))
    record = json.loads((scene.path / "journal.jsonl").read_text())
    assert record["output"] == content_digest(scene.path / "a.txt")


@pytest.mark.parametrize("target", ["asset.ply", "rounds/0/proxy", "report"])
@pytest.mark.parametrize("replaced", [False, True])
def test_a_bundle_that_is_removed_while_it_is_worked_on_does_not_come_back(tmp_path, target, replaced):
    """Nor is another that took its place written to."""
    scene = make_scene(tmp_path)
    aside = tmp_path / "aside"

    def removed(place: Path) -> None:
        (place / "made" if place.is_dir() else place).write_text("made")
        scene.path.rename(aside)
        shutil.rmtree(aside)
        if replaced:
            make_scene(tmp_path)

    with scene.locked():
        with refused(SceneError):
            Runner(scene).step(target, removed)
        with refused(SceneError):
            Runner(scene).step(target, lambda place: pytest.fail("nothing is there to make it of"))
        for change in (lambda: scene.note(step="a"), lambda: scene.declare(preset="preview")):
            with refused(SceneError):
                change()
        with refused(SceneError):
            scene.made_folder("report")
    left = sorted(path.name for path in tmp_path.rglob("*"))
    assert left == ([".lock", "captures", "room.r2s", "scene.toml"] if replaced else [])


def test_a_bundle_that_is_removed_before_its_first_step_is_not_made(tmp_path):
    scene = make_scene(tmp_path)
    shutil.rmtree(scene.path)
    with refused(SceneError):
        Runner(scene).step("geometry/planes.npz", lambda place: place.write_text("made"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["../out", "/out", "a/../../out", "C:/out", "\\\\host\\out", "a\0b", "..\\out"])
def test_nothing_is_published_outside(tmp_path, name):
    scene = make_scene(tmp_path)
    with refused(SceneError), scene.publishing(name):
        pytest.fail("it has a place to write at")
    assert [path.name for path in tmp_path.iterdir()] == ["room.r2s"]
