"""The backdrop: closed, behind everything that was seen, and of the colours around."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.splats.training.backdrop import backdrop
from r2sego_blender.splats.training.initialization import DepthView

HALF_SIDE_M = np.array([3.0, 2.0, 1.3])
MIDDLE = np.array([0.0, 0.0, 1.3])
COUNT = 6000


def room_view(eye, target) -> DepthView:
    """A camera in an empty box-shaped room with walls of one colour an axis, and exact depth."""
    camera = Camera(96, 72, 70, 70, 48, 36, look_at(eye, target))
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    with np.errstate(divide="ignore"):
        ahead = (np.sign(rays) * HALF_SIDE_M - (camera.centre - MIDDLE)) / rays
    depth = ahead.min(axis=2)
    image = np.array([[0.8, 0.3, 0.2], [0.2, 0.7, 0.3], [0.3, 0.3, 0.9]])[ahead.argmin(axis=2)]
    return DepthView(camera, depth.astype(np.float32), image.astype(np.float32), stride_px=2)


@pytest.fixture(scope="module")
def views() -> list[DepthView]:
    return [
        room_view((-0.4, 0.0, 1.4), (3.0, 0.5, 1.0)),
        room_view((0.3, -0.2, 1.2), (3.0, -1.0, 1.4)),
        room_view((0.1, 0.3, 1.3), (1.0, 2.0, 0.9)),
    ]


def wall_distance_m(centre: np.ndarray, direction: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.nanmin((np.sign(direction) * HALF_SIDE_M - (centre - MIDDLE)) / direction, axis=1)


def test_it_stands_just_behind_the_walls_that_were_seen(views):
    asset = backdrop(views, COUNT)
    centre = np.median([v.camera.centre for v in views], axis=0)
    offset = asset.means - centre
    distance = np.linalg.norm(offset, axis=1)
    wall = wall_distance_m(centre, offset / distance[:, None])
    inside = np.zeros(len(asset), bool)
    for view in views:
        pixels, depth = view.camera.project(asset.means)
        inside |= view.camera.sees(pixels, depth, margin_px=6.0)
    assert inside.sum() > 300
    assert 1.03 <= np.median(distance[inside] / wall[inside]) < 1.12
    assert (distance[inside] / wall[inside] < 1.4).mean() > 0.95


def test_it_never_hides_a_surface_that_a_view_shows(views):
    asset = backdrop(views, COUNT)
    for view in views:
        pixels, depth = view.camera.project(asset.means)
        inside = view.camera.sees(pixels, depth)
        column, row = pixels[inside].astype(int).T
        assert (depth[inside] >= 0.969 * view.depth[row, column]).all()


def _hides(asset, place, shown) -> np.ndarray:
    """(n,) bool: which Gaussians stand in the line from a place to any of the points (P, 3) that are shown."""
    to_shown, to_asset = shown - place, asset.means - place
    far_m, near_m = np.linalg.norm(to_shown, axis=1), np.linalg.norm(to_asset, axis=1)
    apart = cKDTree(to_shown / far_m[:, None]).query(to_asset / near_m[:, None])
    return (apart[0] < 0.02) & (near_m < 0.95 * far_m[apart[1]])


def test_nor_from_other_places_in_the_room(views):
    """Half-way to what the views show: the floor that one sees far away lies before the guess beneath another."""
    table = room_view((0.9, 0.2, 1.5), (0.95, 0.25, 0.0))
    table = replace(table, depth=np.full_like(table.depth, 0.5))  # at its own place it is near, all around guessed
    seen = [*views, table]
    asset = backdrop(seen, COUNT)
    shown = np.concatenate([view.camera.unproject(view.depth)[::3, ::3].reshape(-1, 3) for view in seen])
    for view in views:
        for row, column in ((18, 24), (18, 72), (54, 24), (54, 72)):
            place = (view.camera.centre + view.camera.unproject(view.depth)[row, column]) / 2.0
            assert _hides(asset, place, shown).mean() < 0.0005


def test_a_near_thing_in_the_middle_does_not_pull_it_forward(views):
    """In each direction the farthest counts: a pillar close to one camera is not the wall."""
    pillar = DepthView(
        views[0].camera,
        np.where(np.arange(96) < 20, 0.7, views[0].depth).astype(np.float32),
        views[0].image,
        stride_px=2,
    )
    asset = backdrop([pillar, *views[1:]], COUNT)
    centre = np.median([v.camera.centre for v in views], axis=0)
    column = asset.means - centre
    seen_by_others = np.zeros(len(asset), bool)
    for view in views[1:]:
        pixels, depth = view.camera.project(asset.means)
        seen_by_others |= view.camera.sees(pixels, depth, margin_px=6.0)
    distance = np.linalg.norm(column[seen_by_others], axis=1)
    wall = wall_distance_m(centre, column[seen_by_others] / distance[:, None])
    assert np.quantile(distance / wall, 0.02) > 0.95


@pytest.mark.parametrize("target", [(-3, 0, 1.3), (0, -2, 1.0), (0.5, 0.1, 0.0), (0.5, 0.1, 2.6)])
def test_it_is_closed_and_never_black_where_nothing_was_seen(views, target):
    asset = backdrop(views, COUNT)
    camera = Camera(64, 48, 50, 50, 32, 24, look_at((0.0, 0.0, 1.3), target))
    image = render(asset, camera)
    assert image.alpha.min() > 0.9
    assert image.colour.mean(axis=2).min() > 0.2
    assert image.colour.max() <= 0.95


@pytest.mark.parametrize("place", [(2.4, 1.5, 1.3), (1.0, 1.5, 1.3), (1.0, -1.2, 1.3)])
def test_an_unseen_floor_is_closed_for_who_stands_away_from_its_centre(place):
    """There it is seen straight down where the centre, at the other end of the room, sees it at a slant."""
    views = [
        room_view((-2.4, 0.0, 1.4), (3.0, 0.5, 1.9)),
        room_view((-1.7, -0.2, 1.2), (3.0, -1.0, 1.9)),
        room_view((-1.9, 0.3, 1.3), (1.0, 2.0, 1.9)),
    ]
    camera = Camera(64, 48, 32, 32, 32, 24, look_at(place, np.add(place, (0.1, 0.0, -1.3))))
    assert (render(backdrop(views, COUNT), camera).alpha < 0.8).mean() < 0.05


def test_an_unseen_wall_continues_the_walls_beside_it_and_not_the_floor():
    """Behind the cameras, where the floor is nearer than any wall that was seen."""
    views = [
        room_view((0.0, -1.2, 1.3), (0.0, 2.0, 0.4)),
        room_view((0.5, -1.2, 1.3), (1.5, 2.0, 0.4)),
        room_view((-0.5, -1.2, 1.3), (-1.5, 2.0, 0.4)),
    ]
    camera = Camera(64, 48, 50, 50, 32, 24, look_at((0.0, 0.0, 1.3), (0.0, -2.0, 1.4)))
    ahead = render(backdrop(views, COUNT), camera).colour[16:24].mean(axis=(0, 1))
    assert ahead[2] < 0.4  # walls are red and green, the floor is blue
    assert ahead[:2].max() > 0.5


def test_it_is_empty_where_there_is_nothing_to_go_by(views):
    blind = DepthView(views[0].camera, np.zeros_like(views[0].depth), views[0].image, stride_px=2)
    assert len(backdrop([], COUNT)) == len(backdrop([blind], COUNT)) == len(backdrop(views, 0)) == 0


def test_one_seen_direction_is_enough(views):
    depth = np.zeros_like(views[0].depth)
    depth[30:36, 40:46] = views[0].depth[30:36, 40:46]
    asset = backdrop([DepthView(views[0].camera, depth, views[0].image, stride_px=2)], 500)
    assert len(asset) > 450
    assert np.isfinite(asset.means).all() and np.isfinite(asset.sh).all()


def test_the_same_views_give_the_same_backdrop(views):
    first, second = backdrop(views, COUNT), backdrop(views, COUNT)
    assert first.means.tobytes() == second.means.tobytes()
    assert first.sh.tobytes() == second.sh.tobytes()
