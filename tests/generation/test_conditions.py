"""Structural conditions against exact ray casting, and their files."""

import cv2
import numpy as np
import pytest
from box_room import TABLE, arc, lens, render

from r2sego_blender.cameras import look_at
from r2sego_blender.errors import GenerationError
from r2sego_blender.generation.condition_files import load_conditions, save_conditions
from r2sego_blender.generation.conditions import NOTHING
from r2sego_blender.geometry.proxy import Provenance


@pytest.fixture(scope="module")
def conditions(box_room):
    return box_room.renderer.render(arc(2))


def test_depth_and_normals_are_those_of_ray_casting(conditions):
    for condition in conditions:
        _, depth = render(condition.camera)
        assert np.mean(np.abs(condition.depth - depth) < 1e-4 * depth) > 0.999
        points = condition.camera.unproject(condition.depth)
        floor = (points[..., 2] < 1e-4) & (condition.depth > 0)
        assert floor.mean() > 0.1
        np.testing.assert_allclose(condition.normal[floor], [[0, 0, 1]] * floor.sum(), atol=1e-6)


def test_provenance_and_validity_follow_the_faces(conditions):
    for condition in conditions:
        points = condition.camera.unproject(condition.depth)
        table = np.all((points > TABLE[0] - 1e-3) & (points < TABLE[1] + 1e-3), axis=-1)
        inside = cv2.erode(table.astype(np.uint8), np.ones((3, 3))) > 0
        assert inside.any()
        assert (condition.provenance[inside] == Provenance.OBSERVED + 1).all()
        assert (condition.provenance[~table & (points[..., 2] > 1e-3)] == Provenance.COMPLETED + 1).all()
        assert condition.validity.all()


def test_surfaces_seen_from_behind_are_not_valid(box_room):
    outside = lens().at(look_at([0.0, -6.0, 1.2], [0.0, 0.0, 1.2]))
    condition = box_room.renderer.condition(outside)
    shown = condition.depth > 0
    assert 0.05 < shown.mean() < 1.0
    assert not condition.validity.any()
    assert (condition.provenance[~shown] == NOTHING).all()
    assert not condition.normal[~shown].any()


def test_conditions_survive_the_disk(tmp_path, conditions):
    save_conditions(tmp_path, conditions)
    depth = cv2.imread(str(tmp_path / "000_depth.png"), cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.uint16
    assert ((depth == 0) == (conditions[0].depth == 0)).all()
    for loaded, saved in zip(load_conditions(tmp_path), conditions, strict=True):
        np.testing.assert_array_equal(loaded.camera.world_from_camera, saved.camera.world_from_camera)
        np.testing.assert_allclose(loaded.depth, saved.depth, atol=5.1e-4)
        np.testing.assert_allclose(loaded.normal, saved.normal, atol=0.01)
        np.testing.assert_array_equal(loaded.provenance, saved.provenance)
        np.testing.assert_array_equal(loaded.validity, saved.validity)


@pytest.mark.parametrize("name", ["001.npz", "001_depth.png"])
@pytest.mark.parametrize("kept", [None, 0, 100])
def test_damaged_conditions_are_named(tmp_path, conditions, name, kept):
    save_conditions(tmp_path, conditions)
    if kept is None and name.endswith("npz"):
        for path in tmp_path.iterdir():
            path.unlink()
    elif kept is None:
        (tmp_path / name).unlink()
    else:
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:kept])
    with pytest.raises(GenerationError, match="again"):
        load_conditions(tmp_path)
