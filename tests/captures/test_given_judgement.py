"""What is wrong with given poses and lenses is put right where it is clear, and told by name."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from cameras_file import save_cameras_json
from expected_errors import refused
from scipy.spatial.transform import Rotation

from r2sego_blender.captures import given_judgement
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frozen import load_frozen_views
from r2sego_blender.captures.importing import Imported
from r2sego_blender.captures.pose_adjustment import triangulate_refined
from r2sego_blender.captures.solving.lens_judgement import LensVerdict
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

SETTINGS = CaptureSettings(max_features=1500)
SMALL = CaptureSettings(max_features=500, matcher="sift")


def _imported(captures) -> Imported:
    return Imported(tuple(captures), "somebody's poses", metric=True)


def _lens(captures, **changes):
    return [
        replace(c, camera=replace(c.camera, **{k: getattr(c.camera, k) * v for k, v in changes.items()}))
        for c in captures
    ]


def _turned(capture: Capture, degrees: float) -> Capture:
    pose = capture.camera.world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec([0.0, 0.0, np.radians(degrees)]).as_matrix() @ pose[:3, :3]
    return replace(capture, camera=capture.camera.at(pose))


def test_a_photograph_whose_pose_is_wrong_is_located_from_the_others(room_captures, messages):
    given = [_turned(c, 6.0) if index == 2 else c for index, c in enumerate(room_captures)]
    imported, sparse = triangulate_refined(_imported(given), SETTINGS, messages)
    assert len(messages.warnings) == 1 and "photo2.png" in messages.warnings[0]
    assert "photo2.png" in imported.described
    for found, right in zip(imported.captures, room_captures, strict=True):
        assert np.array_equal(found.camera.matrix, right.camera.matrix)
        assert np.linalg.norm(found.camera.centre - right.camera.centre) < 0.02
        assert np.degrees(rotation_angle_rad(found.camera.world_from_camera, right.camera.world_from_camera)) < 0.3
    assert sparse.visibility.sum(axis=0).min() > 100


def test_poses_that_are_never_changed_are_named_all_the_same(room_captures, messages):
    given = _imported([_turned(c, 6.0) if index == 2 else c for index, c in enumerate(room_captures)])
    imported, _ = triangulate_refined(given, replace(SETTINGS, refine_poses="never"), messages)
    assert imported is given
    named = [warning for warning in messages.warnings if "photo2.png" in warning]
    assert named and all("contradicts" in warning for warning in named)


def test_a_photograph_that_nothing_places_is_left_out(room, room_captures, messages, tmp_path):
    """Its matches with the others are many and of nothing: the picture is a mirror image's patchwork."""
    image = room_captures[2].image()
    patches = [(y, x) for y in range(0, 300, 60) for x in range(0, 400, 80)]
    order = np.random.default_rng(0).permutation(len(patches))
    shuffled = np.zeros_like(image)
    for (y, x), (v, u) in zip(patches, (patches[k] for k in order), strict=True):
        shuffled[y : y + 60, x : x + 80] = image[v : v + 60, u : u + 80]
    save_image(tmp_path / "patchwork.png", shuffled)
    given = [*room_captures, replace(room_captures[2], name="patchwork.png", image_path=tmp_path / "patchwork.png")]
    imported, _ = triangulate_refined(_imported(given), SETTINGS, messages)
    assert any("patchwork.png" in warning for warning in messages.warnings)
    assert not any("photo2.png" in warning for warning in messages.warnings)
    assert [c.camera for c in imported.captures[:5]] == [c.camera for c in room_captures]


@pytest.mark.parametrize("factor", [0.87, 1.1])
def test_a_wrong_focal_length_is_found_and_told(room_captures, messages, factor):
    imported, sparse = triangulate_refined(_imported(_lens(room_captures, fx=factor, fy=factor)), SETTINGS, messages)
    assert imported.captures[0].camera.fx == pytest.approx(300.0, rel=0.01)
    assert imported.captures[0].given_lens.fx == pytest.approx(300.0 * factor)
    assert f"focal {300 * factor:.0f} ->" in imported.described and "focal" in messages.warnings[0]
    assert np.median(sparse.error_px) < 0.5


def test_a_distortion_that_was_left_out_is_found_and_held_out_views_follow(room, room_captures, tmp_path):
    """Photographs through k1 = -0.1, given none; the bundle's views through the same lens are brought along."""
    matrix, k = room_captures[0].camera.matrix, np.array([-0.1, 0.0, 0.0, 0.0])
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    bent = []
    for capture in room_captures:
        height, width = capture.camera.shape
        pixels = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        ideal = cv2.undistortPointsIter(pixels.reshape(-1, 1, 2), matrix, k, np.eye(3), matrix, criteria)
        # The ideal picture is taken wider, so that the corners show something.
        wide = replace(capture.camera, width=width + 160, height=height + 120, cx=280.0, cy=210.0)
        source = (ideal.reshape(height, width, 2) + np.array([79.5, 59.5])).astype(np.float32)
        image = cv2.remap(room.image(wide), source[..., 0], source[..., 1], cv2.INTER_CUBIC)
        save_image(tmp_path / capture.name, image)
        bent.append(replace(capture, image_path=tmp_path / capture.name))
    imported, sparse = triangulate_refined(_imported(bent), SETTINGS)
    lens = imported.captures[0].lens
    radius = np.array([[0.5, 0.0], [0.0, 0.45]])
    np.testing.assert_allclose(
        lens.project(radius), radius * (1 - 0.1 * radius.max(1) ** 2)[:, None] * 300 + [200, 150], atol=1.5
    )
    assert np.median(sparse.error_px) < 0.5
    stored = save_captures(tmp_path / "captures", imported.captures, sparse)
    assert [c.given_lens for c in load_captures(tmp_path / "captures")] == [c.given_lens for c in stored]
    save_cameras_json(tmp_path / "cameras.json", bent, frozen=bent[:1])
    (as_given,) = load_frozen_views(tmp_path / "cameras.json")
    (followed,) = load_frozen_views(tmp_path / "cameras.json", captures=load_captures(tmp_path / "captures"))
    assert as_given.lens is None
    assert followed.lens.distortion == pytest.approx(lens.distortion) and followed.lens.fx == pytest.approx(lens.fx)


def test_a_focal_length_of_another_size_is_refused_with_what_fits(room_captures):
    with pytest.raises(CaptureError, match=r"1200 -> (29\d|30\d) px") as refusal:
        triangulate_refined(_imported(_lens(room_captures, fx=4.0, fy=4.0)), SETTINGS)
    assert refusal.value.where == "camera intrinsics"


def _of_stated_size(captures, width, monkeypatch, tmp_path, determined=False):
    """Intrinsics of the photographs' own size that a file says to be of another, as their tracks nearly tell."""
    share = 400 / width
    given = _imported(_lens(captures, fx=share, fy=share, cx=share, cy=share))
    terms = np.array([[0.01 - np.log(share), 0.5, 0.4, 0.01, 0.0]])
    verdict = LensVerdict(terms, determined, 4.0, 1.0, 0.1)
    monkeypatch.setattr(given_judgement, "judged_lenses", lambda *tracks: verdict)
    sizes = {capture.name: (width, width * 3 // 4) for capture in captures}
    return replace(given, stated_sizes=sizes, lens_file=tmp_path / "cameras.txt")


def test_a_focal_length_of_a_stated_size_that_is_wrong_is_refused_with_both(room_captures, monkeypatch, tmp_path):
    given = _of_stated_size(room_captures, 800, monkeypatch, tmp_path)
    with refused(CaptureError, "cameras.txt", "800x600", "400x300", cure=str(tmp_path / "cameras.txt")):
        triangulate_refined(given, SMALL)


def test_a_lens_that_a_stated_size_explains_need_not_be_determined(room_captures, tmp_path, messages, monkeypatch):
    """At a small working size nothing else tells; the principal point moves further than that of a lens does."""
    given = _of_stated_size(room_captures, 560, monkeypatch, tmp_path)
    imported, _ = triangulate_refined(given, SMALL, messages)
    for found, right in zip(imported.captures, room_captures, strict=True):
        np.testing.assert_allclose(found.camera.matrix, right.camera.matrix, rtol=1e-9)
    assert all(part in messages.warnings[0] for part in ("560x420", "400x300", str(tmp_path / "cameras.txt")))


def test_a_stated_size_that_explains_nothing_is_told_and_changes_nothing(
    room_captures, tmp_path, messages, monkeypatch
):
    given = _of_stated_size(room_captures, 440, monkeypatch, tmp_path)
    given = replace(given, stated_sizes={capture.name: (200, 150) for capture in room_captures})
    kept, _ = triangulate_refined(given, SMALL, messages)
    assert all(capture.given_lens is None for capture in kept.captures)
    assert all(part in messages.warnings[0] for part in ("200x150", "400x300", str(tmp_path / "cameras.txt")))


@pytest.mark.parametrize(
    ("read", "word"), [(lambda pose: pose @ np.diag([1.0, -1, -1, 1]), "axes"), (np.linalg.inv, "camera_from_world")]
)
def test_poses_of_another_convention_are_refused_by_name(room_captures, read, word):
    given = [replace(c, camera=c.camera.at(read(c.camera.world_from_camera))) for c in room_captures]
    with pytest.raises(CaptureError) as refusal:
        triangulate_refined(_imported(given), SETTINGS)
    assert word in str(refusal.value.cure)


@pytest.mark.parametrize(("unit", "word"), [(1000.0, "millimetres"), (100.0, "centimetres"), (1.0, None)])
def test_metres_that_are_none_are_told(room_captures, messages, unit, word):
    stretch = np.diag([unit, unit, unit, 1.0])
    given = _imported([capture.transformed(stretch) for capture in room_captures])
    triangulate_refined(given, SETTINGS, messages)
    assert [word in warning for warning in messages.warnings if word] == [True] * bool(word)
    assert word is not None or not messages.warnings
