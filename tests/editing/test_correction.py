"""A wrong floor, tilt or metre put right by one similarity, in captures, points and declaration."""

from __future__ import annotations

import errno
import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from progress_recorder import ProgressRecorder
from wrong_world import FLOOR, assert_true, picked_points, shown_points, wrong_scene, wrong_similarity

from r2sego_blender.bundle.layout import BEFORE_CORRECTIONS, CORRECTIONS
from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.frame.floor_points import FloorPoint
from r2sego_blender.captures.frame.picks import PickedLength, Picks
from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.sensors.sensor_maps import SENSOR_DEPTH, SensorMap
from r2sego_blender.captures.sparse_points import SPARSE, SparsePoints
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.core import atomic_files
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import CaptureError, GeometryError, SceneError
from r2sego_blender.editing.correction import correct_by_picks, correct_registration, correct_to_frame, undo_correction
from r2sego_blender.editing.robot_declaration import declare_robot
from r2sego_blender.robot.scope.scope import BehaviourScope
from r2sego_blender.splats.asset_edits import AssetEdit, save_edit
from r2sego_blender.splats.regions import Box


@pytest.mark.parametrize("views", [(0, 2), (0, 1, 3), (1,)])
def test_floor_points_put_a_tilted_world_right(tmp_path, views):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    before = load_captures(scene.captures_folder)
    made = correct_registration(scene, floor=shown_points(turn, cameras, views=views))
    # In one photograph the point is on the surface of its sparse points, whose slope is held back.
    assert_true(made, cameras, 1e-6 if len(views) > 1 else 3e-3)
    points = SparsePoints.load(made.captures_folder / "sparse.npz").points
    assert np.abs(points[:, 2]).max() < (1e-6 if len(views) > 1 else 5e-3)
    assert "4 floor points shown" in made.declaration.ground
    assert Scene.open(scene.path).declaration == made.declaration
    assert len(list((scene.path / "report" / "ground").glob("*.png"))) == len(cameras)
    # The declaration takes the frame of the given poses to the new world, as it did to the old.
    from_given = np.array(made.declaration.world_from_capture)
    old = np.array(scene.declaration.world_from_capture)
    for capture, earlier in zip(load_captures(made.captures_folder), before, strict=True):
        given = np.linalg.inv(old) @ [*earlier.camera.centre, 1.0]
        assert np.abs((from_given @ given)[:3] - capture.camera.centre).max() < 1e-9


def test_what_a_sensor_measured_goes_along_and_comes_back(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    captures = load_captures(scene.captures_folder)
    depth = np.full(captures[1].camera.shape, 2.0, np.float32)
    measured = SensorMap(depth, 0.01 * depth, captures[1].camera)
    save_captures(scene.captures_folder, captures, scene.read(SPARSE), {captures[1].name: measured})
    before = content_digest(scene.captures_folder / "depth")
    made = correct_registration(scene, floor=shown_points(turn, cameras))
    moved, new = made.read(SENSOR_DEPTH).found(captures, 1), load_captures(made.captures_folder)[1].camera
    old_from_new = np.array(scene.declaration.world_from_capture) @ np.linalg.inv(made.declaration.world_from_capture)
    scale = 1.0 / np.cbrt(np.linalg.det(old_from_new[:3, :3]))
    assert np.allclose(moved.depth, 2.0 * scale) and np.allclose(moved.sigma, 0.02 * scale)
    assert np.allclose(moved.camera.world_from_camera, new.world_from_camera)
    assert made.read(SENSOR_DEPTH).found(captures, 0) is None
    assert content_digest(undo_correction(made).captures_folder / "depth") == before


def test_images_and_masks_stay_as_they_are(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    images = content_digest(scene.captures_folder / "images")
    made = correct_registration(scene, floor=shown_points(turn, cameras))
    assert content_digest(made.captures_folder / "images") == images
    assert (made.captures_folder / "masks" / "chair.png").read_bytes() == b"drawn by hand"
    assert [p.name for p in scene.path.iterdir() if p.name.startswith(".unfinished")] == []


def _with_all_that_moves(folder):
    scene, turn, cameras = wrong_scene(folder, wrong_similarity())
    save_edit(scene, AssetEdit("edit_001", (Box(np.eye(4), np.ones(3)),)))
    (scene.path / "objects" / "chair").mkdir(parents=True)
    place = {"world_from_own": np.eye(4).tolist(), "locked": True}
    (scene.path / "objects" / "chair" / "placement.json").write_text(json.dumps(place))
    square = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
    return declare_robot(scene, changes={"region.within": square}), shown_points(turn, cameras)


@pytest.mark.parametrize("swaps", range(8))
def test_a_correction_that_is_killed_is_finished_by_the_next_command(tmp_path, monkeypatch, swaps):
    scene, shown = _with_all_that_moves(tmp_path)
    other = Scene.open(shutil.copytree(scene.path, tmp_path / "other.r2s"))
    correct_registration(other, floor=shown)
    left, swap_in = [None] * swaps, atomic_files.swap_in

    def killed(made, place):
        if not left:
            raise KeyboardInterrupt
        left.pop()
        swap_in(made, place)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(atomic_files, "swap_in", killed)
        correct_registration(scene, floor=shown)
    assert content_digest(scene.path) != content_digest(other.path)
    with pytest.raises(SceneError, match="had been cut off, and is finished now"), scene.locked():
        pass
    assert content_digest(scene.path) == content_digest(other.path)
    with Scene.open(scene.path).locked():
        assert not [p.name for p in scene.path.iterdir() if p.name.startswith((".unfinished", ".changes"))]


def test_a_correction_that_fails_on_the_way_changes_nothing(tmp_path, monkeypatch):
    scene, shown = _with_all_that_moves(tmp_path)
    before = content_digest(scene.path)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched, pytest.raises(SceneError, match="disk is full"):
        patched.setattr("r2sego_blender.editing.correction.save_ground_pictures", full)
        correct_registration(scene, floor=shown)
    (scene.path / "objects" / "chair" / "placement.json").write_text("{")
    with pytest.raises(GeometryError, match=r"room\.r2s.objects.chair.placement\.json"):
        correct_registration(scene, floor=shown)
    (scene.path / "objects" / "chair" / "placement.json").write_text(
        json.dumps({"world_from_own": np.eye(4).tolist(), "locked": True})
    )
    assert content_digest(scene.path) == before
    assert Scene.open(scene.path).declaration == scene.declaration


def test_what_depends_on_the_captures_is_redone(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    runs = []

    def step(made):
        Runner(made).step(
            "geometry/heights.txt", lambda place: (runs.append(1), place.write_text("x")), inputs=["captures"]
        )

    step(scene)
    step(scene)
    assert len(runs) == 1
    step(correct_registration(scene, floor=shown_points(turn, cameras)))
    assert len(runs) == 2


def test_one_point_tells_the_height_alone(tmp_path):
    lowered = np.eye(4)
    lowered[2, 3] = -0.4
    scene, turn, cameras = wrong_scene(tmp_path, lowered)
    made = correct_registration(scene, floor=shown_points(turn, cameras)[:1])
    assert_true(made, cameras)
    assert "height of 1 floor point shown" in made.declaration.ground


def test_up_and_height_by_hand(tmp_path):
    similarity = wrong_similarity(3, tilt_deg=8.0)
    scene, _, cameras = wrong_scene(tmp_path, similarity)
    up = similarity[:3, :3] @ [0.0, 0.0, 1.0]
    at = float(up @ similarity[:3, 3] / up[2])  # where the floor crosses the z-axis of now
    made = correct_registration(scene, up=tuple(3.0 * up), floor_at_m=at)
    assert_true(made, cameras)
    again = correct_registration(made, up=(0, 0, 1))
    assert_true(again, cameras)
    # Who has opened the scene before goes on from where it is now.
    assert_true(correct_registration(scene, up=(0, 0, 1)), cameras)
    assert_true(scene.declare(preset="preview"), cameras)


def test_a_scale_is_corrected_without_moving_the_floor(tmp_path):
    scene, _, cameras = wrong_scene(tmp_path, np.diag([1.7, 1.7, 1.7, 1.0]), source="assumed: held 1.5 m high")
    made = correct_registration(scene, scale=Scale.camera_height(float(cameras[0].centre[2]), "robot's eye"))
    assert_true(made, cameras)
    assert made.declaration.ground == "no floor seen"
    assert made.declaration.scale_source == "robot's eye height of 1.4 m"


def test_a_scale_that_hung_on_the_old_floor_is_pointed_out(tmp_path):
    for source, warned in (("assumed: held 1.5 m", True), ("camera height of 1.4 m", True), ("metric", False)):
        folder = tmp_path / source[:5]
        folder.mkdir()
        scene, turn, cameras = wrong_scene(folder, wrong_similarity(), source=source)
        told = ProgressRecorder()
        made = correct_registration(scene, floor=shown_points(turn, cameras), progress=told)
        assert any("the scale is kept" in text for text in told.warnings) is warned
        assert made.declaration.scale_source == source


def test_floor_and_scale_together(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity(5, scale=0.6))
    scale = Scale.camera_height(float(cameras[0].centre[2]))
    assert_true(correct_registration(scene, floor=shown_points(turn, cameras), scale=scale), cameras)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({}, "nothing is to be corrected"),
        ({"floor": ["p0:80,60"], "up": (0, 0, 1)}, "given twice"),
        ({"floor": ["p9:80,60"]}, "no capture 'p9'"),
        ({"floor": ["p0:800,60"]}, "outside the 160x120"),
        ({"floor": ["p0:80,60=p0:80,60"]}, "one place only"),
        ({"up": (0, 0, 0)}, "no direction"),
        ({"up": (0, 0, -1)}, "above the camera"),
        ({"floor_at_m": 30.0}, "above the camera"),
        ({"floor_at_m": float("nan")}, "no direction"),
    ],
)
def test_what_cannot_be_corrected_changes_nothing(tmp_path, wanted, message):
    scene, _, _ = wrong_scene(tmp_path, wrong_similarity())
    before = content_digest(scene.path)
    floor = [FloorPoint.parse(text) for text in wanted.pop("floor", ())]
    with pytest.raises(CaptureError, match=message):
        correct_registration(scene, floor=floor, **wanted)
    (scene.path / ".lock").unlink(missing_ok=True)
    assert content_digest(scene.path) == before


def test_photographs_that_show_different_points_are_told(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, np.eye(4))
    a, b = (shown_points(turn, cameras, FLOOR[i : i + 1])[0].views for i in (0, 3))
    with pytest.raises(CaptureError, match=r"do not show one point.*pixels away in p"):
        correct_registration(scene, floor=[FloorPoint((a[0], b[1]))])


def test_floor_points_in_a_line_or_off_a_plane_are_refused(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, np.eye(4))
    line = np.array([[-0.5, 1.2, 0], [0.0, 1.5, 0], [0.5, 1.8, 0]])
    with pytest.raises(CaptureError, match="in one line"):
        correct_registration(scene, floor=shown_points(turn, cameras, line))
    bent = FLOOR + np.array([[0, 0, 0.5], [0, 0, 0], [0, 0, 0.5], [0, 0, 0]])
    with pytest.raises(CaptureError, match="off one plane"):
        correct_registration(scene, floor=shown_points(turn, cameras, bent))


def test_a_scene_in_use_is_left_alone(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    with scene.locked(), ThreadPoolExecutor(1) as another:
        correcting = another.submit(correct_registration, scene, floor=shown_points(turn, cameras))
        with pytest.raises(SceneError, match="another process"):
            correcting.result()


def test_picks_put_tilt_and_scale_right_at_once(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity(7, scale=0.4))
    made, fit = correct_by_picks(scene, picked_points(turn, cameras))
    assert_true(made, cameras)
    assert "4 floor points shown" in made.declaration.ground
    assert made.declaration.scale_source == "1 known length shown, right to 0.0 cm"
    assert fit.metres_per_unit == pytest.approx(2.5)
    again, fit = correct_by_picks(made, picked_points(turn, cameras))
    assert fit.metres_per_unit == pytest.approx(1.0)
    assert_true(again, cameras)


def test_picks_that_tell_nothing_or_contradict_change_nothing(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    before = content_digest(scene.path)
    picks = picked_points(turn, cameras)
    with pytest.raises(CaptureError, match="neither the floor nor a scale"):
        correct_by_picks(scene, Picks((replace(picks.points[0], floor=False),)))
    with pytest.raises(CaptureError, match="the others say"):
        correct_by_picks(scene, replace(picks, lengths=(*picks.lengths, PickedLength("C", "D", 9.0))))
    (scene.path / ".lock").unlink(missing_ok=True)
    assert content_digest(scene.path) == before


def test_corrections_are_taken_back_one_by_one(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity(2, scale=1.6))
    before = load_captures(scene.captures_folder)
    points = SparsePoints.load(scene.captures_folder / "sparse.npz").points
    first, _ = correct_by_picks(scene, picked_points(turn, cameras))
    second = correct_registration(first, floor_at_m=0.2)
    undone = undo_correction(second)
    assert_true(undone, cameras)
    assert undone.declaration == first.declaration
    undone = undo_correction(undone)
    assert undone.declaration == scene.declaration
    for capture, earlier in zip(load_captures(scene.captures_folder), before, strict=True):
        np.testing.assert_allclose(capture.camera.world_from_camera, earlier.camera.world_from_camera, atol=1e-9)
    np.testing.assert_allclose(SparsePoints.load(scene.captures_folder / "sparse.npz").points, points, atol=1e-9)
    with pytest.raises(CaptureError, match="no correction to take back"):
        undo_correction(undone)


def _moved_parts(scene):
    parts = ("captures", "objects", "asset_edits", "robot/scope.toml")
    return {part: content_digest(scene.path / part) for part in parts}


def test_what_a_taken_back_correction_moved_is_to_the_bit_as_before(tmp_path):
    scene, shown = _with_all_that_moves(tmp_path)
    before = _moved_parts(scene)
    first = correct_registration(scene, floor=shown)
    between = _moved_parts(first)
    second = correct_registration(first, floor_at_m=0.1, up=(0.1, 0.2, 1.0))
    assert not before.items() & between.items() and not between.items() & _moved_parts(second).items()
    undone = undo_correction(second)
    assert _moved_parts(undone) == between
    assert _moved_parts(undo_correction(undone)) == before
    assert not [file for file in (scene.path / BEFORE_CORRECTIONS).rglob("*") if file.is_file()]


def test_what_was_changed_after_a_correction_is_moved_back_and_not_lost(tmp_path):
    scene, shown = _with_all_that_moves(tmp_path)
    place = scene.path / "objects" / "chair" / "placement.json"
    made = correct_registration(scene, floor=shown)
    changed = json.loads(place.read_text())
    raised = np.array(changed["world_from_own"])
    raised[:3, 3] += 1.0
    place.write_text(json.dumps(changed | {"world_from_own": raised.tolist()}))
    new_from_old = np.array(json.loads((scene.path / CORRECTIONS).read_text())[0]["new_from_old"])
    undo_correction(made)
    found = np.array(json.loads(place.read_text())["world_from_own"])
    np.testing.assert_allclose(found, np.linalg.inv(new_from_old) @ raised, atol=1e-9)


@pytest.mark.parametrize(
    "text", ["{", "[1]", '[{"new_from_old": [[1]]}]', None], ids=["cut off", "a number", "a scale", "made"]
)
def test_a_damaged_history_is_named(tmp_path, text):
    scene, _, _ = wrong_scene(tmp_path, np.eye(4))
    if text is None:
        correct_registration(scene, floor_at_m=-0.1)
        text = json.dumps([one | {"made": 1} for one in json.loads((scene.path / CORRECTIONS).read_text())])
    (scene.path / CORRECTIONS).write_text(text)
    with pytest.raises(CaptureError, match=r"corrections\.json"):
        undo_correction(scene)


def test_a_frame_placed_by_hand_becomes_the_world(tmp_path):
    scene, _, cameras = wrong_scene(tmp_path, np.eye(4))
    frame = wrong_similarity(9, scale=1.25, tilt_deg=3.0)
    frame[2, 3] = -0.1
    made = correct_to_frame(scene, frame)
    there = np.linalg.inv(frame)
    for capture, camera in zip(load_captures(made.captures_folder), cameras, strict=True):
        np.testing.assert_allclose(capture.camera.centre, (there @ [*camera.centre, 1.0])[:3], atol=1e-9)
    assert made.declaration.scale_source == "metric poses; then a metre became 0.8 m by hand"
    assert "placed by hand" in made.declaration.ground
    assert_true(undo_correction(made), cameras)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (np.diag([1.0, 1.0, -1.0, 1.0]), "no pose with one scale"),
        (np.diag([1.0, 2.0, 1.0, 1.0]), "no pose with one scale"),
        (np.diag([1.0, -1.0, -1.0, 1.0]), "above the camera"),
        (np.full((4, 4), np.nan), "no pose"),
        (np.eye(3), "no pose"),
    ],
)
def test_what_is_no_frame_is_refused(tmp_path, frame, message):
    scene, _, _ = wrong_scene(tmp_path, np.eye(4))
    with pytest.raises(CaptureError, match=message):
        correct_to_frame(scene, frame)


def test_a_scale_that_no_room_has_is_refused_and_changes_nothing(tmp_path):
    scene, _, cameras = wrong_scene(tmp_path, np.eye(4))
    with pytest.raises(CaptureError, match="would lie"):
        correct_to_frame(scene, np.diag([1e-10, 1e-10, 1e-10, 1.0]))
    assert_true(Scene.open(scene.path), cameras)


def test_the_robots_region_goes_along_and_comes_back(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity(6, scale=0.5))
    region = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    declared = declare_robot(scene, changes={"region.within": region})
    made, _ = correct_by_picks(declared, picked_points(turn, cameras))
    within = BehaviourScope.load(made.declaration.scope).region.within
    assert Path(made.declaration.scope).parent.parent == scene.path.absolute()
    sides = np.linalg.norm(np.subtract(within, np.roll(within, -1, axis=0)), axis=1)
    np.testing.assert_allclose(sides, 2.0, rtol=0.01)  # a metre became two; the tilt shortens a little
    similarity = np.array(json.loads((scene.path / CORRECTIONS).read_text())[0]["new_from_old"])
    np.testing.assert_allclose(within[0], similarity[:2, 3], atol=1e-6)
    undone = undo_correction(made)
    back = BehaviourScope.load(undone.declaration.scope).region.within
    np.testing.assert_allclose(back, region, atol=0.02)
