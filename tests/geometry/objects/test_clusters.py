"""Objects found by geometry alone: boxes in a room whose true masks are known."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.objects.clusters import find_objects
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

ROOM = RoomPlanes(
    np.array([[0, 0, 1.0], [0, -1.0, 0], [1.0, 0, 0]]), np.array([0.0, -2.0, -2.0]), np.zeros(3, int), np.ones(3, bool)
)
EYES = [(1.8, -1.8, 1.7), (0.0, -2.0, 1.6), (2.2, 0.6, 1.6), (-1.7, -1.9, 1.5)]


def box(low, high):
    return trimesh.creation.box(bounds=[low, high])


def seen(things):
    """Captures of a room with ``things`` in it, their completed depth, and what each pixel shows."""
    room = [box((-2.2, -3, -0.2), (3, 2.2, 0)), box((-2.2, 2, 0), (3, 2.2, 2.5)), box((-2.2, -3, 0), (-2, 2, 2.5))]
    meshes = [trimesh.util.concatenate(room), *things]
    ids = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    whole = trimesh.util.concatenate(meshes)
    rasterizer = MeshRasterizer(whole.vertices, whole.faces)
    captures, completed, shown = [], [], []
    for number, eye in enumerate(EYES):
        pose = look_at(np.array(eye), np.array([0.0, 0.2, 0.4]))
        camera = Camera(160, 120, 110.0, 110.0, 80.0, 60.0, pose)
        seen_there = rasterizer.render(camera)
        source = np.full(camera.shape, DepthSource.OBSERVED, np.uint8)
        captures.append(Capture(f"view{number}.png", Path(f"view{number}.png"), camera))
        completed.append(CompletedDepth(seen_there.depth, source, camera))
        shown.append(seen_there.of_face(ids, -1))
    return captures, completed, shown


def overlap(found, captures, shown, number):
    inter = sum((found.masks[c.name] & (image == number)).sum() for c, image in zip(captures, shown, strict=True))
    union = sum((found.masks[c.name] | (image == number)).sum() for c, image in zip(captures, shown, strict=True))
    return inter / union


def test_things_that_stand_free_are_found_with_their_outline():
    captures, completed, shown = seen([box((-1, -0.4, 0), (-0.2, 0.4, 0.8)), box((0.6, 0.4, 0), (1.2, 1.1, 0.6))])
    found = find_objects(captures, completed, ROOM)
    assert len(found) == 2
    best = [max(overlap(one, captures, shown, number) for one in found) for number in (1, 2)]
    assert min(best) > 0.75


def test_things_that_touch_are_one_object():
    captures, completed, _ = seen([box((-1, -0.4, 0), (-0.2, 0.4, 0.8)), box((-0.2, -0.4, 0), (0.5, 0.4, 0.5))])
    assert len(find_objects(captures, completed, ROOM)) == 1


def test_a_room_in_the_wrong_unit_is_not_called_empty():
    captures, completed, _ = seen([box((-1, -0.4, 0), (-0.2, 0.4, 0.8))])
    scale = np.diag([1000.0, 1000.0, 1000.0, 1.0])
    far = [CompletedDepth(v.depth * 1000.0, v.source, v.camera.transformed(scale)) for v in completed]
    with pytest.raises(GeometryError, match=r"reaches over \d+ x \d+ x \d+ m, too far .*scale"):
        find_objects(captures, far, RoomPlanes(*(values[:1] for values in vars(ROOM).values())))


def test_an_empty_room_has_no_objects():
    captures, completed, _ = seen([])
    assert find_objects(captures, completed, ROOM) == ()


@pytest.mark.parametrize("source", [DepthSource.PLANE, DepthSource.ENVELOPE, DepthSource.FILLED])
def test_what_no_capture_observed_makes_no_object(source):
    captures, completed, _ = seen([box((-1, -0.4, 0), (-0.2, 0.4, 0.8))])
    guessed = [CompletedDepth(v.depth, np.full_like(v.source, source), v.camera) for v in completed]
    assert find_objects(captures, guessed, ROOM) == ()
