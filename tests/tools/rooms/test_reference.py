"""The maker of reference rooms, but for Cycles: where it looks from, and what it makes of the pictures."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.core.images import to_uint8
from r2sego_blender.core.json_files import write_json
from r2sego_blender.geometry.collision.collision_files import SCENE_XML
from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField, texel_middles
from tools.benchmarks.workloads import made_up_proxy
from tools.rooms.folder import TrueRoom
from tools.rooms.free_floor import free_floor
from tools.rooms.reference import head_cameras, mesh_of, write_reference
from tools.rooms.reference_score import scores

CELL_M = 0.15
_PROXY = made_up_proxy(1)
ROOM = TrueRoom(_PROXY.vertices, _PROXY.faces, np.zeros(len(_PROXY.faces), int), ("room",))
LOW, HIGH = ROOM.vertices[:, :2].min(axis=0), ROOM.vertices[:, :2].max(axis=0)
FLOOR = free_floor(ROOM.vertices, ROOM.faces, LOW, HIGH)


@pytest.fixture(scope="module")
def true() -> SurfaceLightField:
    """The room with smooth colours."""
    mesh = mesh_of(ROOM, CELL_M)
    middles, _ = texel_middles(mesh.vertices, mesh.faces, mesh.texels)
    light = ((0.5 + 0.3 * np.sin(1.5 * middles)) / 0.2820948)[:, None].astype(np.float32)
    return SurfaceLightField(mesh.vertices, mesh.faces, mesh.texels, light, mesh.background)


def test_cameras_are_where_heads_can_be_and_see_more_than_as_many_drawn_ones():
    mesh = mesh_of(ROOM, CELL_M)
    chosen = list(head_cameras(mesh, FLOOR, 6))
    for camera in chosen:
        assert 0.75 <= camera.centre[2] <= 1.4 and camera.forward[2] <= 1e-9
        assert (camera.centre[:2] >= LOW).all() and (camera.centre[:2] <= HIGH).all()
        depth_m = mesh.texels_seen(camera)[1].depth
        assert depth_m[depth_m > 0.0].min() > 0.25
    assert any(FLOOR.at(camera.centre[None, :2])[0] >= 0.1 for camera in chosen)
    again = list(head_cameras(mesh, FLOOR, 6))
    for one, other in zip(chosen, again, strict=True):
        np.testing.assert_array_equal(one.world_from_camera, other.world_from_camera)

    def seen(cameras: list) -> int:
        return len(np.unique(np.concatenate([mesh.texels_seen(camera)[0].ravel() for camera in cameras])))

    further = list(head_cameras(mesh, FLOOR, 8, chosen))
    assert len(further) == 2
    assert seen([*chosen, *further]) > seen(chosen) > 1.3 * seen([chosen[0]] * 6)


def test_faces_that_no_camera_sees_have_one_texel():
    camera = next(head_cameras(mesh_of(ROOM, CELL_M), FLOOR, 1))
    mesh, all_of_it = mesh_of(ROOM, CELL_M, [camera]), mesh_of(ROOM, CELL_M)
    shown = np.unique(mesh.texels_seen(camera)[1].face)
    shown = shown[shown >= 0]
    np.testing.assert_array_equal(mesh.texels[shown], all_of_it.texels[shown])
    assert (np.delete(mesh.texels, shown, axis=0) == 1).mean() > 0.9


def test_pictures_become_a_reference_room_that_looks_alike_from_elsewhere(true, tmp_path):
    cameras, pictures = list(head_cameras(mesh_of(ROOM, CELL_M), FLOOR, 16)), tmp_path / "pictures"
    pictures.mkdir()
    for index, camera in enumerate(cameras):
        Image.fromarray(to_uint8(true.render(camera)[0])).save(pictures / f"{index:04d}.png")
    write_reference(tmp_path, ROOM, cameras, pictures, CELL_M)
    assert (tmp_path / "collision" / SCENE_XML).is_file()
    elsewhere = [camera.scaled(0.5) for camera in head_cameras(mesh_of(ROOM, CELL_M), FLOOR, 20, cameras)]
    frozen = []
    for index, camera in enumerate(elsewhere):
        Image.fromarray(to_uint8(true.render(camera)[0])).save(tmp_path / f"{index}.png")
        frozen.append({"file": f"{index}.png", "world_from_camera": camera.world_from_camera.tolist()})
    lens = elsewhere[0].to_json()
    del lens["world_from_camera"]
    write_json(tmp_path / "cameras.json", {**lens, "captures": frozen, "frozen": frozen})
    found, taken_s = scores(SurfaceLightField.load(tmp_path / "light.npz"), tmp_path / "cameras.json", 64)
    assert len(found) == len(elsewhere) == 4 and found.min() > 28.0 and taken_s > 0.0
