"""Stereo and a sensor as one: detail where both agree, the sensor where stereo is weak or wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from box_room import TABLE, arc, render, write_captures

from r2sego_blender.captures.sensors.sensor_maps import SensorMap
from r2sego_blender.config.settings import StereoSettings
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.stereo.measured_depth import with_sensor
from r2sego_blender.geometry.stereo.observed import observe
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry
from r2sego_blender.geometry.stereo.stereo import DepthMap

SETTINGS = StereoSettings(point_spacing_m=0.03)
COUNT = 4


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """Captures, their exact stereo with exact normals, and their exact depth."""
    from r2sego_blender.captures.sensors.cleaning import normals

    cameras = arc(COUNT)
    captures = write_captures(tmp_path_factory.mktemp("room"), cameras)[0]
    depths = [render(camera)[1] for camera in cameras]
    maps = [
        DepthMap(
            depth,
            normals(depth, camera)[0],
            np.full(camera.shape, 0.1, np.float32),
            np.full(camera.shape, 2, np.uint8),
            camera,
        )
        for camera, depth in zip(cameras, depths, strict=True)
    ]
    return captures, maps, depths


def _sensor(depth_map: DepthMap, depth: np.ndarray) -> SensorMap:
    return SensorMap(depth.astype(np.float32), (0.01 * depth).astype(np.float32), depth_map.camera)


def test_where_stereo_found_nothing_the_sensor_stands_in(room) -> None:
    rng = np.random.default_rng(5)
    captures, maps, depths = room
    weak = [replace(m, support=np.where(rng.random(m.depth.shape) < 0.5, 0, m.support)) for m in maps]
    found = with_sensor(weak, captures, [_sensor(m, d) for m, d in zip(maps, depths, strict=True)], SETTINGS)
    for one, before, true in zip(found, weak, depths, strict=True):
        assert one.measured is not None
        assert (one.measured & before.reliable(SETTINGS)).mean() < 0.01
        reliable = one.reliable(SETTINGS)
        assert reliable.mean() > 0.97
        assert (np.abs(one.depth / true - 1.0)[reliable] < 0.03).mean() > 0.99


def test_the_sensor_decides_where_stereo_is_wrong_and_stereo_where_no_sensor_reaches(room) -> None:
    captures, maps, depths = room
    wrong = [replace(m, depth=m.depth.copy()) for m in maps]
    for one in wrong:
        one.depth[:, :40] *= 1.4
    half = [np.where(np.arange(d.shape[1]) < 80, d, 0.0) for d in depths]
    found = with_sensor(wrong, captures, [_sensor(m, d) for m, d in zip(maps, half, strict=True)], SETTINGS)
    for one, true, before in zip(found, depths, wrong, strict=True):
        assert (np.abs(one.depth / true - 1.0)[:, :38] < 0.03).mean() > 0.98
        assert (one.depth[:, 84:] == before.depth[:, 84:]).all()
        assert not one.measured[:, 84:].any()


def test_where_both_agree_the_level_is_the_sensors_and_the_detail_is_stereos(room) -> None:
    rng = np.random.default_rng(5)
    captures, maps, depths = room
    detail = [1.0 + 0.004 * np.sin(np.arange(d.size).reshape(d.shape)) for d in depths]
    stereo = [replace(m, depth=(0.985 * m.depth * t).astype(np.float32)) for m, t in zip(maps, detail, strict=True)]
    noisy = [d * (1.0 + 0.008 * rng.normal(size=d.shape)) for d in depths]
    found = with_sensor(stereo, captures, [_sensor(m, d) for m, d in zip(maps, noisy, strict=True)], SETTINGS)
    for one, true, fine, before in zip(found, depths, detail, stereo, strict=True):
        both = ~one.measured & before.reliable(SETTINGS)
        assert both.mean() > 0.9
        off = np.log(one.depth / true)[both]
        assert abs(off.mean()) < 0.002  # stereo alone is 0.015 too near
        assert np.std(off - np.log(fine)[both]) < 0.005  # the sensor's noise of 0.008 is not taken over


def test_a_capture_without_a_map_keeps_its_stereo_to_the_bit(room) -> None:
    captures, maps, depths = room
    sensor = [_sensor(maps[0], depths[0]), None, None, None]
    found = with_sensor(maps, captures, sensor, SETTINGS)
    for one, before in zip(found[1:], maps[1:], strict=True):
        assert one.measured is None
        assert (one.depth == before.depth).all() and (one.support == before.support).all()


def test_what_one_sensor_measured_is_observed_and_says_so(room, tmp_path: Path) -> None:
    """No second capture sees the table's far side: stereo has nothing there, a sensor has."""
    captures, maps, depths = room
    alone = [replace(m, support=np.zeros_like(m.support)) for m in maps]
    only = np.s_[:, :30]
    seen = np.zeros_like(depths[0])
    seen[only] = depths[0][only]
    found = with_sensor(alone, captures, [_sensor(maps[0], seen), None, None, None], SETTINGS)
    observed = observe(captures, found, None, SETTINGS)
    assert observed.measured.all() and len(observed.points) > 100
    assert observed.visibility[:, 0].all()
    inside = np.abs(observed.points - np.clip(observed.points, [-2, -2, 0], [2, 2, 2.5])).max(axis=1)
    assert inside.max() < 0.05
    observed.save(tmp_path / "o.npz")
    assert (ObservedGeometry.load(tmp_path / "o.npz").measured == observed.measured).all()


def test_files_without_a_sensor_are_as_before_and_measured_ones_come_back(room, tmp_path: Path) -> None:
    captures, maps, depths = room
    maps[0].save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        assert "measured" not in arrays.files
    found = with_sensor(maps, captures, [_sensor(m, d) for m, d in zip(maps, depths, strict=True)], SETTINGS)
    found[0].save(tmp_path / "b.npz")
    again = DepthMap.load(tmp_path / "b.npz")
    assert (again.measured == found[0].measured).all()
    replace(found[0], measured=np.ones_like(found[0].measured), depth=np.zeros_like(found[0].depth)).save(
        tmp_path / "c.npz"
    )
    with pytest.raises(GeometryError):
        DepthMap.load(tmp_path / "c.npz")


def test_the_table_is_closed_by_what_is_measured(room) -> None:
    """Points of the sensor lie on the table where stereo left a hole."""
    captures, maps, depths = room
    blind = []
    for one, depth in zip(maps, depths, strict=True):
        points = one.camera.unproject(depth)
        table = ((points > TABLE[0] - 0.01) & (points < TABLE[1] + 0.01)).all(axis=2)
        blind.append(replace(one, support=np.where(table, 0, one.support)))
    found = with_sensor(blind, captures, [_sensor(m, d) for m, d in zip(maps, depths, strict=True)], SETTINGS)
    points = observe(captures, found, None, SETTINGS)
    on_table = (np.abs(points.points[:, 2] - TABLE[1][2]) < 0.03) & points.measured
    assert on_table.sum() > 100
