"""The shipped demo room: pictures and poses belong together and show what they claim."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.core.cameras import Camera

DEMO = Path(__file__).resolve().parents[1] / "demo"
ROOM = DEMO / "room"
CEILING_M, EAST_M, NORTH_M = 2.6, 2.5, 2.2
LARGEST_ROOM_BYTES = 10_000_000

pytestmark = pytest.mark.skipif(not (ROOM / "cameras.json").is_file(), reason="demo/room is not rendered")


@pytest.fixture(scope="module")
def document() -> dict:
    return json.loads((ROOM / "cameras.json").read_text())


def cameras(document: dict, kind: str) -> list[Camera]:
    lens = {key: document[key] for key in ("width", "height", "fx", "fy", "cx", "cy")}
    return [Camera(**lens, world_from_camera=np.array(e["world_from_camera"])) for e in document[kind]]


def pitch_deg(camera: Camera) -> float:
    """Degrees below the horizon."""
    return float(np.degrees(np.arcsin(-camera.forward[2])))


def shell_points(camera: Camera, step_px: int = 16) -> np.ndarray:
    """(P, 3): where the camera's rays meet the empty room's floor, walls or ceiling."""
    rays = camera.rays()[::step_px, ::step_px].reshape(-1, 3) @ camera.world_from_camera[:3, :3].T
    with np.errstate(divide="ignore"):
        near = (np.array([-EAST_M, -NORTH_M, 0.0]) - camera.centre) / rays
        far = (np.array([EAST_M, NORTH_M, CEILING_M]) - camera.centre) / rays
    return camera.centre + rays * np.maximum(near, far).min(axis=1)[:, None]


def share_seen(camera: Camera, other: Camera) -> float:
    """The share of what one camera sees of the shell that lies in the other's picture."""
    pixels, depth = other.project(shell_points(camera))
    return float(other.sees(pixels, depth).mean())


def test_every_picture_is_there_and_none_is_left_over(document):
    named = {entry["file"] for kind in ("captures", "frozen") for entry in document[kind]}
    found = {f"{kind}/{p.name}" for kind in ("captures", "frozen") for p in (ROOM / kind).iterdir()}
    assert named == found
    assert len(document["captures"]) == 6
    assert len(document["frozen"]) == 16


def test_pictures_have_the_lens_size_and_are_well_exposed(document):
    for kind in ("captures", "frozen"):
        for entry in document[kind]:
            with Image.open(ROOM / entry["file"]) as image:
                assert image.size == (document["width"], document["height"]) == (640, 480)
                assert image.mode == "RGB"
                pixels = np.asarray(image)
            assert 60 < pixels.mean() < 190, entry["file"]
            assert pixels.std() > 25, entry["file"]
            assert (pixels.min(axis=-1) >= 254).mean() < 0.05, entry["file"]


def test_the_room_is_small_and_holds_no_ground_truth():
    files = [path for path in ROOM.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < LARGEST_ROOM_BYTES
    assert {path.suffix for path in files} <= {".png", ".webp", ".json"}


@pytest.mark.parametrize("kind", ["captures", "frozen"])
def test_poses_are_upright_rotations_inside_the_room(document, kind):
    for camera in cameras(document, kind):
        rotation = camera.world_from_camera[:3, :3]
        assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-7)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert rotation[2, 0] == pytest.approx(0.0, abs=1e-9)
        assert rotation[2, 1] < 0.0
        assert (np.abs(camera.centre[:2]) < (EAST_M - 0.2, NORTH_M - 0.2)).all()


def test_captures_are_a_walk_at_eye_height_whose_neighbours_overlap(document):
    captures = cameras(document, "captures")
    for camera in captures:
        assert 1.5 <= camera.centre[2] <= 1.6
        assert 5.0 <= pitch_deg(camera) <= 20.0
    for one, following in pairwise(captures):
        assert 0.3 < np.linalg.norm(one.centre - following.centre) < 1.3
        both = (share_seen(one, following), share_seen(following, one))
        assert 0.45 < np.mean(both) < 0.85, both


def test_frozen_views_are_a_robots_head_looking_down(document):
    captures = cameras(document, "captures")
    for camera in cameras(document, "frozen"):
        assert 1.2 <= camera.centre[2] <= 1.28
        assert 22.0 - 1e-6 <= pitch_deg(camera) <= 45.0 + 1e-6
        away_m = min(np.linalg.norm(camera.centre - capture.centre) for capture in captures)
        assert away_m > 0.3


def test_half_of_the_frozen_views_stand_far_from_the_captures(document):
    captures = cameras(document, "captures")
    away_m = [
        min(np.linalg.norm(camera.centre[:2] - capture.centre[:2]) for capture in captures)
        for camera in cameras(document, "frozen")[8:]
    ]
    assert min(away_m) > 0.7
    assert np.median(away_m) > 1.2
