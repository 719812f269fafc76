"""A wrong floor, tilt or metre put right by one similarity, in captures, points and declaration."""

from __future__ import annotations

import errno
import json
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from measured_points import measured
from progress_recorder import ProgressRecorder
from scipy.spatial.transform import Rotation

from r2sego_blender import whole_files
from r2sego_blender.asset_edits import AssetEdit, save_edit
from r2sego_blender.cameras import Camera, look_at
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.correction_history import CORRECTIONS
from r2sego_blender.captures.floor_points import FloorPoint, ground_of, ground_through
from r2sego_blender.captures.picks import Pick, PickedLength, PickedPoint, Picks
from r2sego_blender.captures.scale import Scale
from r2sego_blender.captures.sparse import SparsePoints
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.cli import main
from r2sego_blender.correction import (
    correct_by_picks,
    correct_registration,
    correct_to_frame,
    undo_correction,
)
from r2sego_blender.errors import CaptureError, GeometryError, SceneError
from r2sego_blender.images import save_image
from r2sego_blender.plan import plan_refinement
from r2sego_blender.robot.model import EMBEDDED_HUMANOID, RobotModel
from r2sego_blender.robot.scope import BehaviourScope
from r2sego_blender.robot_declaration import declare_robot
from r2sego_blender.scene import Declaration, Scene, content_digest
from r2sego_blender.splats.regions import Box
from r2sego_blender.status import describe
from r2sego_blender.status import lines as status_lines
from r2sego_blender.world_frame import of_old_frame, require_present_frame

ROOT = Path(__file__).parents[1]
LENS = Camera(160, 120, 110.0, 112.0, 78.0, 61.0, np.eye(4))
FLOOR = np.array([[-0.8, 1.0, 0.0], [0.9, 1.1, 0.0], [0.3, 2.4, 0.0], [-0.5, 2.0, 0.0]])


def _truth(count=4):
    """Cameras over a floor at z = 0, the first above the origin and heading along x."""
    poses = [look_at([0.4 * i, 0.1 * i, 1.4 + 0.05 * i], [0.1, 1.7, 0.1]) for i in range(count)]
    heading = poses[0][:3, 2]
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("z", -np.arctan2(heading[1], heading[0])).as_matrix()
    return turn, [LENS.at(turn @ pose) for pose in poses]


def _sparse(cameras, turn):
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 25), np.linspace(0.6, 3.0, 25))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) @ turn[:3, :3].T
    return measured(points, cameras, least_views=2)


def _wrong(seed=0, scale=1.0, tilt_deg=5.0):
    """What took the true world to a wrong one."""
    rng = np.random.default_rng(seed)
    similarity = np.eye(4)
    axis = rng.normal(size=3) * [1, 1, 0.2]
    turn = Rotation.from_rotvec(np.radians(tilt_deg) * axis / np.linalg.norm(axis))
    similarity[:3, :3] = scale * turn.as_matrix()
    similarity[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    return similarity


def _scene(folder, similarity, source="metric poses"):
    turn, cameras = _truth()
    captures = []
    for index, camera in enumerate(cameras):
        save_image(
            folder / f"p{index}.png", np.random.default_rng(index).random((120, 160, 3)).astype(np.float32)
        )
        captures.append(Capture(f"p{index}.jpg", folder / f"p{index}.png", camera.transformed(similarity)))
    sparse = _sparse(cameras, turn).transformed(similarity)

    def fill(place: Path) -> None:
        save_captures(place / "captures", captures, sparse)
        (place / "captures" / "masks").mkdir()
        (place / "captures" / "masks" / "chair.png").write_bytes(b"drawn by hand")

    declared = Declaration("photographs", tuple(map(tuple, (2.0 * np.diag([1, 1, 1, 0.5])).tolist())),
                           ground="no floor seen", scale_source=source)  # fmt: skip
    return Scene.create(folder / "room.r2s", declared, fill), turn, cameras


def _shown(turn, cameras, spots=FLOOR, views=(0, 2)):
    """The pixels a person would click."""
    spots = spots @ turn[:3, :3].T
    return [FloorPoint(tuple((f"p{v}", tuple(cameras[v].project(spot)[0])) for v in views)) for spot in spots]


def _assert_true(scene, cameras, places_m=1e-6):
    for capture, camera in zip(load_captures(scene.captures_folder), cameras, strict=True):
        assert np.abs(capture.camera.world_from_camera - camera.world_from_camera).max() < places_m
        assert (capture.camera.fx, capture.camera.fy, capture.camera.cx) == (110.0, 112.0, 78.0)


@pytest.mark.parametrize("views", [(0, 2), (0, 1, 3), (1,)])
def test_floor_points_put_a_tilted_world_right(tmp_path, views):
    scene, turn, cameras = _scene(tmp_path, _wrong())
    before = load_captures(scene.captures_folder)
    made = correct_registration(scene, floor=_shown(turn, cameras, views=views))
    # In one photograph the point is on the surface of its sparse points, whose slope is held back.
    _assert_true(made, cameras, 1e-6 if len(views) > 1 else 3e-3)
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


def test_images_and_masks_stay_as_they_are(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong())
    images = content_digest(scene.captures_folder / "images")
    made = correct_registration(scene, floor=_shown(turn, cameras))
    assert content_digest(made.captures_folder / "images") == images
    assert (made.captures_folder / "masks" / "chair.png").read_bytes() == b"drawn by hand"
    assert [p.name for p in scene.path.iterdir() if p.name.startswith(".unfinished")] == []


def _with_all_that_moves(folder):
    scene, turn, cameras = _scene(folder, _wrong())
    save_edit(scene, AssetEdit("edit_001", (Box(np.eye(4), np.ones(3)),)))
    (scene.path / "objects" / "chair").mkdir(parents=True)
    place = {"world_from_own": np.eye(4).tolist(), "locked": True}
    (scene.path / "objects" / "chair" / "placement.json").write_text(json.dumps(place))
    square = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
    return declare_robot(scene, changes={"region.within": square}), _shown(turn, cameras)


@pytest.mark.parametrize("swaps", range(7))
def test_a_correction_that_is_killed_is_finished_by_the_next_command(tmp_path, monkeypatch, swaps):
    scene, shown = _with_all_that_moves(tmp_path)
    other = Scene.open(shutil.copytree(scene.path, tmp_path / "other.r2s"))
    correct_registration(other, floor=shown)
    left, swap_in = [None] * swaps, whole_files.swap_in

    def killed(made, place):
        if not left:
            raise KeyboardInterrupt
        left.pop()
        swap_in(made, place)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(whole_files, "swap_in", killed)
        correct_registration(scene, floor=shown)
    assert content_digest(scene.path) != content_digest(other.path)
    with (
        pytest.raises(SceneError, match="had been cut off, and is finished now"),
        scene.locked(),
    ):
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
        patched.setattr("r2sego_blender.correction.save_ground_pictures", full)
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
    scene, turn, cameras = _scene(tmp_path, _wrong())
    runs = []

    def step(made):
        made.step("geometry/heights.txt", lambda place: (runs.append(1), place.write_text("x")),
                  inputs=["captures"])  # fmt: skip

    step(scene)
    step(scene)
    assert len(runs) == 1
    step(correct_registration(scene, floor=_shown(turn, cameras)))
    assert len(runs) == 2


def _as_if_refined(scene):
    """Results with the inputs they have, made as the steps make them."""

    def write(name, *inputs):
        def compute(place):
            place = place if place.suffix else place / "proxy.npz"
            place.write_text(f"{name} {scene.declaration.world_from_capture}")

        scene.step(name, compute, inputs=inputs)

    write("geometry/depth", "captures")
    for index in range(2):
        write(f"rounds/{index}/proxy", "geometry/depth")
        write(f"rounds/{index}/asset.ply", f"rounds/{index}/proxy")
        counts = dict.fromkeys(
            ("rollouts_succeeded", "rollouts_failed", "candidates", "targets", "views_kept"), 1
        )
        scene.step(
            f"rounds/{index}/metrics.json", lambda file, told=json.dumps(counts): file.write_text(told),
            inputs=[f"rounds/{index}/asset.ply"],
        )  # fmt: skip
    write("asset.ply", "rounds/1/asset.ply")
    write("collision", "rounds/1/proxy")


def test_what_a_correction_left_behind_is_told_and_not_used(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong())
    scene = scene.declare(overrides={"rounds": 2})
    _as_if_refined(scene)
    told = describe(scene)
    assert told["refined"] and told["of_old_frame"] == "" and of_old_frame(scene) == ()
    require_present_frame(scene, ["asset.ply", "not there"], "exported")

    corrected = correct_registration(scene, floor=_shown(turn, cameras))
    told = describe(corrected)
    assert not told["refined"] and told["rounds_of_old_frame"] == [0, 1]
    words = "of the world frame before its correction: rounds 0, 1, asset, collision surface"
    assert words in status_lines(told) and status_lines(told)[-1].startswith("next: r2sego refine")
    assert words in CliRunner().invoke(main, ["status", str(scene.path)]).output
    planned = {one.target: one.why for one in plan_refinement(corrected)}
    assert planned["geometry/depth"] == "the world frame was corrected"
    frozen = tmp_path / "cameras.json"
    frozen.write_text("{}")
    given = scene.captures_folder / "cameras.json"
    for command in (
        ["export", "--to", tmp_path / "out"],
        ["evaluate", "--frozen", frozen],
        ["texture"],
        ["render", "--cameras", given, "--to", tmp_path / "out"],
    ):
        refused = CliRunner().invoke(main, [command[0], str(scene.path), *map(str, command[1:])])
        assert refused.exit_code == 1 and "was corrected since it was made" in refused.output, refused.output
        assert "r2sego refine" in refused.output and "--undo" in refused.output
    assert not (tmp_path / "out").exists()

    # What is made of an old result is old too; what is made anew is not.
    corrected.step("textured.glb", lambda file: file.write_text("x"), inputs=["asset.ply"])
    assert "textured.glb" in of_old_frame(corrected)
    corrected.step("geometry/depth", lambda folder: (folder / "new").touch(), inputs=["captures"])
    corrected.step("rounds/0/proxy", lambda folder: (folder / "new").touch(), inputs=["geometry/depth"])
    assert not {"geometry/depth", "rounds/0/proxy"} & set(of_old_frame(corrected))
    assert describe(corrected)["rounds_of_old_frame"] == [0, 1]  # its asset is still as it was
    _as_if_refined(corrected)
    told = describe(corrected)
    assert told["refined"] and told["of_old_frame"] == ""


def test_a_correction_taken_back_makes_its_results_good_again(tmp_path):
    scene, _, _ = _scene(tmp_path, _wrong())
    _as_if_refined(scene)
    corrected = correct_registration(correct_registration(scene, floor_at_m=0.1), floor_at_m=0.2)
    assert "asset.ply" in of_old_frame(corrected)
    once = undo_correction(corrected)
    assert "asset.ply" in of_old_frame(once)
    assert of_old_frame(undo_correction(once)) == ()


def test_of_results_without_a_noted_frame_nothing_is_said(tmp_path):
    """As journals were written before."""
    scene, _, _ = _scene(tmp_path, _wrong())
    _as_if_refined(scene)
    file = scene.path / "journal.jsonl"
    records = [json.loads(line) for line in file.read_text().splitlines()]
    assert all(record.pop("frame") for record in records)
    file.write_text("".join(json.dumps(record) + "\n" for record in records))
    corrected = correct_registration(scene, floor_at_m=0.1)
    assert of_old_frame(corrected) == () and describe(corrected)["of_old_frame"] == ""


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), tilt_deg=st.floats(0.0, 40.0), count=st.integers(3, 4))
def test_any_tilt_is_undone(seed, tilt_deg, count):
    turn, cameras = _truth()
    similarity = _wrong(seed, tilt_deg=tilt_deg)
    captures = [Capture(f"p{i}", None, c.transformed(similarity)) for i, c in enumerate(cameras)]
    spots = FLOOR[:count] @ turn[:3, :3].T
    points = []
    for spot in spots:
        views = [(i, cameras[i].project(spot)[0]) for i in (0, 3)]
        points.append(_Shown(captures, views))
    ground = ground_through(captures, None, points)
    up = similarity[:3, :3] @ [0, 0, 1]
    assert np.degrees(np.arccos(np.clip(ground.normal @ up, -1, 1))) < 1e-4
    assert np.abs(ground.height([similarity[:3, :3] @ s + similarity[:3, 3] for s in spots])).max() < 1e-7


class _Shown:
    """A floor point whose photographs are not on disk."""

    def __init__(self, captures, views) -> None:
        self.captures, self.views = captures, views

    def place(self, captures, sparse):
        from r2sego_blender.captures.lifting import intersection

        point = intersection([self.captures[i].camera for i, _ in self.views], [p for _, p in self.views])
        return point, 1e-4 * np.eye(3)


def test_one_point_tells_the_height_alone(tmp_path):
    lowered = np.eye(4)
    lowered[2, 3] = -0.4
    scene, turn, cameras = _scene(tmp_path, lowered)
    made = correct_registration(scene, floor=_shown(turn, cameras)[:1])
    _assert_true(made, cameras)
    assert "height of 1 floor point shown" in made.declaration.ground


def test_up_and_height_by_hand(tmp_path):
    similarity = _wrong(3, tilt_deg=8.0)
    scene, _, cameras = _scene(tmp_path, similarity)
    up = similarity[:3, :3] @ [0.0, 0.0, 1.0]
    at = float(up @ similarity[:3, 3] / up[2])  # where the floor crosses the z-axis of now
    made = correct_registration(scene, up=tuple(3.0 * up), floor_at_m=at)
    _assert_true(made, cameras)
    again = correct_registration(made, up=(0, 0, 1))
    _assert_true(again, cameras)


def test_a_scale_is_corrected_without_moving_the_floor(tmp_path):
    scene, _, cameras = _scene(tmp_path, np.diag([1.7, 1.7, 1.7, 1.0]), source="assumed: held 1.5 m high")
    made = correct_registration(scene, scale=Scale.camera_height(float(cameras[0].centre[2]), "robot's eye"))
    _assert_true(made, cameras)
    assert made.declaration.ground == "no floor seen"
    assert made.declaration.scale_source == "robot's eye height of 1.4 m"


def test_a_scale_that_hung_on_the_old_floor_is_pointed_out(tmp_path):
    for source, warned in (
        ("assumed: held 1.5 m", True),
        ("camera height of 1.4 m", True),
        ("metric", False),
    ):
        folder = tmp_path / source[:5]
        folder.mkdir()
        scene, turn, cameras = _scene(folder, _wrong(), source=source)
        told = ProgressRecorder()
        made = correct_registration(scene, floor=_shown(turn, cameras), progress=told)
        assert any("the scale is kept" in text for text in told.warnings) is warned
        assert made.declaration.scale_source == source


def test_floor_and_scale_together(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong(5, scale=0.6))
    scale = Scale.camera_height(float(cameras[0].centre[2]))
    _assert_true(correct_registration(scene, floor=_shown(turn, cameras), scale=scale), cameras)


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
    scene, _, _ = _scene(tmp_path, _wrong())
    before = content_digest(scene.path)
    floor = [FloorPoint.parse(text) for text in wanted.pop("floor", ())]
    with pytest.raises(CaptureError, match=message):
        correct_registration(scene, floor=floor, **wanted)
    (scene.path / ".lock").unlink(missing_ok=True)
    assert content_digest(scene.path) == before


def test_an_unsure_point_counts_for_little_and_an_unsure_tilt_is_said():
    """Two photographs a hand apart hardly place a point: it must not tilt the floor."""
    turn, cameras = _truth()
    captures = [Capture(f"p{i}", None, camera) for i, camera in enumerate(cameras)]
    spots = np.vstack([FLOOR, [[0.9, 2.6, 0.12]]]) @ turn[:3, :3].T
    placed = [_Placed(spot, sigma) for spot, sigma in zip(spots, [0.004] * 4 + [0.2], strict=True)]
    told = ProgressRecorder()
    ground = ground_through(captures, None, placed, told)
    assert np.degrees(np.arccos(ground.normal[2])) < 0.05 and abs(ground.offset) < 1e-3
    assert not told.warnings
    unsure = ground_through(captures, None, [_Placed(spot, 0.1) for spot in spots[:4]], told)
    assert "tilt sure to" in unsure.description and any("one point alone" in text for text in told.warnings)


class _Placed:
    def __init__(self, point, sigma) -> None:
        self.point, self.sigma = point, sigma

    def place(self, captures, sparse):
        return self.point, self.sigma**2 * np.eye(3)


def test_photographs_that_show_different_points_are_told(tmp_path):
    scene, turn, cameras = _scene(tmp_path, np.eye(4))
    a, b = (_shown(turn, cameras, FLOOR[i : i + 1])[0].views for i in (0, 3))
    with pytest.raises(CaptureError, match=r"do not show one point.*pixels away in p"):
        correct_registration(scene, floor=[FloorPoint((a[0], b[1]))])


def test_floor_points_in_a_line_or_off_a_plane_are_refused(tmp_path):
    scene, turn, cameras = _scene(tmp_path, np.eye(4))
    line = np.array([[-0.5, 1.2, 0], [0.0, 1.5, 0], [0.5, 1.8, 0]])
    with pytest.raises(CaptureError, match="in one line"):
        correct_registration(scene, floor=_shown(turn, cameras, line))
    bent = FLOOR + np.array([[0, 0, 0.5], [0, 0, 0], [0, 0, 0.5], [0, 0, 0]])
    with pytest.raises(CaptureError, match="off one plane"):
        correct_registration(scene, floor=_shown(turn, cameras, bent))


@pytest.mark.parametrize("text", ["p0", "p0:1", "p0:1,2,3", "p0:a,b", "p0:1,2=", "="])
def test_floor_points_are_parsed_strictly(text):
    with pytest.raises(CaptureError, match="floor points"):
        FloorPoint.parse(text)
    assert FloorPoint.parse("a:b:1,2=c:3,4").views == (("a:b", (1.0, 2.0)), ("c", (3.0, 4.0)))


def test_a_scene_in_use_is_left_alone(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong())
    with scene.locked(), ThreadPoolExecutor(1) as another:
        correcting = another.submit(correct_registration, scene, floor=_shown(turn, cameras))
        with pytest.raises(SceneError, match="another process"):
            correcting.result()


def test_the_ground_by_hand_says_what_was_given():
    captures = [Capture("p", None, LENS.at(look_at([0, 0, 1.5], [1, 0, 1])))]
    assert "up was (0.0000, 0.0000, 1.0000), -0.100 m" in ground_of(captures, None, -0.1).description


def test_the_command_line_corrects_with_the_robots_eye(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong())
    floor = []
    for point in _shown(turn, cameras):
        floor += ["--floor", "=".join(f"{photo}:{x!r},{y!r}" for photo, (x, y) in
                                      ((p, map(float, xy)) for p, xy in point.views))]  # fmt: skip
    command = [sys.executable, "-m", "r2sego_blender", "register", str(scene.path), *floor,
               "--camera-height", "robot", "--json-progress"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    robot = RobotModel.load(EMBEDDED_HUMANOID)
    assert told["scale"] == f"robot's eye height of {robot.eye_height_m:.4g} m"
    first = load_captures(scene.captures_folder)[0].camera
    assert first.centre == pytest.approx([0, 0, robot.eye_height_m], abs=1e-6)
    failed = subprocess.run([*command[:5], "--up", "north"], capture_output=True, text=True, cwd=ROOT)
    assert failed.returncode == 1 and "'north' is not X,Y,Z" in failed.stderr


def test_the_robots_eye_is_where_mujoco_has_it():
    robot = RobotModel.load(EMBEDDED_HUMANOID)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.rest_qpos
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_camlight(robot.model, data)
    assert robot.eye_height_m == pytest.approx(data.cam("head_camera").xpos[2], abs=1e-9)


def _picks(turn, cameras, metres=None, views=(0, 2, 3)):
    names = "ABCD"
    points = tuple(
        PickedPoint(
            name,
            tuple(Pick(f"p{v}.jpg", *map(float, cameras[v].project(spot)[0])) for v in views),
            floor=True,
        )
        for name, spot in zip(names, FLOOR @ turn[:3, :3].T, strict=True)
    )
    length = float(np.linalg.norm(FLOOR[0] - FLOOR[1])) if metres is None else metres
    return Picks(points, (PickedLength("A", "B", length),))


def test_picks_put_tilt_and_scale_right_at_once(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong(7, scale=0.4))
    made, fit = correct_by_picks(scene, _picks(turn, cameras))
    _assert_true(made, cameras)
    assert "4 floor points shown" in made.declaration.ground
    assert made.declaration.scale_source == "1 known length shown, right to 0.0 cm"
    assert fit.metres_per_unit == pytest.approx(2.5)
    again, fit = correct_by_picks(made, _picks(turn, cameras))
    assert fit.metres_per_unit == pytest.approx(1.0)
    _assert_true(again, cameras)


def test_picks_that_tell_nothing_or_contradict_change_nothing(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong())
    before = content_digest(scene.path)
    picks = _picks(turn, cameras)
    with pytest.raises(CaptureError, match="neither the floor nor a scale"):
        correct_by_picks(scene, Picks((replace(picks.points[0], floor=False),)))
    with pytest.raises(CaptureError, match="the others say"):
        correct_by_picks(scene, replace(picks, lengths=(*picks.lengths, PickedLength("C", "D", 9.0))))
    (scene.path / ".lock").unlink(missing_ok=True)
    assert content_digest(scene.path) == before


def test_corrections_are_taken_back_one_by_one(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong(2, scale=1.6))
    before = load_captures(scene.captures_folder)
    points = SparsePoints.load(scene.captures_folder / "sparse.npz").points
    first, _ = correct_by_picks(scene, _picks(turn, cameras))
    second = correct_registration(first, floor_at_m=0.2)
    undone = undo_correction(second)
    _assert_true(undone, cameras)
    assert undone.declaration == first.declaration
    undone = undo_correction(undone)
    assert undone.declaration == scene.declaration
    for capture, earlier in zip(load_captures(scene.captures_folder), before, strict=True):
        np.testing.assert_allclose(
            capture.camera.world_from_camera, earlier.camera.world_from_camera, atol=1e-9
        )
    np.testing.assert_allclose(
        SparsePoints.load(scene.captures_folder / "sparse.npz").points, points, atol=1e-9
    )
    with pytest.raises(CaptureError, match="no correction to take back"):
        undo_correction(undone)


@pytest.mark.parametrize("text", ["{", "[1]", '[{"new_from_old": [[1]]}]'])
def test_a_damaged_history_is_named(tmp_path, text):
    scene, _, _ = _scene(tmp_path, np.eye(4))
    (scene.path / CORRECTIONS).write_text(text)
    with pytest.raises(CaptureError, match=r"corrections\.json"):
        undo_correction(scene)


def test_a_frame_placed_by_hand_becomes_the_world(tmp_path):
    scene, _, cameras = _scene(tmp_path, np.eye(4))
    frame = _wrong(9, scale=1.25, tilt_deg=3.0)
    frame[2, 3] = -0.1
    made = correct_to_frame(scene, frame)
    there = np.linalg.inv(frame)
    for capture, camera in zip(load_captures(made.captures_folder), cameras, strict=True):
        np.testing.assert_allclose(capture.camera.centre, (there @ [*camera.centre, 1.0])[:3], atol=1e-9)
    assert made.declaration.scale_source == "metric poses; then a metre became 0.8 m by hand"
    assert "placed by hand" in made.declaration.ground
    _assert_true(undo_correction(made), cameras)


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
    scene, _, _ = _scene(tmp_path, np.eye(4))
    with pytest.raises(CaptureError, match=message):
        correct_to_frame(scene, frame)


def test_the_command_line_takes_picks_a_frame_and_an_undo(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong(1, scale=2.0))
    file = tmp_path / "picks.json"
    file.write_text(json.dumps(_picks(turn, cameras).to_json()))

    def register(*options):
        command = ["register", str(scene.path), *options]
        return CliRunner().invoke(main, command)

    command = [sys.executable, "-m", "r2sego_blender", "register", str(scene.path), "--picks", str(file)]
    done = subprocess.run([*command, "--json-progress"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["residuals"]["lengths"][0]["error_m"] == pytest.approx(0.0, abs=1e-6)
    _assert_true(Scene.open(scene.path), cameras)
    assert register("--frame", "1,0,0,0.5,0,1,0,0,0,0,1,0").exit_code == 0
    moved = load_captures(scene.captures_folder)[0].camera.centre
    np.testing.assert_allclose(moved, cameras[0].centre - [0.5, 0, 0], atol=1e-6)
    assert register("--undo").exit_code == 0
    _assert_true(Scene.open(scene.path), cameras)
    for wrong, said in (
        (["--undo", "--floor-at", "1"], "in two ways"),
        (["--frame", "1,2"], "not 12 numbers"),
        (["--picks", str(tmp_path / "none.json")], "cannot be read"),
    ):
        refused = register(*wrong)
        assert refused.exit_code == 1 and said in refused.output


def test_the_robots_region_goes_along_and_comes_back(tmp_path):
    scene, turn, cameras = _scene(tmp_path, _wrong(6, scale=0.5))
    region = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    declared = declare_robot(scene, changes={"region.within": region})
    made, _ = correct_by_picks(declared, _picks(turn, cameras))
    within = BehaviourScope.load(made.declaration.scope).region.within
    assert Path(made.declaration.scope).parent.parent == scene.path.absolute()
    sides = np.linalg.norm(np.subtract(within, np.roll(within, -1, axis=0)), axis=1)
    np.testing.assert_allclose(sides, 2.0, rtol=0.01)  # a metre became two; the tilt shortens a little
    similarity = np.array(json.loads((scene.path / CORRECTIONS).read_text())[0]["new_from_old"])
    np.testing.assert_allclose(within[0], similarity[:2, 3], atol=1e-6)
    undone = undo_correction(made)
    back = BehaviourScope.load(undone.declaration.scope).region.within
    np.testing.assert_allclose(back, region, atol=0.02)
