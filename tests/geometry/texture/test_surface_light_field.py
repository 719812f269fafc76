"""Surface light fields: texels found on true places, shine that is fitted from pictures, files that are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.core.arrays import save_arrays
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.texture.light_field_fitting import LightSums
from r2sego_blender.geometry.texture.surface_light_field import (
    SurfaceLightField,
    harmonics_seen,
    texel_counts,
    texel_middles,
)

CELL_M = 0.1
LENS = Camera(48, 36, 30.0, 30.0, 24.0, 18.0, np.eye(4))
SKY = np.float32([0.2, 0.4, 0.8])


def corner_room() -> tuple[np.ndarray, np.ndarray]:
    """A floor and two walls, of triangles of every shape."""
    vertices = np.float32([[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0], [0, 0, 2], [3, 0, 2], [0, 2, 2]])
    faces = np.int32([[0, 1, 2], [0, 2, 3], [0, 5, 1], [0, 4, 5], [0, 3, 6], [0, 6, 4]])
    return vertices, faces


def field(harmonics: int, cell_m: float = CELL_M, seed: int = 0) -> SurfaceLightField:
    """Of smooth colours over the room, with shine where there is more than one harmonic."""
    vertices, faces = corner_room()
    texels = texel_counts(vertices, faces, cell_m)
    middles, _ = texel_middles(vertices, faces, texels)
    light = np.zeros((len(middles), harmonics, 3), np.float32)
    light[:, 0] = (0.45 + 0.2 * np.sin(2.0 * middles)) / 0.2820948
    light[:, 1:] = np.random.default_rng(seed).uniform(-0.15, 0.15, (1, harmonics - 1, 3))
    return SurfaceLightField(vertices, faces, texels, light, SKY)


def cameras(count: int, seed: int) -> list[Camera]:
    rng = np.random.default_rng(seed)
    return [
        LENS.at(look_at(rng.uniform((0.8, 0.6, 0.7), (2.6, 1.8, 1.8)), rng.uniform((0, 0, 0), (2, 1.5, 1.2))))
        for _ in range(count)
    ]


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(-10.0 * np.log10(np.square(one - other).mean()))


def test_what_a_pixel_shows_lies_within_the_texel_that_is_found():
    surface = field(1)
    middles, face = texel_middles(surface.vertices, surface.faces, surface.texels)
    for camera in cameras(5, seed=1):
        texels, buffers = surface.texels_seen(camera)
        seen = texels >= 0
        np.testing.assert_array_equal(seen, buffers.face >= 0)
        np.testing.assert_array_equal(face[texels[seen]], buffers.face[seen])
        local = camera.rays() * buffers.depth[..., None]
        points = (local @ camera.world_from_camera[:3, :3].T + camera.centre)[seen]
        away_m = np.linalg.norm(points - middles[texels[seen]], axis=1)
        assert away_m.max() <= np.sqrt(0.5) * CELL_M + 1e-4


def test_texels_are_no_larger_than_asked_for_and_each_lies_on_its_faces_plane():
    vertices, faces = corner_room()
    for cell_m in (0.03, 0.5, 10.0):
        texels = texel_counts(vertices, faces, cell_m)
        middles, face = texel_middles(vertices, faces, texels)
        assert len(middles) == texels.prod(axis=1).sum()
        corners = vertices[faces].astype(float)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        offsets = np.einsum("ti,ti->t", normals[face], middles - corners[face, 0])
        np.testing.assert_allclose(offsets, 0.0, atol=1e-6)
        assert (texels == 1).all() == (cell_m == 10.0)


def test_a_rendering_is_the_harmonics_of_each_pixels_direction_over_the_background():
    surface = field(4)
    surface.light[:] = surface.light[:1]
    camera = LENS.at(look_at((1.5, 1.2, 1.0), (0.0, 0.5, 3.0)))
    colour, depth_m = surface.render(camera)
    expected = np.einsum("hwk,kc->hwc", harmonics_seen(camera, 4), surface.light[0])
    inside = np.zeros(depth_m.shape, bool)
    inside[1:-1, 1:-1] = True
    solid, empty = depth_m > 0.0, depth_m == 0.0
    for shift in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        solid, empty = solid & np.roll(solid, shift, (0, 1)), empty & np.roll(empty, shift, (0, 1))
    assert (solid & inside).sum() > 100 and (empty & inside).sum() > 100
    np.testing.assert_allclose(colour[solid & inside], expected[solid & inside], atol=2e-5)
    np.testing.assert_allclose(colour[empty & inside], np.broadcast_to(SKY, colour.shape)[empty & inside], atol=1e-6)
    np.testing.assert_array_equal(depth_m, surface.texels_seen(camera)[1].depth)


@pytest.mark.parametrize("degree", [1, 2])
def test_pictures_of_a_shining_room_give_its_light_back_from_places_that_were_not_among_them(degree):
    true = field((degree + 1) ** 2)
    dark = replace(true, light=np.zeros((len(true.light), 1, 3), np.float32), background=np.zeros(3, np.float32))
    found = {}
    for fitted_degree in (0, degree):
        sums = LightSums(dark, fitted_degree)
        for camera in cameras(60, seed=2):
            sums.add(true.render(camera)[0], camera)
        found[fitted_degree] = sums.fitted(1e-3)
    scores = {
        key: np.mean([psnr(one.render(camera)[0], true.render(camera)[0]) for camera in cameras(6, seed=3)])
        for key, one in found.items()
    }
    assert scores[degree] > 35.0 and scores[degree] > scores[0] + 8.0
    np.testing.assert_allclose(found[degree].background, SKY, atol=1e-4)


def test_what_no_picture_sees_goes_on_from_what_is_seen():
    true = field(1)
    true.light[:] = 0.6 / 0.2820948
    sums = LightSums(replace(true, light=np.zeros_like(true.light)), 1)
    sums.add(true.render(cameras(1, seed=4)[0])[0], cameras(1, seed=4)[0])
    filled = sums.fitted(1e-3)
    for camera in cameras(4, seed=5):
        seen = true.render(camera)[1] > 0.0
        assert np.abs(filled.render(camera)[0] - true.render(camera)[0])[seen].mean() < 0.02
    with pytest.raises(GeometryError):
        LightSums(true, 0).fitted(1e-3)


def test_a_file_gives_the_same_pictures_and_one_that_does_not_fit_together_is_refused(tmp_path):
    surface = field(9)
    surface.save(tmp_path / "light.npz")
    read = SurfaceLightField.load(tmp_path / "light.npz")
    camera = cameras(1, seed=6)[0]
    for one, other in zip(surface.render(camera), read.render(camera), strict=True):
        np.testing.assert_allclose(one, other, atol=1.0 / 512.0)
    arrays = {name: getattr(surface, name) for name in surface.__dataclass_fields__}
    wrong = {
        "texels": [surface.texels * 0, surface.texels + 1, -surface.texels, surface.texels[:-1]],
        "faces": [surface.faces + 5, surface.faces - 1, surface.faces.astype(float)],
        "light": [surface.light[:, :3], surface.light[:-1], surface.light * np.nan, surface.light[..., :2]],
        "vertices": [surface.vertices + np.float32(np.inf), surface.vertices * 1e9],
        "background": [SKY[:2], SKY * np.nan],
    }
    for name, values in wrong.items():
        for value in values:
            save_arrays(tmp_path / "wrong.npz", **arrays | {name: value})
            with pytest.raises(GeometryError):
                SurfaceLightField.load(tmp_path / "wrong.npz")
    with pytest.raises(GeometryError):
        SurfaceLightField.load(tmp_path / "none.npz")


def test_the_number_of_threads_changes_no_bit(with_threads):
    surface, camera = field(4), cameras(1, seed=7)[0]
    one, two = (with_threads(count, lambda: surface.render(camera)) for count in (1, 2))
    for here, there in zip(one, two, strict=True):
        np.testing.assert_array_equal(here, there)
