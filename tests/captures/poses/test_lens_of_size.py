"""Intrinsics of a photograph whose size nobody states: what cannot be of the file's own size is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.captures.poses.photographs import require_lens_of_size
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import CaptureError

SIZE, FOCAL = (96, 72), 70.0
KINDS = {
    "transforms.json": ("frames", "file_path", "transform_matrix", "fl_x", ("w", "h")),
    "cameras.json": ("captures", "file", "world_from_camera", "fx", ("width", "height")),
}


def _written(folder, blank_photograph, rng, kind, more):
    listed, name, pose, _, _ = KINDS[kind]
    entries = []
    for index in range(3):
        blank_photograph(folder / f"{index}.png", *SIZE)
        matrix = look_at(rng.uniform([-2, -2, 1], [2, 2, 5]), rng.uniform(-1, 1, 3))
        entries.append({name: f"{index}.png", pose: matrix.tolist()})
    (folder / kind).write_text(json.dumps({**more, listed: entries}))
    return folder / kind


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("scaled", [1 / 6, 4.0, 10.0])
def test_a_focal_length_of_another_size_is_refused_until_the_size_is_said(
    tmp_path, rng, blank_photograph, kind, scaled
):
    """Said, it is scaled with the photograph, and so is one that is truly long."""
    focal_key, size_keys = KINDS[kind][3:]
    told = {focal_key: FOCAL * scaled}
    path = _written(tmp_path, blank_photograph, rng, kind, told)
    with refused(CaptureError, "[0]", f"{FOCAL * scaled:g} px", cure=" and ".join(f"'{key}'" for key in size_keys)):
        import_captures(tmp_path, path, CaptureSettings())
    size = [round(side * scaled) for side in SIZE]
    path = _written(tmp_path, blank_photograph, rng, kind, told | dict(zip(size_keys, size, strict=True)))
    assert import_captures(tmp_path, path, CaptureSettings()).captures[0].camera.fx == pytest.approx(FOCAL)
    path = _written(tmp_path, blank_photograph, rng, kind, told | dict(zip(size_keys, SIZE, strict=True)))
    assert import_captures(tmp_path, path, CaptureSettings()).captures[0].camera.fx == pytest.approx(FOCAL * scaled)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("scaled", [0.6, 1.5])
def test_a_principal_point_of_another_size_is_refused(tmp_path, rng, blank_photograph, kind, scaled):
    focal_key = KINDS[kind][3]
    told = {focal_key: FOCAL * scaled, "cx": SIZE[0] / 2 * scaled, "cy": SIZE[1] / 2 * scaled}
    path = _written(tmp_path, blank_photograph, rng, kind, told)
    with refused(CaptureError, "[0]", f"{told['cx']:g}, {told['cy']:g}"):
        import_captures(tmp_path, path, CaptureSettings())


def test_an_angle_is_of_any_size(tmp_path, rng, blank_photograph):
    path = _written(tmp_path, blank_photograph, rng, "transforms.json", {"camera_angle_x": np.radians(12.0)})
    focal = import_captures(tmp_path, path, CaptureSettings()).captures[0].camera.fx
    assert focal == pytest.approx(SIZE[0] / 2 / np.tan(np.radians(6.0)))


@given(
    angle_deg=st.floats(30.0, 120.0),
    shift=st.tuples(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08)),
    width=st.integers(64, 6000),
    height=st.integers(64, 6000),
)
def test_lenses_that_rooms_are_photographed_with_are_taken(angle_deg, shift, width, height):
    focal = max(width, height) / 2 / np.tan(np.radians(angle_deg / 2))
    cx, cy = ((0.5 + off) * side for off, side in zip(shift, (width, height), strict=True))
    require_lens_of_size(Lens(width, height, focal, focal, cx, cy), "lens", ("w", "h"))


def test_a_fisheye_may_be_wider(tmp_path):
    wide = (64, 48, 12.0, 12.0, 32.0, 24.0)
    require_lens_of_size(Lens(*wide, (0.0,) * 4, "opencv_fisheye"), "lens", ("w", "h"))
    with refused(CaptureError, "lens", "12 px"):
        require_lens_of_size(Lens(*wide), "lens", ("w", "h"))
