"""Gravity, floor, origin, heading and scale from points with a known transform."""

from __future__ import annotations

import re
import tracemalloc

import cv2
import numpy as np
import pytest
from expected_errors import refused
from hypothesis import example, given, settings
from hypothesis import strategies as st
from measured_points import measured
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frame.ground import _contrast, _contrast_of_parallels, find_ground, up_guess
from r2sego_blender.captures.frame.scale import Scale, require_marker
from r2sego_blender.captures.frame.world_frame import register
from r2sego_blender.captures.importing import Imported
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

SETTINGS = CaptureSettings()
LENS = Camera(640, 480, 400.0, 400.0, 320.0, 240.0, np.eye(4))


def _furnished(rng, floor=250, table=900, noise_m=0.006):
    """Points of a room: floor, a denser table, two walls, clutter, and wrong ones."""

    def plane(count, low, high):
        return rng.uniform(low, high, (count, 3)) + rng.normal(0, noise_m, (count, 3))

    return np.concatenate(
        [
            plane(floor, [-2, -1, 0], [2, 2, 0]),
            plane(table, [-0.6, 0, 0.74], [0.7, 0.8, 0.74]),
            plane(300, [-2, 2, 0], [2, 2, 2.4]),
            plane(200, [2, -1, 0], [2, 2, 2.4]),
            rng.uniform([-0.6, 0, 0.05], [0.7, 0.8, 0.7], (120, 3)),
            rng.uniform([-2, -2, -0.4], [2, 3, 2.5], (60, 3)),
        ]
    )


def _held(rng, count=6):
    """Cameras held by hand: headings of a quarter circle, looking down, rolled a little."""
    cameras = []
    for angle in np.linspace(-0.8, 0.8, count):
        centre = np.array([2.2 * np.sin(angle), -2.2 * np.cos(angle), 1.5 + rng.normal(0, 0.04)])
        pose = look_at(centre, [0, 0.6, rng.uniform(0.4, 0.9)])
        roll = Rotation.from_euler("z", rng.normal(0, 2.5), degrees=True).as_matrix()
        pose[:3, :3] = pose[:3, :3] @ roll
        cameras.append(LENS.at(pose))
    return cameras


def _level(rng, count=6):
    """Cameras all around, rolled by half a degree."""
    cameras = []
    for angle in np.linspace(0.0, 2.0 * np.pi, count, endpoint=False):
        centre = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), 1.5 + rng.normal(0, 0.04)])
        pose = look_at(centre, [3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.8])
        roll = Rotation.from_euler("z", rng.normal(0, 0.5), degrees=True).as_matrix()
        pose[:3, :3] = pose[:3, :3] @ roll
        cameras.append(LENS.at(pose))
    return cameras


def _scene(cameras, points):
    captures = tuple(Capture(f"p{i}", None, camera) for i, camera in enumerate(cameras))
    return captures, measured(points, cameras)


def _moved(captures, sparse, similarity):
    return tuple(capture.transformed(similarity) for capture in captures), sparse.transformed(similarity)


def _similarity(rng, scale):
    similarity = np.eye(4)
    similarity[:3, :3] = scale * Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    similarity[:3, 3] = rng.uniform(-5, 5, 3)
    return similarity


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.05, 20.0))
def test_any_similarity_of_the_capture_frame_is_undone(seed, scale):
    rng = np.random.default_rng(seed)
    captures, sparse = _scene(_held(rng), _furnished(rng))
    height_m = float(captures[0].camera.centre[2])
    moved, points = _moved(captures, sparse, _similarity(rng, scale))
    found = register(Imported(moved, "test", False), points, Scale.camera_height(height_m), SETTINGS)
    factor = np.cbrt(np.linalg.det(found.world_from_capture[:3, :3]))
    rotation = found.world_from_capture[:3, :3] / factor
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-9
    # A floor of 250 points, noise of 6 mm and clutter tell up to 0.5 degrees at the worst.
    assert factor == pytest.approx(1 / scale, rel=0.03)
    assert "floor plane" in found.ground
    world = found.captures(moved)
    assert np.abs(world[0].camera.centre - [0, 0, height_m]).max() < 1e-6
    assert abs(world[0].camera.forward[1]) < 1e-9
    heading = captures[0].camera.forward
    turn = Rotation.from_euler("z", -np.arctan2(heading[1], heading[0])).as_matrix()
    for truth, capture in zip(captures, world, strict=True):
        expected = turn @ (truth.camera.centre - captures[0].camera.centre * [1, 1, 0])
        assert np.linalg.norm(capture.camera.centre - expected) < 0.1
        assert (
            np.degrees(
                rotation_angle_rad(turn @ truth.camera.world_from_camera[:3, :3], capture.camera.world_from_camera)
            )
            < 1.0
        )


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), turn_deg=st.floats(0.0, 360.0), height_m=st.floats(0.5, 2.5))
def test_without_a_point_the_floor_lies_the_given_height_under_the_first_camera(seed, turn_deg, height_m):
    rng = np.random.default_rng(seed)
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    turned[:3, 3] = rng.uniform(-5, 5, 3)
    captures = tuple(Capture(f"p{i}", None, one).transformed(turned) for i, one in enumerate(_level(rng)))
    scale = Scale.camera_height(height_m)
    found = register(Imported(captures, "test", True), SparsePoints.none(len(captures)), scale, SETTINGS)
    world = found.captures(captures)
    assert np.abs(world[0].camera.centre - [0.0, 0.0, height_m]).max() < 1e-9
    assert abs(np.linalg.det(found.world_from_capture[:3, :3]) - 1.0) < 1e-9
    rises = [b.camera.centre[2] - a.camera.centre[2] for a, b in zip(captures, world, strict=True)]
    assert np.ptp(rises) < 1e-9  # an axis of the poses is up, whatever the cameras' roll


def test_without_a_point_poses_of_no_unit_are_refused(rng):
    captures = tuple(Capture(f"p{i}", None, camera) for i, camera in enumerate(_held(rng)))
    for scale in (Scale(), Scale.camera_height(1.4)):
        with pytest.raises(CaptureError, match="scale"):
            register(Imported(captures, "test", False), SparsePoints.none(len(captures)), scale, SETTINGS)


def test_the_same_points_give_the_same_registration(rng):
    captures, sparse = _scene(_held(rng), _furnished(rng))
    first, second = (register(Imported(captures, "t", True), sparse, Scale(), SETTINGS) for _ in range(2))
    assert first.world_from_capture.tobytes() == second.world_from_capture.tobytes()


@pytest.mark.parametrize(
    ("scale", "metric", "factor"),
    [(Scale.metric(), False, 1.0), (Scale(), True, 1.0), (Scale("measured", metres=0.4), True, 0.4)],
)
def test_declared_and_measured_units_are_taken_as_they_are(rng, scale, metric, factor):
    captures, sparse = _scene(_held(rng), _furnished(rng))
    found = register(Imported(captures, "test", metric), sparse, scale, SETTINGS).world_from_capture
    assert np.cbrt(np.linalg.det(found[:3, :3])) == pytest.approx(factor, rel=1e-12)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), floor=st.integers(90, 400))
@example(357, 221)  # seven points of a wall's foot tilted it by 0.84 degrees
def test_a_floor_of_few_points_wins_over_a_dense_table(seed, floor):
    rng = np.random.default_rng(seed)
    ground = find_ground(_furnished(rng, floor=floor), _held(rng), 0.03)
    assert ground.found
    assert abs(ground.offset) < 0.01
    assert np.degrees(np.arccos(ground.normal[2])) < 0.5


def test_the_floor_of_many_points_is_found_in_little_memory(rng):
    """As hundreds of photographs give them: a table of all points and planes would be a gigabyte."""
    points = np.concatenate([_furnished(rng) for _ in range(12)])
    tracemalloc.start()
    ground = find_ground(points, _held(rng), 0.03)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert ground.found and abs(ground.offset) < 0.01 and len(points) > 20_000
    assert peak < 60e6


@pytest.mark.parametrize("unit", [1.0, 0.02])
def test_planes_of_one_normal_are_told_apart_as_others_are(rng, unit):
    points = unit * _furnished(rng)
    normal = np.array([0.05, -0.02, 0.9985])
    normals, offsets = np.repeat(normal[None], len(points), axis=0), points @ normal
    one_by_one = _contrast(points, normals, offsets, 0.03 * unit)
    together = _contrast_of_parallels(points, normals, offsets, 0.03 * unit)
    assert np.array_equal(together, one_by_one) and np.ptp(together) > 100


def _tilt_deg(found):
    """Of up in the capture frame, whose z-axis truly is up."""
    up = found.world_from_capture[2, :3] / np.linalg.norm(found.world_from_capture[2, :3])
    return np.degrees(np.arccos(np.clip(up[2], -1.0, 1.0)))


def test_without_a_floor_the_table_tells_gravity_and_the_lowest_points_the_height(rng, messages):
    points = _furnished(rng, floor=0)
    captures, sparse = _scene(_held(rng), points)
    found = register(Imported(captures, "test", False), sparse, Scale(), SETTINGS, messages)
    assert found.ground.startswith("no floor seen")
    assert any("add a photograph" in warning for warning in messages.warnings)
    assert _tilt_deg(found) < 1.0
    assert abs(found.world_from_capture[2, 3]) < 0.2


def _leaning(rng, lowest_m):
    """Points of a surface that leans by 6 degrees, of what stands under it, and of a wall, none under ``lowest_m``."""
    x, y = rng.uniform([-0.6, 0], [0.7, 0.8], (900, 2)).T
    under = rng.uniform([-0.6, 0, lowest_m], [0.7, 0.8, 0.5], (300, 3))
    wall = rng.uniform([-2, 2, lowest_m], [2, 2, 2.4], (300, 3))
    return np.concatenate([np.stack([x, y, 0.66 + 0.1 * x], axis=1), under, wall])


@pytest.mark.parametrize(("lowest_m", "off_m"), [(0.3, 0.0), (-0.25, -0.25)])
def test_metric_poses_without_a_floor_are_upright_as_their_frame_and_at_a_usual_height(rng, tmp_path, lowest_m, off_m):
    """Lower than usual where points are: the floor cannot be above them. The photographs are black."""
    captures, sparse = _scene(_held(rng), _leaning(rng, lowest_m))
    captures = _photographed(tmp_path, captures)
    found = register(Imported(captures, "test", True), sparse, Scale(), SETTINGS)
    assert found.ground.startswith("no floor seen")
    assert found.world_from_capture[2, 2] == pytest.approx(1.0, abs=1e-12)
    assert -found.world_from_capture[2, 3] == pytest.approx(off_m, abs=0.1)
    solved = register(Imported(captures, "test", False), sparse, Scale(), SETTINGS)
    assert _tilt_deg(solved) > 3.0


def test_points_that_are_no_numbers_tell_no_height(rng, tmp_path):
    captures, sparse = _scene(_held(rng), np.concatenate([_leaning(rng, -0.25), np.full((5, 3), np.nan)]))
    captures = _photographed(tmp_path, captures)
    found = register(Imported(captures, "test", True), sparse, Scale(), SETTINGS)
    assert np.isfinite(found.world_from_capture).all()


def test_without_points_the_cameras_tell_gravity():
    rng = np.random.default_rng(3)
    ground = find_ground(np.zeros((0, 3)), _held(rng), 0.03)
    assert not ground.found
    assert np.degrees(np.arccos(ground.normal[2])) < 5.0


def test_cameras_that_look_down_do_not_tilt_the_guess_of_up():
    cameras = [LENS.at(look_at([2 * np.cos(a), 2 * np.sin(a), 2.5], [0.5, 0, 0])) for a in (0, 1, 2)]
    assert np.degrees(np.arccos(up_guess(cameras)[2])) < 4.0
    assert up_guess(cameras[:1])[2] > 0.5


def test_points_as_near_as_is_set_belong_to_the_floor(rng):
    captures, sparse = _scene(_held(rng), _furnished(rng, noise_m=0.01))
    support = []
    for tolerance_m in (0.005, 0.04):
        found = register(
            Imported(captures, "test", True), sparse, Scale.automatic(), CaptureSettings(floor_tolerance_m=tolerance_m)
        )
        support.append(int(re.fullmatch(r"floor plane through (\d+) points", found.ground)[1]))
    assert support[0] < 150 and support[1] > 230  # of 250: within half a standard deviation, and four


def test_the_assumed_scale_is_said_loudly(rng, messages):
    captures, sparse = _scene(_held(rng), _furnished(rng))
    moved, points = _moved(captures, sparse, _similarity(rng, 3.0))
    found = register(Imported(moved, "test", False), points, Scale(), SETTINGS, messages)
    assert found.scale_source.startswith("assumed")
    assert any("assumed" in warning for warning in messages.warnings)
    heights = [capture.camera.centre[2] for capture in found.captures(moved)]
    assert np.median(heights) == pytest.approx(1.5)


def test_looking_straight_down_still_gives_a_heading(rng):
    cameras = _held(rng)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = [0.1, 0.5, 2.0]
    captures, sparse = _scene([LENS.at(pose), *cameras], _furnished(rng))
    found = register(Imported(captures, "test", True), sparse, Scale(), SETTINGS)
    assert np.isfinite(found.world_from_capture).all()
    assert found.captures(captures)[0].camera.world_from_camera[0, 1] < -0.99


def _photographed(tmp_path, captures):
    stored = []
    for capture in captures:
        path = tmp_path / f"{capture.name}.png"
        save_image(path, np.zeros((960, 1280, 3), np.uint8))
        stored.append(Capture(f"{capture.name}.png", path, capture.camera))
    return tuple(stored)


def test_a_known_length_tells_the_scale(rng, tmp_path):
    captures, sparse = _scene(_held(rng), _furnished(rng))
    ends = np.array([[-0.5, 0.1, 0.74], [0.6, 0.7, 0.74]])
    length_m = float(np.linalg.norm(ends[0] - ends[1]))
    pixels = captures[2].camera.project(ends)[0] * 2.0  # the file is twice the working size
    moved, points = _moved(captures, sparse, _similarity(rng, 0.3))
    moved = _photographed(tmp_path, moved)
    scale = Scale.known_length("p2.png", tuple(pixels[0]), tuple(pixels[1]), length_m)
    found = register(Imported(moved, "test", False), points, scale, SETTINGS)
    factor = np.cbrt(np.linalg.det(found.world_from_capture[:3, :3]))
    assert factor == pytest.approx(1 / 0.3, rel=0.015)
    assert "known length" in found.scale_source


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        (Scale.known_length("nobody.png", (1, 1), (9, 9), 1.0), "no capture 'nobody.png'"),
        (Scale.known_length("p2.png", (1, 1), (9999, 9), 1.0), "outside the 1280x960"),
        (Scale.known_length("p2.png", (500, 600), (500, 600), 1.0), "same point"),
        (Scale.marker(0.2), "found in 0 captures"),
    ],
)
def test_scales_that_cannot_be_measured_are_refused(rng, tmp_path, scale, message):
    captures, sparse = _scene(_held(rng), _furnished(rng))
    imported = Imported(_photographed(tmp_path, captures), "test", False)
    with pytest.raises(CaptureError, match=message):
        register(imported, sparse, scale, SETTINGS)


@pytest.mark.parametrize("metres", [0.0, -1.0, float("nan"), float("inf")])
def test_lengths_that_are_none_are_refused(metres):
    with refused(CaptureError, "camera_height", "no length"):
        Scale.camera_height(metres)


def test_a_marker_tells_the_scale(rng, room, room_cameras, tmp_path):
    """A marker of 30 cm painted on the wall behind, in photographs of an unknown unit."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    marker = np.pad(cv2.aruco.generateImageMarker(dictionary, 17, 240), 40, constant_values=255)
    corners = np.array([[-0.2, 2.0, 1.2], [0.2, 2.0, 1.2], [0.2, 2.0, 0.8], [-0.2, 2.0, 0.8]])
    captures = []
    for index, camera in enumerate(room_cameras[:4]):
        camera = camera.scaled(2.0)
        image = (room.image(camera) * 255).astype(np.uint8)
        place = (camera.project(corners)[0] - 0.5).astype(np.float32)
        source = np.array([[0, 0], [320, 0], [320, 320], [0, 320]], np.float32) - 0.5
        turn = cv2.getPerspectiveTransform(source, place)
        painted = cv2.warpPerspective(np.repeat(marker[..., None], 3, 2), turn, image.shape[1::-1])
        mask = cv2.warpPerspective(np.full((320, 320), 255, np.uint8), turn, image.shape[1::-1]) > 127
        image[mask] = painted[mask]
        path = tmp_path / f"p{index}.png"
        save_image(path, image)
        captures.append(Capture(path.name, path, camera.scaled(0.5)))
    moved = tuple(capture.transformed(_similarity(np.random.default_rng(2), 4.0)) for capture in captures)
    _, sparse = _scene([capture.camera for capture in moved], rng.uniform(-1, 1, (5, 3)))
    found = register(Imported(moved, "test", False), sparse, Scale.marker(0.3), SETTINGS)
    factor = np.cbrt(np.linalg.det(found.world_from_capture[:3, :3]))
    assert factor == pytest.approx(1 / 4.0, rel=0.01)
    assert "marker 17" in found.scale_source
    photographs = [capture.image_path for capture in captures]
    require_marker(photographs[:2], Scale.marker(0.3, marker_id=17))
    with refused(CaptureError, "scale, marker", "in 1 capture,"):
        require_marker(photographs[:1], Scale.marker(0.3))
    with refused(CaptureError, "scale, marker", "in 0 captures,"):
        require_marker(photographs, Scale.marker(0.3, marker_id=3))
