"""Regions: what they hold, that they move with the world, and that JSON keeps them."""

import json
import math

import cv2
import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.regions import Box, Cells, Lasso, Region, region_of

RNG = np.random.default_rng(5)
POINTS = RNG.uniform(-3.0, 3.0, (4000, 3))
CAMERA = Camera(200, 100, 120.0, 110.0, 90.0, 55.0, look_at((0.2, -4.0, 1.0), (0.0, 0.0, 0.3)))
PENTAGON = np.array([[40.0, 20.0], [160.0, 15.0], [120.0, 50.0], [150.0, 90.0], [30.0, 80.0]])
SIDES = np.array([[0.0, 0.0, -1.0, 0.8], [2.0, 1.0, 0.0, 1.0]])


def a_box() -> Box:
    pose = look_at((0.3, -0.2, 0.5), (1.0, 2.0, 0.1))
    pose[:3, :3] *= 2.0
    return Box(pose, np.array([0.5, 0.3, 0.8]))


def regions() -> list[Region]:
    return [
        a_box(),
        Lasso(CAMERA, PENTAGON, 2.0, 5.0),
        Lasso(CAMERA, PENTAGON, 2.0, 5.0, kept_sides=SIDES),
        Lasso(Camera(200, 100, 40.0, 40.0, 100.0, 50.0, CAMERA.world_from_camera), PENTAGON, -1.0, 4.0, True),
        Cells.around(POINTS[:20], 0.4),
    ]


def similarity() -> np.ndarray:
    angle, moved = 0.7, np.eye(4)
    moved[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    moved[:3, :3] *= 1.7
    moved[:3, 3] = 0.4, -2.0, 0.3
    return moved


@pytest.mark.parametrize("region", regions(), ids=lambda r: type(r).__name__)
def test_a_region_moves_with_what_it_holds(region):
    held = region.holds(POINTS)
    assert 10 < held.sum() < len(POINTS) / 2
    moved = POINTS @ similarity()[:3, :3].T + similarity()[:3, 3]
    assert (region.transformed(similarity()).holds(moved) != held).sum() <= 1  # on an edge, rounding decides


@pytest.mark.parametrize("region", regions(), ids=lambda r: type(r).__name__)
def test_json_keeps_a_region(region):
    again = region_of(json.loads(json.dumps(region.to_json())), "here")
    np.testing.assert_array_equal(again.holds(POINTS), region.holds(POINTS))


def test_a_box_holds_what_is_within_its_half_extents():
    box = a_box()
    local = np.array([[0.49, 0.29, 0.79], [-0.49, 0.0, 0.0], [0.51, 0.0, 0.0], [0.0, 0.0, -0.81]])
    world = local @ box.world_from_box[:3, :3].T + box.world_from_box[:3, 3]
    assert box.holds(world).tolist() == [True, True, False, False]


def test_a_lasso_is_opencvs_polygon_between_two_depths():
    pixels, depth = CAMERA.project(POINTS)
    corners = PENTAGON.astype(np.float32)
    inside = [cv2.pointPolygonTest(corners, tuple(map(float, at)), False) > 0 for at in pixels]
    expected = np.array(inside) & (depth >= 2.0) & (depth <= 5.0)
    np.testing.assert_array_equal(Lasso(CAMERA, PENTAGON, 2.0, 5.0).holds(POINTS), expected)


def test_a_lasso_holds_nothing_that_its_view_has_cut_off():
    """Below 0.8 m and right of a slanted wall, as a Clipping Region of Blender's shows a room."""
    shown = (POINTS[:, 2] < 0.8) & (2.0 * POINTS[:, 0] + POINTS[:, 1] > -1.0)
    whole = Lasso(CAMERA, PENTAGON, 2.0, 5.0).holds(POINTS)
    held = Lasso(CAMERA, PENTAGON, 2.0, 5.0, kept_sides=SIDES).holds(POINTS)
    assert 10 < held.sum() < whole.sum() - 10
    np.testing.assert_array_equal(held, whole & shown)


def test_what_is_behind_the_camera_is_in_no_lasso():
    behind = CAMERA.centre - 2.0 * CAMERA.forward
    everywhere = np.array([[-1e6, -1e6], [1e6, -1e6], [1e6, 1e6], [-1e6, 1e6]])
    assert not Lasso(CAMERA, everywhere, -10.0, 10.0).holds(behind[None])[0]
    assert Lasso(CAMERA, everywhere, -10.0, 10.0, orthographic=True).holds(behind[None])[0]


def test_cells_hold_their_points_and_nothing_a_cell_away():
    cells = Cells.around(POINTS[:20], 0.01)
    assert cells.holds(POINTS[:20]).all()
    assert not cells.holds(POINTS[:20] + 0.5).any()


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"kind": "ball"}, "ball"),
        ({"half_extents": [1.0, 2.0]}, "finite numbers"),
        ({"half_extents": [1.0, 2.0, math.nan]}, "finite numbers"),
        ({"world_from_box": np.zeros((4, 4)).tolist()}, "Singular"),
        ({"world_from_box": "here"}, "no region"),
    ],
)
def test_a_damaged_region_is_refused_with_its_place(damage, words):
    with pytest.raises(AssetError, match=words) as refused:
        region_of({**a_box().to_json(), **damage}, "edit.json")
    assert "edit.json" in str(refused.value)


def test_a_missing_field_and_a_flat_polygon_are_refused():
    lasso = Lasso(CAMERA, PENTAGON, 2.0, 5.0).to_json()
    with pytest.raises(AssetError, match="three corners"):
        region_of({**lasso, "polygon_px": [[0, 0], [1, 1]]}, "a")
    del lasso["near_m"]
    with pytest.raises(AssetError, match="near_m"):
        region_of(lasso, "a")


@pytest.mark.parametrize(
    "damage",
    [
        {"polygon_px": [[0.0, 0.0]] * 10_001},
        {"near_m": "nan"},
        {"far_m": float("inf")},
        {"camera": []},
        {"camera": "here"},
        {"kept_sides": {"a": 1}},
    ],
)
def test_a_lasso_of_a_stranger_is_finite_and_has_an_end(damage):
    with pytest.raises(AssetError, match="strange"):
        region_of({**Lasso(CAMERA, PENTAGON, 2.0, 5.0).to_json(), **damage}, "strange.json")


@pytest.mark.parametrize("cells", [[[1e300, 0, 0]], [[2**70, 0, 0]], [[1.5, 2, 0]], [0, 0, 0, 1, 1, 1], "abc", [[{}]]])
def test_cells_of_a_stranger_are_numbers(cells):
    with pytest.raises(AssetError, match="strange"):
        region_of({**Cells(np.eye(4), np.zeros((1, 3), np.int64)).to_json(), "cells": cells}, "strange.json")
