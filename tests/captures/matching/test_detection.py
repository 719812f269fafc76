from __future__ import annotations

import cv2
import numpy as np
import pytest
from progress_recorder import ProgressRecorder

from r2sego_blender.captures.matching import detection
from r2sego_blender.captures.matching.features import sift
from r2sego_blender.core.errors import CaptureError


def _images(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    spots = [cv2.resize(rng.random((12 + i, 16, 3), np.float32), (160, 120)) for i in range(count - 2)]
    return [*spots, np.full((50, 60, 3), 128, np.uint8), rng.random((20, 20, 3), np.float32)]


@pytest.mark.parametrize("cores", [1, 2, 3])
def test_wherever_they_are_found_features_are_those_of_sift(monkeypatch, cores):
    monkeypatch.setattr(detection, "available_cores", lambda: cores)
    monkeypatch.setattr(detection, "_WORTH_PX", 0)
    monkeypatch.setattr(detection, "_AT_ONCE", 2)
    images, recorder = _images(7), ProgressRecorder()
    found = detection.sift_each(images.__getitem__, len(images), 500, recorder)
    for features, image in zip(found, images, strict=True):
        expected = sift(image, 500)
        for one, other in zip(features, expected, strict=True):
            assert one.dtype == other.dtype and np.array_equal(one, other)
    assert [(task.done, task.total) for task in recorder.tasks] == [(7, 7)]
    assert len(found[0].keypoints) > 50 and not len(found[-2].keypoints) and not len(found[-1].keypoints)
    assert detection.sift_each(images.__getitem__, 0, 500) == []


@pytest.mark.parametrize("cores", [1, 2])
def test_an_image_that_cannot_be_read_is_told(monkeypatch, cores):
    monkeypatch.setattr(detection, "available_cores", lambda: cores)
    monkeypatch.setattr(detection, "_WORTH_PX", 0)
    images = _images(4)

    def image(index: int) -> np.ndarray:
        if index == 3:
            raise CaptureError("it is damaged", where="fourth.jpg", cure="Take it anew.")
        return images[index]

    with pytest.raises(CaptureError, match=r"fourth\.jpg"):
        detection.sift_each(image, 4, 500)
