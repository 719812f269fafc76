"""Photographs to take, in a room of which the captures saw one half."""

import numpy as np
import pytest
from room_meshes import closed_room, observed_proxy

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.json_files import read_json, write_json
from r2sego_blender.geometry.visibility.face_sight import face_sight
from r2sego_blender.views.missing_evidence import photographs_to_take
from r2sego_blender.views.photographs import PhotographToTake, advice

LENS = Camera(160, 120, 100.0, 100.0, 80.0, 60.0, np.eye(4))
EYE = Camera(96, 72, 60.0, 60.0, 48.0, 36.0, np.eye(4))


def room():
    """4 m by 4 m and 2.5 m high, in faces of 25 cm; captures in its middle look towards +x."""
    mesh = closed_room((4.0, 4.0, 2.5)).subdivide_to_size(0.3)
    captures = [LENS.at(look_at((-0.5, y, 1.6), (2.0, y, 1.0))) for y in (-0.8, 0.0, 0.8)]
    sight = face_sight(mesh.vertices, mesh.faces, captures)
    return observed_proxy(mesh.vertices, mesh.faces, sight.cosine > 0.1), captures


def candidates(towards):
    """Robots' eyes all over the floor, looking one way."""
    places = [(x, y, 1.2) for x in (-1.2, 0.0, 1.2) for y in (-1.2, 0.0, 1.2)]
    return [EYE.at(look_at(place, np.add(place, (*towards, -0.3)))) for place in places]


@pytest.mark.parametrize("towards", [(-1.0, 0.0), (-1.0, 0.3)])
def test_it_looks_where_the_robot_does_and_no_capture_did(towards):
    proxy, captures = room()
    views = candidates(towards)
    lacking, photographs = photographs_to_take(views, np.ones(len(views)), proxy, captures)
    assert lacking > 0.6
    assert photographs
    assert photographs[0].camera.forward[0] < -0.4 and photographs[0].share > 0.3
    for one in photographs:
        assert abs(one.camera.centre[2] - 1.6) < 1e-9 and one.camera.shape == LENS.shape
        assert min(np.linalg.norm(one.camera.centre[:2] - view.centre[:2]) for view in views) < 1e-9


def test_captures_that_look_straight_down_are_followed_by_such():
    proxy, _ = room()
    down = np.diag([1.0, -1.0, np.nextafter(-1.0, -2.0), 1.0])  # as products of rotations round
    captures = [LENS.at(down + np.outer((x, 0.0, 2.0, 0.0), (0.0, 0.0, 0.0, 1.0))) for x in (-0.3, 0.0, 0.3)]
    views = candidates((-1.0, 0.0))
    _, photographs = photographs_to_take(views, np.ones(len(views)), proxy, captures)
    assert all(one.camera.forward[2] < -0.999 for one in photographs)


def test_where_the_captures_saw_everything_little_is_lacking():
    proxy, captures = room()
    views = candidates((1.0, 0.0))[6:]
    assert photographs_to_take(views, np.ones(len(views)), proxy, captures)[0] < 0.4


def test_what_the_asset_shows_already_is_not_asked_for():
    proxy, captures = room()
    views = candidates((-1.0, 0.0)) + candidates((0.0, -1.0))
    _, photographs = photographs_to_take(views, np.repeat([0.0, 1.0], 9), proxy, captures)
    assert photographs[0].camera.forward[1] < -0.5


def test_where_the_asset_lacks_nothing_nothing_is_asked_for():
    proxy, captures = room()
    views = candidates((-1.0, 0.0))
    assert photographs_to_take(views, np.zeros(len(views)), proxy, captures) == (0.0, ())


def test_without_candidates_nothing_is_asked_for():
    proxy, captures = room()
    assert photographs_to_take([], np.zeros(0), proxy, captures) == (0.0, ())
    assert advice(0.0, ()) == ""


def test_a_photograph_is_written_and_read(tmp_path):
    one = PhotographToTake(LENS.at(look_at((1.0, 2.0, 1.6), (1.0, 3.0, 1.1))), 0.25)
    write_json(tmp_path / "one.json", one.to_json())
    again = PhotographToTake.from_json(read_json(tmp_path / "one.json"))
    np.testing.assert_allclose(again.camera.world_from_camera, one.camera.world_from_camera)
    assert (again.share, round(again.yaw_deg), round(again.down_deg)) == (0.25, 90, 27)
    assert "x 1.0 m, y 2.0 m" in advice(0.5, [one])


@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan"), "much"])
def test_a_share_that_is_none_is_refused(share):
    told = PhotographToTake(LENS, 0.5).to_json() | {"share": share}
    with pytest.raises((TypeError, ValueError)):
        PhotographToTake.from_json(told)
