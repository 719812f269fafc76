"""Poses that are a little wrong are put right where the photographs say so, and only there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cameras_file import save_cameras_json
from disturbed_poses import TURN_DEG, with_disturbed_poses
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.importing import Imported, import_captures
from r2sego_blender.captures.pose_adjustment import triangulate_refined
from r2sego_blender.captures.sparse import depth_ranges, triangulate
from r2sego_blender.captures.store import load_captures
from r2sego_blender.config.settings import CaptureSettings, StereoSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.stereo.stereo import dense_stereo
from r2sego_blender.refine.creation import create_scene
from tools.benchmarks.truth.disturbance import disturbed_captures

DEMO = Path(__file__).parents[2] / "demo/room"

SETTINGS = CaptureSettings(max_features=1500)


def _imported(captures, **told) -> Imported:
    return Imported(tuple(captures), "somebody's poses", **({"metric": True} | told))


def _turns_deg(captures, others) -> np.ndarray:
    """(N,) degrees between two sets of captures, less what turns one whole to the other."""
    turns = Rotation.from_matrix(
        [
            b.camera.world_from_camera[:3, :3] @ a.camera.world_from_camera[:3, :3].T
            for a, b in zip(captures, others, strict=True)
        ]
    )
    return np.degrees((turns * turns.mean().inv()).magnitude())


@pytest.fixture
def grey(tmp_path) -> Path:
    """A photograph of nothing."""
    save_image(tmp_path / "grey.png", np.full((300, 400, 3), 0.5, np.float32))
    return tmp_path / "grey.png"


@pytest.fixture(scope="module")
def disturbed(room_captures):
    return with_disturbed_poses(room_captures, np.random.default_rng(5))


@pytest.fixture(scope="module")
def refined(disturbed):
    return triangulate_refined(_imported(disturbed), SETTINGS)


def test_wrong_poses_are_put_right_and_it_is_told(refined, disturbed, room_captures):
    imported, sparse = refined
    assert _turns_deg(imported.captures, room_captures).max() < 0.06
    assert _turns_deg(disturbed, room_captures).mean() > 0.2
    told = re.fullmatch(
        r"somebody's poses; poses refined from (\d+) tracks: moved by ([\d.]+) cm and ([\d.]+) deg, "
        r"at most ([\d.]+) and ([\d.]+); reprojection ([\d.]+) -> ([\d.]+) px",
        imported.described,
    )
    tracks, moved_cm, turned_deg, most_cm, most_deg, before_px, after_px = map(float, told.groups())
    moves = [b.camera.centre - a.camera.centre for a, b in zip(disturbed, imported.captures, strict=True)]
    assert moved_cm == pytest.approx(100 * np.linalg.norm(moves, axis=1).mean(), abs=0.051)
    assert most_cm == pytest.approx(100 * np.linalg.norm(moves, axis=1).max(), abs=0.051)
    np.testing.assert_allclose(np.mean(moves, axis=0), 0.0, atol=1e-6)
    assert turned_deg <= most_deg < 2 * TURN_DEG and tracks > 100
    assert after_px < 0.5 < before_px
    assert np.median(sparse.error_px) < 0.5


def test_the_room_is_measured_as_with_right_poses(refined, disturbed, room_captures, room_bounds):
    def off_surface_m(points):
        return np.minimum(np.abs(points - room_bounds[0]), np.abs(points - room_bounds[1])).min(axis=1)

    kept, as_given = triangulate_refined(_imported(disturbed), replace(SETTINGS, refine_poses="never"))
    assert [c.camera for c in kept.captures] == [c.camera for c in disturbed]
    right = triangulate(room_captures, SETTINGS)
    _, sparse = refined
    assert len(sparse.points) > 0.9 * len(right.points)
    assert np.median(off_surface_m(sparse.points)) < 0.7 * np.median(off_surface_m(as_given.points))
    assert (off_surface_m(sparse.points) < 0.05).mean() > 0.85


def test_right_poses_are_kept_to_the_bit_unless_asked(room_captures):
    given = _imported(room_captures)
    imported, sparse = triangulate_refined(given, SETTINGS)
    plain = triangulate(room_captures, SETTINGS)
    assert imported is given
    assert np.array_equal(sparse.points, plain.points)
    assert np.array_equal(sparse.pixels, plain.pixels, equal_nan=True)
    asked, _ = triangulate_refined(given, replace(SETTINGS, refine_poses="always"))
    assert "poses refined" in asked.described
    assert _turns_deg(asked.captures, room_captures).max() < 0.06


def test_poses_that_were_solved_here_are_kept(disturbed):
    given = _imported(disturbed, solved=True, metric=False)
    imported, _ = triangulate_refined(given, replace(SETTINGS, refine_poses="always"))
    assert imported is given


def test_poses_of_another_unit_are_refined_alike(refined, disturbed):
    stretch = np.diag([40.0, 40.0, 40.0, 1.0])
    given = _imported([capture.transformed(stretch) for capture in disturbed], metric=False)
    imported, _ = triangulate_refined(given, SETTINGS)
    metric = [capture.transformed(stretch) for capture in refined[0].captures]
    assert _turns_deg(imported.captures, metric).max() < 0.02
    shift = np.mean(
        [b.camera.centre - a.camera.centre for a, b in zip(given.captures, imported.captures, strict=True)], axis=0
    )
    np.testing.assert_allclose(shift, 0.0, atol=1e-4)


def test_poses_move_no_farther_than_they_may_be_wrong(disturbed, refined, messages):
    """But one that contradicts all others by more than that: it is named, and located from them."""
    sure = replace(SETTINGS, refine_poses="always", pose_sigma_m=1e-4, pose_sigma_deg=0.003)
    imported, _ = triangulate_refined(_imported(disturbed), sure, messages)
    assert "poses refined" in imported.described
    kept = np.array([not any(one.name in text for text in messages.warnings) for one in disturbed])
    assert kept.sum() >= 3
    for captures, which, moves_m, turns_deg in (
        (imported.captures, kept, 1e-3, 0.1),
        (refined[0].captures, np.ones(len(kept), bool), 0.02, 0.5),
    ):
        moved = np.array([a.camera.centre - b.camera.centre for a, b in zip(captures, disturbed, strict=True)])
        assert 0.1 * moves_m < np.linalg.norm(moved, axis=1)[which].max() < moves_m
        assert 0.1 * turns_deg < _turns_deg(captures, disturbed)[which].max() < turns_deg


def test_too_few_tracks_leave_the_poses_as_they_are(disturbed, grey, messages):
    given = _imported([*disturbed[:2], *(replace(capture, image_path=grey) for capture in disturbed[2:])])
    imported, sparse = triangulate_refined(given, replace(SETTINGS, max_features=500, min_matches=200), messages)
    assert imported is given and len(sparse.points) >= 200
    assert any("too few to refine" in warning for warning in messages.warnings)


def test_a_capture_that_sees_nothing_of_the_others_stays(disturbed, grey, messages):
    given = _imported([*disturbed[:4], replace(disturbed[4], image_path=grey)])
    imported, _ = triangulate_refined(given, SETTINGS, messages)
    assert "poses refined" in imported.described
    stayed = imported.captures[4].camera.world_from_camera
    assert np.array_equal(stayed, disturbed[4].camera.world_from_camera)
    assert len(messages.warnings) == 1 and "photo4.png" in messages.warnings[0]


def test_many_captures_are_matched_with_near_ones_alone(room, messages, tmp_path):
    """Forty in a ring look outwards; each sees what six on either side see, too."""
    lens = Camera(160, 120, 160.0, 160.0, 80.0, 60.0, np.eye(4))
    captures = []
    for index, angle in enumerate(np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)):
        outwards = np.array([np.cos(angle), np.sin(angle), 0.0])
        camera = lens.at(look_at((0.0, -0.5, 1.2) + 0.5 * outwards, (0.0, -0.5, 1.1) + 2.0 * outwards))
        path = tmp_path / f"{index:02d}.png"
        save_image(path, room.image(camera))
        captures.append(Capture(path.name, path, camera))
    _, sparse = triangulate_refined(_imported(captures), SETTINGS, messages)
    matched = next(task for task in messages.tasks if task.title == "Matching photographs")
    assert matched.total < 40 * 39 / 2 / 2
    assert sparse.visibility.any(axis=0).all()
    assert np.median(sparse.error_px) < 0.5


def test_poses_that_are_wholly_wrong_are_refused(room_captures):
    opengl = np.diag([1.0, -1, -1, 1])
    turned = [replace(c, camera=c.camera.at(c.camera.world_from_camera @ opengl)) for c in room_captures]
    with pytest.raises(CaptureError, match=r"contradict|axis convention"):
        triangulate_refined(_imported(turned), SETTINGS)


def test_the_same_captures_give_the_same_bits(refined, disturbed):
    imported, sparse = triangulate_refined(_imported(disturbed), SETTINGS)
    for a, b in zip(imported.captures, refined[0].captures, strict=True):
        assert np.array_equal(a.camera.world_from_camera, b.camera.world_from_camera)
    assert np.array_equal(sparse.points, refined[1].points)
    assert imported.described == refined[0].described


def test_a_bundle_is_made_of_refined_poses_and_says_so(disturbed, room_captures, tmp_path):
    save_cameras_json(tmp_path / "cameras.json", disturbed, folder=disturbed[0].image_path.parent)
    folder = disturbed[0].image_path.parent
    scene = create_scene(tmp_path / "room.r2s", folder, tmp_path / "cameras.json", settings=SETTINGS)
    assert scene.declaration.captures_source.startswith("cameras.json; poses refined from ")
    stored = load_captures(scene.captures_folder)
    assert _turns_deg(stored, room_captures).max() < 0.06
    world_from_capture = np.array(scene.declaration.world_from_capture)
    scale = np.cbrt(np.linalg.det(world_from_capture[:3, :3]))
    assert scale == pytest.approx(1.0, abs=1e-12)
    in_world = [capture.transformed(world_from_capture).camera.centre for capture in disturbed]
    shift = np.mean([s.camera.centre - c for s, c in zip(stored, in_world, strict=True)], axis=0)
    np.testing.assert_allclose(shift, 0.0, atol=1e-6)


@pytest.mark.slow
def test_dense_stereo_of_disturbed_photographs_is_as_of_right_ones(tmp_path):
    """The demo room, with noise, gain and poses disturbed as the benchmark does."""
    settings = StereoSettings(max_side_px=160, iterations=2, geometric_rounds=2)
    disturbed_captures(DEMO, tmp_path, np.random.default_rng(2))

    def stereo(folder, refine_poses):
        captures = CaptureSettings(max_side_px=320, max_features=2500, refine_poses=refine_poses, matcher="sift")
        given = import_captures(folder, folder / "cameras.json", captures)
        imported, sparse = triangulate_refined(given, captures)
        maps = dense_stereo(
            imported.captures,
            depth_ranges(imported.captures, sparse),
            sparse.points,
            settings,
            visibility=sparse.visibility,
        )
        return [np.where(one.reliable(settings), one.depth, 0.0) for one in maps]

    right, refined, kept = (
        stereo(folder, mode) for folder, mode in ((DEMO, "never"), (tmp_path, "auto"), (tmp_path, "never"))
    )
    covered, covered_refined, covered_kept = (np.mean(np.array(d) > 0) for d in (right, refined, kept))
    assert covered_refined > 0.93 * covered and covered_kept < covered_refined
    both = [(a > 0) & (b > 0) for a, b in zip(right, refined, strict=True)]
    ratio = np.concatenate([b[m] / a[m] for a, b, m in zip(right, refined, both, strict=True)])
    assert (np.abs(ratio - 1) < 0.03).mean() > 0.97
