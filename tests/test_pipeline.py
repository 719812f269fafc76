"""Algorithm 1 from end to end on the demo room, small: what every round leaves, and that it repeats."""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from demo_views import write_first_views
from progress_recorder import ProgressRecorder
from step_reads import KeysOnly, WatchedRunner, another

from r2sego_blender.bundle.figures import COUNTS
from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import load_captures
from r2sego_blender.commands.cli import main
from r2sego_blender.config.presets import entries
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.progress import Progress
from r2sego_blender.evaluation.arms import ARMS, DEFAULT_ARMS, WITHOUT_GENERATED
from r2sego_blender.evaluation.scene_evaluation import evaluate_scene
from r2sego_blender.evaluation.scene_report import write_scene_report
from r2sego_blender.evaluation.trained_arms import train_without_generated_views
from r2sego_blender.generation.decisions import save_decision
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.results.export import export_scene
from r2sego_blender.results.plan import outlook, parts_outdated, plan_refinement
from r2sego_blender.results.status import describe, lines
from r2sego_blender.splats.formats.ply import load_ply
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.views.selection import Selection
from tools.benchmarks.kills import ROOM

pytestmark = pytest.mark.slow

SMALL = {
    "rounds": 2,
    "stereo.max_side_px": 160,
    "stereo.iterations": 3,
    "stereo.geometric_rounds": 1,
    "proxy.voxel_m": 0.06,
    "collision.tolerance_m": 0.1,
    "collision.carrying_tolerance_m": 0.1,
    "collision.min_cell_m": 0.2,
    "rollouts.successes": 2,
    "selection.target_views": 3,
    "selection.scoring_scale": 0.25,
    "generation.clip_frames": 4,
    "training.steps_per_round": 60,
    "training.max_gaussians": 20000,
}

CAPTURES = CaptureSettings(max_side_px=240, matcher="sift")


@pytest.fixture(scope="module")
def watched(tmp_path_factory) -> WatchedRunner:
    """The demo room, refined for two rounds at a quarter of the images' size, and what its steps read."""
    scene = create_scene(
        tmp_path_factory.mktemp("pipeline") / "room.r2s", ROOM / "captures", ROOM / "cameras.json", settings=CAPTURES
    )
    runner = WatchedRunner(scene.declare(overrides=SMALL))
    refine(runner.scene, runner=runner)
    return runner


@pytest.fixture(scope="module")
def small_room(watched) -> Scene:
    """The refined room."""
    return watched.scene


def test_a_step_reads_only_what_its_key_knows(watched):
    """Else it would be passed over although something that it reads has changed."""
    for target, files in watched.files.items():
        inputs = tuple(map(Path, watched.inputs[target]))
        assert all(any(Path(file).is_relative_to(known) for known in inputs) for file in files), target
    assert {"rounds/0/proxy/proxy.npz", "geometry/backdrop.ply"} < watched.files["rounds/0/asset.ply"]
    assert {target: names for target, names in watched.variables.items() if names} == {}
    before = KeysOnly(watched.scene)
    refine(before.scene, runner=before)
    assert set(before.keys) == set(watched.files)
    missed = set()
    for entry in entries(before.scene.declaration.settings):
        after = KeysOnly(watched.scene, **{entry.key: another(entry)})
        refine(after.scene, runner=after)
        if not entry.changes_result:
            assert not after.redone(before), entry.key
            continue
        reading = {target for target, settings in watched.settings.items() if entry.key in settings}
        missed |= {(target, entry.key) for target in reading - after.redone(before)}
    # The backdrop's views have a share of detail, as all that are lifted: it makes nothing of it.
    assert missed == {("geometry/backdrop.ply", "training.detailed_share")}


def test_every_round_leaves_what_it_did(small_room):
    for index in range(2):
        folder = small_room.round_folder(index)
        rollouts = json.loads((folder / "rollouts" / "rollouts.json").read_text())
        assert sum(r["success"] for r in rollouts["rollouts"]) == 2
        assert all(r["reason"] for r in rollouts["rollouts"] if not r["success"])
        with np.load(folder / "selection" / "selection.npz") as selection:
            np.testing.assert_allclose(selection["score"], selection["deficit"] * selection["availability"])
            assert 1 <= selection["chosen"].sum() <= 3
        for view in (folder / "views").iterdir():
            pose = json.loads((view / "pose.json").read_text())
            assert pose["reason"] and pose["query"] != pose["estimate"]
            generated = not pose["reason"].startswith("rejected: not generated")
            assert len(list((view / "clip").glob("*"))) == (4 if generated else 0)
            assert len(list((view / "conditions").glob("*.exr"))) == (4 if generated else 1)
            assert generated or not pose["accepted"]
        assert json.loads((folder / "metrics.json").read_text())["gaussians"] <= 20000
    assert describe(small_room)["refined"]


def test_the_report_tells_what_was_decided_by_hand(small_room, tmp_path):
    copy = shutil.copytree(small_room.path, tmp_path / "room.r2s")
    view = next(iter(sorted((copy / "rounds/0/views").iterdir())))
    by_gate = json.loads((view / "pose.json").read_text())["accepted"]
    save_decision(view, not by_gate)
    page = write_scene_report(Scene.open(copy)).read_text()
    assert ("rejected by hand" if by_gate else "accepted by hand") in page
    assert ".0 inliers" not in page


def test_the_room_of_a_later_round_has_other_rollouts(small_room):
    first, second = (content_digest(small_room.round_folder(index) / "rollouts" / "rollouts.npz") for index in range(2))
    assert first != second


def test_the_asset_grows_under_its_budget_and_stays_finite(small_room):
    initial = load_ply(small_room.geometry_folder / "initial_asset.ply")
    refined = load_ply(small_room.round_folder(1) / "asset.ply")
    assert len(initial) < len(refined) <= 20000
    assert np.isfinite(refined.means).all() and np.isfinite(refined.sh).all()


def _turned(axis: int, sign: float) -> np.ndarray:
    """A quarter turn about the camera's x- or y-axis: its forward axis becomes one across."""
    turn, other = np.eye(4), 1 - axis
    turn[other, other] = turn[2, 2] = 0.0
    turn[other, 2], turn[2, other] = sign, -sign
    return turn


def test_the_published_asset_is_the_last_round_before_the_backdrop(small_room):
    refined = load_ply(small_room.round_folder(1) / "asset.ply")
    behind = load_ply(small_room.geometry_folder / "backdrop.ply")
    published = load_ply(small_room.asset_file)
    assert len(behind) > 1000
    np.testing.assert_array_equal(published.means, np.concatenate([refined.means, behind.means]))
    camera = load_captures(small_room.captures_folder)[0].camera
    # Where the captures look the asset is: it leaves the other sides empty, first those that a robot turns to.
    around = (np.diag([-1.0, 1.0, -1.0, 1.0]), *(_turned(1, sign) for sign in (1.0, -1.0)))
    above_and_below = [_turned(0, sign) for sign in (1.0, -1.0)]
    views = [camera.at(camera.world_from_camera @ turn) for turn in (*around, *above_and_below)]
    missing, left = (
        np.array([(render(asset, view).alpha < 0.5).mean() for view in views]) for asset in (refined, published)
    )
    emptiest = missing[: len(around)].argmax()
    assert missing[emptiest] > 0.1 and left[emptiest] < missing[emptiest] / 20
    assert left.sum() < missing.sum() / 20


def test_refining_again_does_nothing_and_an_edit_redoes_what_depends_on_it(small_room, tmp_path):
    scene = Scene.open(shutil.copytree(small_room.path, tmp_path / "copy.r2s"))
    ran = len(scene.journal())
    refine(scene)
    assert len(scene.journal()) == ran
    proxy_file = scene.round_folder(1) / "proxy" / "proxy.npz"
    proxy = GeometryProxy.load(proxy_file)
    dataclasses.replace(proxy, confidence=proxy.confidence * 0.5).save(proxy_file)
    refine(scene)
    redone = {record["step"] for record in scene.journal()[ran:]}
    assert "rounds/1/collision" in redone and "rounds/1/asset.ply" in redone
    assert not any(step.startswith(("geometry/", "rounds/0/")) for step in redone)


def test_a_damaged_result_is_made_again_as_it_was(small_room, tmp_path):
    scene = Scene.open(shutil.copytree(small_room.path, tmp_path / "copy.r2s"))
    for target in (
        "geometry/depth/*.npz",
        "geometry/initial_asset.ply",
        "geometry/observed.npz",
        "geometry/planes.npz",
        "geometry/completed/*.npz",
        "geometry/backdrop.ply",
        "geometry/priors/priors.json",
        "rounds/1/proxy/proxy.npz",
        "rounds/1/collision/mesh.obj",
        "rounds/1/rollouts/*.npz",
        "rounds/1/selection/candidates.json",
        "rounds/1/views/*/pose.json",
        "rounds/1/asset.ply",
        "asset.ply",
        "collision/scene.urdf",
    ):
        file = sorted(scene.path.glob(target))[0]
        whole = file.read_bytes()
        file.write_bytes(whole[: len(whole) // 2])
        damaged = [step.target for step in plan_refinement(scene) if step.why == "it is damaged"]
        assert len(damaged) == 1 and file.relative_to(scene.path).is_relative_to(damaged[0]), target
        file.write_bytes(whole)
    for target in ("rounds/1/proxy/proxy.npz", "rounds/1/asset.ply", "collision/mesh.obj"):
        file = scene.path / target
        file.write_bytes(file.read_bytes()[:1000])
    ran = len(scene.journal())
    refine(scene)
    redone = [record["step"] for record in scene.journal()[ran:]]
    assert redone == ["rounds/1/proxy", "rounds/1/asset.ply", "collision"]
    for name in ("rounds", "collision", "asset.ply"):
        assert content_digest(scene.path / name) == content_digest(small_room.path / name), name


def test_the_commands_of_a_round_do_nothing_twice(small_room):
    ran = len(small_room.journal())
    for command in ("rollouts", "select"):
        said = CliRunner().invoke(main, [command, str(small_room.path), "--round", "0", "--json"])
        assert said.exit_code == 0, said.output
        assert json.loads(said.output[said.output.index("{\n") :])["round"] == 0
    assert len(small_room.journal()) == ran


def test_the_same_seed_gives_the_same_bundle_also_in_two_goes(small_room, tmp_path):
    again = create_scene(tmp_path / "room.r2s", ROOM / "captures", ROOM / "cameras.json", settings=CAPTURES).declare(
        overrides=SMALL
    )
    refine(again, until="rounds/0/selection")
    assert [record["step"] for record in again.journal()][-2:] == ["rounds/0/rollouts", "rounds/0/selection"]
    refine(again)
    for name in ("scene.toml", "captures", "geometry", "rounds", "collision", "asset.ply"):
        assert content_digest(again.path / name) == content_digest(small_room.path / name), name


def test_the_ablations_stand_in_the_bundle(small_room, tmp_path):
    scene = Scene.open(shutil.copytree(small_room.path, tmp_path / "copy.r2s"))
    switches = {"selection.candidates": "flight", "selection.ranking": "random", "selection.geometry": "ignored"}
    scene = scene.declare(overrides=SMALL | switches)
    refine(scene, until="rounds/0/selection")
    rollouts = json.loads((scene.round_folder(0) / "rollouts" / "rollouts.json").read_text())["rollouts"]
    assert [rollout["controller"] for rollout in rollouts] == ["camera_flight"] * 2
    selection = Selection.load(scene.round_folder(0) / "selection")
    whole = Selection.load(small_room.round_folder(0) / "selection")
    assert selection.ablations == tuple(f"{key} = {value}" for key, value in switches.items())
    assert whole.ablations == ()
    assert len(selection.score) == len(whole.score)
    assert (selection.availability == 1.0).all()
    assert len(selection.targets) == 3


def test_where_no_view_is_kept_the_arm_without_generated_views_is_the_refined_asset(small_room, tmp_path):
    """To the bit, round by round; and it changes nothing else, and is made once."""
    scene = Scene.open(shutil.copytree(small_room.path, tmp_path / "copy.r2s"))
    scene = scene.declare(overrides=SMALL | {"registration.min_inliers": 10000})
    refine(scene)
    assert [scene.read(COUNTS.of_round(index))["views_kept"] for index in range(2)] == [0, 0]
    before = scene.outputs()
    train_without_generated_views(scene)
    arm = (scene.path / ARMS[WITHOUT_GENERATED].asset).parent
    for name in ("rounds/0/proxy", "rounds/0/asset.ply", "rounds/1/proxy", "rounds/1/asset.ply", "asset.ply"):
        assert content_digest(arm / name) == content_digest(scene.path / name), name
    assert not list(arm.glob("rounds/*/views")) and scene.outputs().items() >= before.items()
    journal = scene.journal()
    train_without_generated_views(scene)
    assert scene.journal() == journal


class NoFloorLater(Runner):
    """In round 1 a box stands on the whole floor."""

    def do(self, step):
        def blocked(place: Path) -> None:
            step.compute(place)
            file = place / "scene.xml"
            box = '<worldbody><geom type="box" size="50 50 0.5" pos="0 0 0.6"/></worldbody></mujoco>'
            file.write_text(file.read_text().replace("</mujoco>", box))

        super().do(dataclasses.replace(step, compute=blocked) if step.target == "rounds/1/collision" else step)


def test_a_later_round_without_floor_goes_on_with_the_rollouts_before(small_room, tmp_path):
    scene = Scene.open(shutil.copytree(small_room.path, tmp_path / "copy.r2s"))
    shutil.rmtree(scene.path / "rounds/1")
    told = ProgressRecorder()
    refine(scene, told, runner=NoFloorLater(scene))
    first, second = (content_digest(scene.round_folder(index) / "rollouts" / "rollouts.npz") for index in range(2))
    assert first == second and describe(scene)["refined"]
    assert any("rounds/1/collision/scene.xml" in message for message in told.warnings)


def test_evaluation_scores_every_arm_and_writes_the_report(small_room, tmp_path):
    metrics = evaluate_scene(small_room, write_first_views(tmp_path, 4))
    assert set(metrics["arms"]) == set(DEFAULT_ARMS)
    for arm in metrics["arms"].values():
        assert len(arm["views"]) == 4 and 5 < arm["psnr"] < 60 and 0 < arm["ssim"] < 1
        assert arm["lpips_alex"] is not None or arm["lpips_reason"]
    assert metrics["arms"]["refined"]["psnr"] > metrics["arms"]["vanilla_3dgs"]["psnr"]
    page = (small_room.report_folder / "index.html").read_text()
    assert "vanilla 3DGS" in page and "embedded" in page


def test_what_would_be_made_anew_is_not_called_of_one_piece(small_room, tmp_path):
    """Nor refined: a setting changed, and the collision surface is of the old one."""
    assert parts_outdated(small_room) == []
    changed = small_room.declaration.with_settings(None, {"collision.tolerance_m": 0.07})
    scene = Scene(small_room.path, changed)
    outdated = parts_outdated(scene)
    assert {"collision", "rollouts", "asset"} <= set(outdated) and "stereo" not in outdated
    state = describe(scene, outdated=outdated)
    assert not state["refined"]
    assert lines(state)[-2] == f"what they are made of, or a setting, has changed: {', '.join(outdated)}"
    heard: list[tuple[str, str]] = []
    listener = Progress()
    listener.message = lambda text, level: heard.append((level, text))
    export_scene(scene, tmp_path / "old", progress=listener)
    about = (tmp_path / "old" / "about.txt").read_text()
    words = "what made proxy, collision, asset has changed since; they may not belong together"
    (told,) = heard
    assert told[0] == "warning" and words in told[1] and f"Not of one piece: {words}" in about
    export_scene(small_room, tmp_path / "whole")
    assert "of one piece" not in (tmp_path / "whole" / "about.txt").read_text()


def test_a_photograph_that_is_gone_is_told_before_the_next_refine(small_room, tmp_path):
    scene = Scene.open(shutil.copytree(small_room.path, tmp_path / "copy.r2s"))
    assert outlook(scene) == ([], "")
    gone = next((scene.captures_folder / "images").iterdir())
    gone.unlink()
    state = describe(scene, True, *outlook(scene))
    assert str(gone) in state["obstacle"] and any(str(gone) in line for line in lines(state))


def test_export_gives_files_other_tools_read(small_room, tmp_path):
    import mujoco
    import trimesh

    export_scene(small_room, tmp_path / "out")
    assert len(load_ply(tmp_path / "out" / "asset.ply")) == len(load_ply(small_room.asset_file))
    assert len(trimesh.load(tmp_path / "out" / "proxy.ply").faces) > 1000
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "collision" / "scene.xml"))
    assert model.ngeom > 10
