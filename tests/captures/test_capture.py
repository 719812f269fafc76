"""Captures as photographs that are looked at."""

from __future__ import annotations

import numpy as np

from r2sego_blender.captures.capture import Capture, DecodedCapture
from r2sego_blender.captures.lenses.lens import Lens


def test_a_decoded_capture_reads_its_photograph_once(blank_photograph, tmp_path):
    lens = Lens(64, 48, 50.0, 50.0, 32.0, 24.0, (0.02, 0.0, 0.0, 0.0))
    capture = Capture("a", blank_photograph(tmp_path / "a.png"), lens.straight(np.eye(4)), lens)
    decoded, expected = DecodedCapture.of(capture), capture.image()
    assert np.array_equal(decoded.image(), expected)
    capture.image_path.unlink()
    assert np.array_equal(decoded.image(), expected)
    assert decoded == DecodedCapture.of(capture)
