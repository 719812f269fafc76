"""Blurred captures are known by what others show of the same, and by nothing else."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from measured_points import measured

from r2sego_blender.captures.blur import BLURRED, relative_sharpness, weights_of
from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.images import save_image


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(1)
    wall = np.column_stack([rng.uniform(-1.0, 1.2, 250), np.full(250, 2.0), rng.uniform(0.3, 2.0, 250)])
    floor = np.column_stack([rng.uniform(-1.0, 1.0, 250), rng.uniform(-0.5, 1.8, 250), np.zeros(250)])
    return np.concatenate([wall, floor])


@pytest.mark.parametrize("blur", ["motion", "focus"])
def test_a_blurred_capture_is_named_and_counts_less(room_captures, points, tmp_path, messages, blur):
    along = np.zeros((9, 9), np.float32)
    along[4] = 1.0 / 9.0
    image = room_captures[3].image()
    blurred = cv2.filter2D(image, -1, along) if blur == "motion" else cv2.GaussianBlur(image, (0, 0), 2.5)
    save_image(tmp_path / "blurred.png", blurred)
    captures = [*room_captures]
    captures[3] = replace(captures[3], image_path=tmp_path / "blurred.png")
    sharpness = relative_sharpness(captures, measured(points, [capture.camera for capture in captures]))
    assert sharpness[3] < BLURRED < 0.5 < np.delete(sharpness, 3).min()
    weights = weights_of([capture.name for capture in captures], sharpness, messages)
    assert 0.0 < weights[3] < 1.0 and all(weight == 1.0 for weight in np.delete(weights, 3))
    (warning,) = messages.warnings
    assert captures[3].name in warning and captures[2].name not in warning


def test_equally_sharp_captures_all_count_alike_in_silence(room_captures, points, messages):
    sharpness = relative_sharpness(room_captures, measured(points, [capture.camera for capture in room_captures]))
    assert weights_of([capture.name for capture in room_captures], sharpness, messages) == [1.0] * 5
    assert not messages.messages


def test_a_nearer_capture_is_not_taken_for_a_blurred_one(room, room_captures, points, tmp_path, messages):
    near = room_captures[2].camera.at(look_at((0.1, 0.3, 1.2), (0.1, 2.0, 1.0)))
    save_image(tmp_path / "near.png", room.image(near))
    captures = [*room_captures, Capture("near.png", tmp_path / "near.png", near)]
    sharpness = relative_sharpness(captures, measured(points, [capture.camera for capture in captures]))
    assert weights_of([capture.name for capture in captures], sharpness, messages) == [1.0] * 6
