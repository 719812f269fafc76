"""Making a bundle: what is looked at before anything is worked on."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.scale import Scale
from r2sego_blender.creation import create_scene
from r2sego_blender.errors import CaptureError
from r2sego_blender.images import save_image


def test_a_known_length_in_a_photograph_that_is_not_there_is_told_before_solving(tmp_path):
    (tmp_path / "photos").mkdir()
    for index in range(3):  # nothing in common: solving would fail, and say so
        save_image(tmp_path / "photos" / f"IMG_{index}.png", np.random.default_rng(index).random((48, 64, 3)))
    for known, message in (("IMG_7.png", "no capture 'IMG_7.png'"), ("IMG_2", "no two of the 3 photographs")):
        with pytest.raises(CaptureError, match=message):
            create_scene(
                tmp_path / "room.r2s", tmp_path / "photos",
                scale=Scale.known_length(known, (1.0, 1.0), (9.0, 9.0), 1.0),
            )  # fmt: skip
    assert not (tmp_path / "room.r2s").exists()
