"""From files of a sensor to maps of the captures: in metres, aligned, through a lens, back from disk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from box_room import render

from r2sego_blender.captures.sensors.measuring import measured_depth
from r2sego_blender.captures.sensors.sensor_depth import SensorDepth
from r2sego_blender.captures.sensors.sensor_maps import SensorMap
from r2sego_blender.core.errors import CaptureError


def _written(folder, captures, maps) -> SensorDepth:
    for capture, depth in zip(captures, maps, strict=True):
        if depth is not None:
            np.save((folder / capture.name).with_suffix(".npy"), depth)
    return SensorDepth(folder)


def _errors(captures, maps, boxes) -> np.ndarray:
    off = []
    for capture in captures:
        one = maps[capture.name]
        true = render(one.camera, boxes)[1]
        off.append(np.abs(one.depth / true - 1.0)[one.depth > 0.0])
    return np.concatenate(off)


def test_a_sensor_beside_the_camera_is_seen_from_the_camera(tmp_path, sensor_room, sensor_at, rng, messages) -> None:
    maps = sensor_room.maps(sensor_at(turn_deg=(0.0, 1.5, 0.0), shift_m=(0.02, 0.0, 0.0)), rng, noise=0.003)
    depth = _written(tmp_path, sensor_room.captures, maps)
    found = measured_depth(sensor_room.captures, sensor_room.sparse, depth, 1.0, messages)
    off = _errors(sensor_room.captures, found, sensor_room.boxes)
    plain = {c.name: SensorMap(m, m, c.camera.scaled(0.6)) for c, m in zip(sensor_room.captures, maps, strict=True)}
    assert (off < 0.02).mean() > 0.9
    assert (off > 0.05).mean() < 0.6 * (_errors(sensor_room.captures, plain, sensor_room.boxes) > 0.05).mean()
    assert min((one.depth > 0.0).mean() for one in found.values()) > 0.9


def test_captures_without_a_map_have_none_and_units_are_the_worlds(tmp_path, sensor_room, sensor_at, rng) -> None:
    maps = sensor_room.maps(sensor_at(), rng, noise=0.0)
    some = [one if index % 2 else None for index, one in enumerate(maps)]
    captures, halved = sensor_room.captures, np.diag([0.5, 0.5, 0.5, 1.0])
    found = measured_depth(
        [one.transformed(halved) for one in captures],
        sensor_room.sparse.transformed(halved),
        _written(tmp_path, captures, some),
        metres_per_unit=2.0,
    )
    assert sorted(found) == sorted(one.name for one in captures[1::2])
    for index in range(1, len(captures), 2):
        one, known = found[captures[index].name], found[captures[index].name].depth > 0.0
        assert np.allclose(one.depth[known], 0.5 * maps[index][known], rtol=1e-5)


def test_a_map_moves_with_the_world_and_comes_back_from_disk(tmp_path, sensor_room, rng) -> None:
    camera = sensor_room.captures[0].camera
    depth = sensor_room.depths[0] * (rng.random(camera.shape) < 0.8)
    one = SensorMap(depth.astype(np.float32), np.where(depth > 0.0, 0.02, 0.0).astype(np.float32), camera)
    similarity = np.array([[0.0, -3.0, 0.0, 1.0], [3.0, 0.0, 0.0, 2.0], [0.0, 0.0, 3.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
    moved = one.transformed(similarity)
    known = one.depth > 0.0
    points = one.camera.unproject(one.depth)[known] @ similarity[:3, :3].T + similarity[:3, 3]
    assert np.allclose(moved.camera.unproject(moved.depth)[known], points, atol=1e-5)
    moved.save(tmp_path / "a.npz")
    again = SensorMap.load(tmp_path / "a.npz")
    assert (again.depth == moved.depth).all() and (again.sigma == moved.sigma).all()
    assert (again.camera.world_from_camera == moved.camera.world_from_camera).all()


@pytest.mark.parametrize("wrong", [{"sigma": 0.0}, {"depth": np.nan}, {"depth": -1.0}], ids=str)
def test_a_damaged_map_is_refused(tmp_path, sensor_room, wrong) -> None:
    depth = sensor_room.depths[0].astype(np.float32)
    one = SensorMap(depth, 0.01 * depth, sensor_room.captures[0].camera)
    for name, value in wrong.items():
        one = replace(one, **{name: np.full_like(depth, value)})
    one.save(tmp_path / "a.npz")
    with pytest.raises(CaptureError) as error:
        SensorMap.load(tmp_path / "a.npz")
    assert "a.npz" in str(error.value)
