"""What a scene holds, told; and what is damaged in it, with its cure."""

import json
import shlex

import pytest
from bundles import new_bundle
from expected_errors import refused

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import SceneError
from r2sego_blender.results.status import _quoted, describe, lines


@pytest.fixture
def scene(tmp_path):
    """A bundle of two captures that was not refined yet."""

    def fill(folder):
        (folder / "captures").mkdir()
        (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": [{}, {}]}))

    return new_bundle(tmp_path / "room.r2s", fill)


def test_equal_images_have_a_psnr_without_end(scene):
    """The file of scores has no number for it, of an arm as of a round."""
    scene.report_folder.mkdir()
    scores = {"psnr": None, "ssim": 1.0}
    metrics = {"arms": {"refined": scores}, "rounds": [{"round": 0, **scores, "mark": "as before"}]}
    scene.metrics_file.write_text(json.dumps(metrics))
    told = [line for line in lines(describe(scene)) if "PSNR" in line]
    assert told == ["  refined        PSNR inf dB, SSIM 1.000", "  round 0        PSNR inf dB, SSIM 1.000, as before"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"captures": 3}'])
def test_a_damaged_list_of_captures_is_told_with_its_cure(scene, text):
    assert describe(scene)["captures"] == 2
    (scene.captures_folder / "cameras.json").write_text(text)
    with refused(SceneError, "captures/cameras.json", "damaged", cure="`r2sego new`"):
        describe(scene)


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"arms": {"refined": {"psnr": "x", "ssim": 1}}}'])
def test_scores_that_are_damaged_are_told_with_what_makes_them(scene, text):
    """Refining makes none, and would leave them as they are."""
    scene.report_folder.mkdir()
    scene.metrics_file.write_text(text)
    with refused(SceneError, scene.metrics_file, "damaged", cure="`r2sego evaluate` again"):
        describe(scene)


def test_what_is_told_of_a_list_of_captures_that_is_no_text_does_not_hold_all_of_it(scene):
    (scene.captures_folder / "cameras.json").write_bytes(b"\xff" + b"a" * 5000)
    with refused(SceneError, "cameras.json", "damaged") as told:
        describe(scene)
    assert len(str(told.value)) < 500


def test_a_scene_is_named_as_the_shell_of_its_system_takes_it():
    assert _quoted(r"C:\My Scenes\a.r2s", "nt") == r'"C:\My Scenes\a.r2s"'
    assert _quoted("/home/my scenes/a.r2s", "posix") == "'/home/my scenes/a.r2s'"
    assert [_quoted("a.r2s", system) for system in ("nt", "posix")] == ["a.r2s", "a.r2s"]


def test_the_next_command_can_be_run_as_it_is_told(scene):
    moved = scene.path.rename(scene.path.with_name("living room.r2s"))
    command = lines(describe(Scene.open(moved)))[-1].removeprefix("next: ")
    assert shlex.split(command) == ["r2sego", "refine", str(moved)]


def test_scores_of_an_asset_that_changed_are_not_told(scene):
    def made(text):
        Runner(scene).step("asset.ply", lambda file: file.write_text(text), parameters=text)

    made("an asset")
    scene.report_folder.mkdir()
    scores = {"arms": {"refined": {"psnr": 21.0, "ssim": 0.7}}, "assets": scene.outputs()}
    scene.metrics_file.write_text(json.dumps(scores))
    assert "  refined        PSNR 21.00 dB, SSIM 0.700" in lines(describe(scene))
    made("another")
    told = describe(scene)
    assert told["metrics_outdated"] and not any("PSNR" in line for line in lines(told))
    assert any("r2sego evaluate" in line for line in lines(told))


def test_rounds_beyond_those_that_are_declared_are_not_counted(scene):
    counts = dict.fromkeys(("rollouts_succeeded", "rollouts_failed", "candidates", "targets", "views_kept"), 1)
    for index in range(2):
        folder = scene.round_folder(index)
        folder.mkdir(parents=True)
        (folder / "asset.ply").touch()
        (folder / "metrics.json").write_text(json.dumps(counts))
    assert "rounds: 2 of 3 done" in lines(describe(scene))
    assert "rounds: 1 of 1 done" in lines(describe(scene.declare(overrides={"rounds": 1})))
    (scene.round_folder(1) / "metrics.json").unlink()  # as where a refinement is cut off before it
    assert "rounds: 1 of 3 done" in lines(describe(scene)) and not describe(scene)["refined"]
