"""Bounds that stereo could not triangulate, in rooms whose walls are known."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from painted_room import SIZE_M
from room_meshes import closed_room

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.proxy.fusion import compose_proxy
from r2sego_blender.geometry.room.bounds import with_missing_bounds
from r2sego_blender.geometry.room.completion import complete_depth
from r2sego_blender.geometry.room.planes import find_planes
from r2sego_blender.geometry.stereo.stereo import DepthMap
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

SETTINGS = Settings()
COARSE = dataclasses.replace(SETTINGS.proxy, voxel_m=0.05, truncation_m=0.12)
FAR, LEFT, RIGHT = ((0.0, -1.0, 0.0), -1.5), ((1.0, 0.0, 0.0), -2.0), ((-1.0, 0.0, 0.0), -2.0)
CEILING = ((0.0, 0.0, -1.0), -2.4)
DOOR_LOW, DOOR_HIGH = (0.1, 0.0), (0.8, 1.9)  # y and z in the wall x = 2


def photographed(folder, room, mesh, cameras):
    """(captures, depth maps) of a mesh that is painted as the room is."""
    rasterizer, normals = (MeshRasterizer(mesh.vertices, mesh.faces), np.asarray(mesh.face_normals, np.float32))
    captures, maps = [], []
    for index, camera in enumerate(cameras):
        buffers = rasterizer.render(camera)
        path = folder / f"{index}.png"
        save_image(path, room.colour(camera.unproject(buffers.depth)).astype(np.float32))
        captures.append(Capture(f"{index}", path, camera))
        cost, support = np.full(camera.shape, 0.05, np.float32), np.full(camera.shape, 2, np.uint8)
        maps.append(DepthMap(buffers.depth, buffers.of_face(normals), cost, support, camera))
    return captures, maps


def cameras_at(*places):
    return [Camera(320, 240, 180.0, 180.0, 160.0, 120.0, look_at(eye, target)) for eye, target in places]


@pytest.fixture(scope="module")
def corner(room, tmp_path_factory):
    """Captures of the empty room that see its right wall and some of its ceiling."""
    return photographed(tmp_path_factory.mktemp("corner"), room, closed_room(SIZE_M), looking_right())


def looking_right():
    return cameras_at(
        ((-1.4, -1.1, 1.3), (1.5, 0.6, 1.2)),
        ((-1.3, -0.5, 1.5), (1.8, 0.5, 1.0)),
        ((-0.9, -1.2, 1.2), (1.2, 0.9, 1.3)),
        ((-1.5, 0.1, 1.4), (1.8, 0.3, 1.2)),
    )


def without(depth_maps, normal, offset):
    """The depth maps, unreliable within 10 cm of a plane, and what is observed elsewhere."""
    maps, points, normals = [], [], []
    for one in depth_maps:
        seen = one.camera.unproject(one.depth)
        on = np.abs(seen @ np.array(normal) - offset) < 0.1
        maps.append(dataclasses.replace(one, support=np.where(on, 0, one.support).astype(np.uint8)))
        points.append(seen[~on][::3])
        normals.append(one.normal[~on][::3])
    return maps, SimpleNamespace(points=np.concatenate(points), normals=np.concatenate(normals))


def planes_of(captures, maps, observed):
    cameras = tuple(capture.camera for capture in captures)
    planes = find_planes(observed, cameras, SETTINGS.proxy, np.random.default_rng(0))
    return planes, with_missing_bounds(planes, captures, maps, observed, SETTINGS)


def towards(planes, normal):
    return np.flatnonzero(planes.bounding & (planes.normals @ np.array(normal) > 0.9))


@pytest.mark.parametrize("normal, offset", [FAR, LEFT])
def test_a_wall_without_any_reliable_depth_is_found(room, normal, offset):
    maps, observed = without(room.depth_maps, normal, offset)
    before, after = planes_of(room.captures, maps, observed)
    assert not len(towards(before, normal))
    (index,) = towards(after, normal)
    assert after.normals[index] @ normal > np.cos(np.radians(0.5))
    assert abs(after.offsets[index] - offset) < 0.02


@pytest.mark.parametrize("normal, offset", [CEILING, RIGHT])
def test_a_bound_that_two_captures_see_a_little_of_is_found(corner, normal, offset):
    captures, maps = (part[:2] for part in corner)
    maps, observed = without(maps, normal, offset)
    before, after = planes_of(captures, maps, observed)
    assert not len(towards(before, normal))
    (index,) = towards(after, normal)
    assert abs(after.offsets[index] - offset) < 0.02


def test_noise_and_gain_of_the_captures_do_not_hide_a_wall(room, tmp_path):
    rng, noisy = np.random.default_rng(6), []
    for capture in room.captures:
        image = capture.image() * rng.uniform(0.95, 1.05)
        image = np.clip(image + rng.normal(size=image.shape) * 4 / 255, 0, 1)
        save_image(tmp_path / capture.image_path.name, image.astype(np.float32))
        noisy.append(Capture(capture.name, tmp_path / capture.image_path.name, capture.camera))
    maps, observed = without(room.depth_maps, *FAR)
    _, after = planes_of(noisy, maps, observed)
    (index,) = towards(after, FAR[0])
    assert abs(after.offsets[index] - FAR[1]) < 0.02


def test_known_planes_stay_as_they_are_and_an_unseen_wall_is_not_invented(room):
    maps, observed = without(room.depth_maps, *LEFT)
    before, after = planes_of(room.captures, maps, observed)
    known = len(before.offsets)
    for name in before.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(after, name)[:known], getattr(before, name))
    assert not len(towards(after, (0, 1, 0)))  # the wall behind the captures
    assert len(after.offsets) == known + 1


def outdoors():
    """A hilly sphere far outside of the room: nothing in it is a plane."""
    sphere = trimesh.creation.icosphere(5, 1.0)
    rng = np.random.default_rng(3)
    waves = sum(np.sin(sphere.vertices @ rng.normal(size=3) * 9 + rng.uniform(0, 6)) for _ in range(6))
    sphere.vertices *= (5.5 + 0.35 * waves)[:, None]
    return trimesh.Trimesh(sphere.vertices, sphere.faces[:, ::-1], process=False)


def room_with_right_side(pieces):
    """The empty room; of its right wall only rectangles (y low, z low, y high, z high)."""
    shell = closed_room(SIZE_M)
    shell.update_faces(shell.face_normals[:, 0] > -0.9)
    walls = []
    for y0, z0, y1, z1 in pieces:
        corners = [(2.0, y0, z0), (2.0, y1, z0), (2.0, y1, z1), (2.0, y0, z1)]
        walls.append(trimesh.Trimesh(corners, [[0, 2, 1], [0, 3, 2]], process=False))
    return trimesh.util.concatenate([shell, outdoors(), *walls])


def test_an_open_side_stays_open(room, tmp_path):
    captures, maps = photographed(tmp_path, room, room_with_right_side([]), looking_right())
    for one in maps:  # stereo has nothing on what lies outside
        one.support[np.abs(one.camera.unproject(one.depth)[..., 0]) > 2.05] = 0
    points = np.concatenate([one.camera.unproject(one.depth)[one.support > 0] for one in maps])
    normals = np.concatenate([one.normal[one.support > 0] for one in maps])
    _, after = planes_of(captures, maps, SimpleNamespace(points=points[::3], normals=normals[::3]))
    assert len(towards(after, FAR[0]))
    assert not len(towards(after, RIGHT[0]))


def test_a_door_that_is_seen_through_stays_open_in_a_wall_that_is_added(room, tmp_path):
    (y0, _), (y1, z1) = DOOR_LOW, DOOR_HIGH
    pieces = [(-1.5, 0, y0, 2.4), (y1, 0, 1.5, 2.4), (y0, z1, y1, 2.4)]
    captures, maps = photographed(tmp_path, room, room_with_right_side(pieces), looking_right())
    maps, observed = without(maps, *RIGHT)
    inside = observed.points[:, 0] < 2.05  # few observed points lie outside
    observed = SimpleNamespace(points=observed.points[inside], normals=observed.normals[inside])
    _, after = planes_of(captures, maps, observed)
    (index,) = towards(after, RIGHT[0])
    assert abs(after.offsets[index] + 2.0) < 0.02
    completed = complete_depth(captures, maps, after, SETTINGS)
    proxy = compose_proxy(captures, completed, observed, after.envelope, [], COARSE)
    rasterizer, seen = MeshRasterizer(proxy.vertices, proxy.faces), []
    middle = np.array([2.0, (y0 + y1) / 2, 1.0])
    beside = np.array([2.0, -0.5, 1.2])
    for capture in captures:
        depth = rasterizer.render(capture.camera).depth
        for place, closed in ((middle, False), (beside, True)):
            pixels, reach = capture.camera.project(place[None])
            if capture.camera.sees(pixels, reach)[0]:
                found = depth[int(pixels[0, 1]), int(pixels[0, 0])]
                assert (abs(found - reach[0]) < 0.05) == closed
                seen.append(closed)
    assert set(seen) == {True, False}


def test_the_same_input_gives_the_same_bits_in_any_number_of_captures(room):
    maps, observed = without(room.depth_maps, *FAR)
    (_, a), (_, b) = (planes_of(room.captures, maps, observed) for _ in range(2))
    np.testing.assert_array_equal(a.offsets, b.offsets)
    one = planes_of(room.captures[:1], maps[:1], observed)
    np.testing.assert_array_equal(one[0].offsets, one[1].offsets)  # one view compares with none


def test_without_points_planes_are_as_they_were(room):
    nothing = SimpleNamespace(points=np.zeros((0, 3)), normals=np.zeros((0, 3)))
    before, after = planes_of(room.captures, list(room.depth_maps), nothing)
    assert before is after
