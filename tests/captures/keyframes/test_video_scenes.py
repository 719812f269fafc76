"""From a phone's video to a bundle."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from phone_videos import filmed, walk, write_video

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.refine.creation import create_scene


@pytest.mark.slow
def test_a_phones_video_becomes_a_bundle_that_says_what_was_taken(tmp_path, room):
    shakes = range(1, 30, 4)
    video = write_video(tmp_path / "walk.mp4", filmed(room.image, 30, shakes))
    settings = CaptureSettings(max_features=2500, max_keyframes=7)
    scene = create_scene(tmp_path / "walk.r2s", video, settings=settings)
    captures = scene.read(CAPTURES)
    numbers = [int(Path(capture.name).stem.rpartition("_")[2]) for capture in captures]
    declared = Scene.open(scene.path).declaration
    told = [int(one.split()[0]) for one in declared.captures_chosen]
    assert len(told) == 7 and set(numbers) <= set(told) and len(numbers) >= 6
    assert not set(told) & set(shakes)
    assert "frames of walk.mp4" in declared.captures_source
    for a, b in itertools.pairwise(range(len(captures))):
        turn = captures[a].camera.camera_from_world @ captures[b].camera.world_from_camera
        true_a, true_b = (walk(numbers[i] / 29) for i in (a, b))
        true = true_a.camera_from_world @ true_b.world_from_camera
        assert np.degrees(rotation_angle_rad(turn, true)) < 1.0
    assert all(capture.camera.height > capture.camera.width for capture in captures)  # upright
