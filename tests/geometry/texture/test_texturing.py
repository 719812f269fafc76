"""A painted room baked from its captures and looked at again."""

import dataclasses
import io
import json
import struct

import numpy as np
import pytest
import trimesh

from r2sego_blender.config.settings import TextureSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.texture.texels import texel_map
from r2sego_blender.geometry.texture.texturing import bake, filled, seen_colours
from r2sego_blender.geometry.texture.unwrapping import unwrapped
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

SETTINGS = TextureSettings(size_px=512)


@pytest.fixture(scope="module")
def mesh(room):
    return unwrapped(*_arrays(room.mesh.copy().subdivide_to_size(0.7)), SETTINGS)


@pytest.fixture(scope="module")
def images(room):
    return [capture.image() for capture in room.captures]


@pytest.fixture(scope="module")
def cameras(room):
    return [capture.camera for capture in room.captures]


@pytest.fixture(scope="module")
def textured(mesh, images, cameras):
    return bake(mesh, images, cameras, SETTINGS)


def _arrays(mesh):
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def psnr(a, b):
    return 10 * np.log10(1 / np.mean((a - b) ** 2))


def truth(room, camera):
    depth = MeshRasterizer(room.mesh.vertices, room.mesh.faces).render(camera).depth
    return room.colour(camera.unproject(depth)).astype(np.float32)


def test_the_captures_come_back(textured, images, cameras):
    for image, camera in zip(images, cameras, strict=True):
        again, known = textured.render(camera)
        assert known.all()
        assert psnr(again, image) > 38


def test_held_out_views_between_the_captures_come_back(room, textured):
    """From other heights and turns, all of it seen by some capture."""
    for x, y, z in ((-0.9, -0.9, 1.1), (0.1, -1.0, 1.9), (0.9, -0.8, 1.4)):
        pose = look_at((x, y, z), (0.4 * x, 1.2, 0.9))
        camera = Camera(160, 120, 140.0, 140.0, 80.0, 60.0, pose)
        again, known = textured.render(camera)
        assert known.all()
        assert psnr(again, truth(room, camera)) > 33


def test_seen_texels_have_the_colour_of_their_own_surface(room, mesh, images, cameras):
    """Nothing of the box is on the wall behind it: visibility is the mesh's own."""
    texels = texel_map(mesh.uvs, mesh.faces, SETTINGS.size_px, 0.0)
    points = texels.interpolated(mesh.vertices, mesh.faces)
    normals = _normals(mesh)[texels.face[texels.face >= 0]]
    colours, seen = seen_colours(points, normals, mesh, images, cameras, SETTINGS)
    error = np.abs(colours - room.colour(points))[seen].max(1)
    assert 0.2 < seen.mean() < 0.8
    assert np.median(error) < 0.02
    assert np.quantile(error, 0.99) < 0.12


def _normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(float) for i in range(3))
    cross = np.cross(b - a, c - a)
    return (cross / np.linalg.norm(cross, axis=1, keepdims=True)).astype(np.float32)


def test_the_kernel_sees_what_a_plain_reference_sees(mesh, images, cameras):
    """One capture, no fading and no edges: which points are seen, and their bilinear colours."""
    camera, image = cameras[1], images[1]
    rng = np.random.default_rng(4)
    face = rng.integers(0, len(mesh.faces), 3000)
    weights = rng.dirichlet(np.ones(3), 3000).astype(np.float32)
    points = np.einsum("ij,ijk->ik", weights, mesh.vertices[mesh.faces[face]])
    normals = _normals(mesh)[face]
    plain = dataclasses.replace(SETTINGS, edge_px=0, border_px=0.0, best_captures=1)
    colours, seen = seen_colours(points, normals, mesh, [image], [camera], plain)
    depth = MeshRasterizer(mesh.vertices, mesh.faces).render(camera).depth
    pixels, z = camera.project(points)
    inside = camera.sees(pixels, z)
    column, row = np.where(inside[:, None], pixels, 0).astype(int).T
    away = camera.centre - points
    cosine = np.einsum("ij,ij->i", normals, away) / np.linalg.norm(away, axis=1)
    gap = np.abs(depth[row, column] - z) - (SETTINGS.depth_tolerance * z + 0.005)
    clear = (np.abs(gap) > 1e-4) & (np.abs(cosine - 0.05) > 1e-4)
    expected = inside & (gap < 0) & (cosine >= 0.05)
    assert 300 < expected.sum() < 2700
    np.testing.assert_array_equal(seen[clear], expected[clear])
    both = seen & expected
    place = np.clip(pixels[both] - 0.5, 0, [camera.width - 1, camera.height - 1])
    first = np.minimum(place.astype(int), [camera.width - 2, camera.height - 2])
    (a, b), (c, r) = (place - first).T[..., None], first.T
    value = (image[r, c] * (1 - a) + image[r, c + 1] * a) * (1 - b)
    value += (image[r + 1, c] * (1 - a) + image[r + 1, c + 1] * a) * b
    np.testing.assert_allclose(colours[both], value, atol=1e-3)


def test_a_point_has_its_colour_from_the_capture_that_gives_its_surface_most_pixels(mesh, images, cameras):
    """By finite differences: the area that a millimetre's square of the surface has in each picture."""
    rng = np.random.default_rng(5)
    face = rng.integers(0, len(mesh.faces), 3000)
    weights = rng.dirichlet(np.ones(3), 3000).astype(np.float32)
    corners = mesh.vertices[mesh.faces[face]]
    points, normals = np.einsum("ij,ijk->ik", weights, corners), _normals(mesh)[face]
    plain = dataclasses.replace(SETTINGS, edge_px=0, border_px=0.0, best_captures=1)
    pictures = [np.full_like(image, index / len(images)) for index, image in enumerate(images)]
    colours, _ = seen_colours(points, normals, mesh, pictures, cameras, plain)
    across = corners[:, 1] - corners[:, 0]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    density = []
    for camera, picture in zip(cameras, pictures, strict=True):
        _, seen = seen_colours(points, normals, mesh, [picture], [camera], plain)
        middle, right, up = (camera.project(points + 1e-3 * way)[0] for way in (0.0, across, np.cross(normals, across)))
        area = np.abs(np.linalg.det(np.stack([right - middle, up - middle], axis=-1)))
        density.append(np.where(seen, area, 0.0))
    ordered = np.sort(density, axis=0)
    clear = (ordered[-2] > 0.0) & (ordered[-1] > 1.01 * ordered[-2])
    assert clear.sum() > 300
    np.testing.assert_allclose(colours[clear, 0], np.argmax(density, axis=0)[clear] / len(images), atol=1e-6)


def test_a_wall_behind_no_capture_continues_its_surroundings(textured, room):
    """The unseen wall gets colours of what is near, no black and nothing beyond the seen range."""
    camera = Camera(80, 60, 40.0, 40.0, 40.0, 30.0, look_at((0.0, 1.0, 1.3), (0.0, -1.5, 1.0)))
    again, known = textured.render(camera)
    assert known.all()
    low, high = (
        f([capture.image().reshape(-1, 3) for capture in room.captures], axis=(0, 1)) for f in (np.min, np.max)
    )
    assert (again > low - 0.01).all() and (again < high + 0.01).all()
    assert 0.2 < textured.seen < 0.8


def test_smaller_mip_levels_show_no_seams(textured, images, cameras):
    """Averaged twice, the texture still gives the captures: no background has leaked in."""
    size = SETTINGS.size_px // 4
    small = textured.texture.reshape(size, 4, size, 4, 3).mean((1, 3)).astype(np.uint8)
    coarse = dataclasses.replace(textured, texture=small)
    for image, camera in zip(images, cameras, strict=True):
        assert psnr(coarse.render(camera)[0], image) > 24


def test_captures_of_two_exposures_pass_softly_into_each_other(room, mesh, images, cameras):
    """On open wall texels that differ much from the next are few: only where all captures are as good."""
    grey = [np.full_like(image, 0.5 if k % 2 else 0.55) for k, image in enumerate(images)]
    steps = {}
    for best in (1, 3):
        settings = dataclasses.replace(SETTINGS, best_captures=best)
        flat = bake(mesh, grey, cameras, settings).texture[..., 0].astype(float) / 255
        assert flat.min() > 0.49 and flat.max() < 0.56
        texels = texel_map(mesh.uvs, mesh.faces, SETTINGS.size_px, 0.0)
        points = np.zeros((*flat.shape, 3), np.float32)
        points[texels.face >= 0] = texels.interpolated(mesh.vertices, mesh.faces)
        open_wall = (np.abs(points - (0, 1.5, 1.3)) < (1.8, 1e-3, 0.3)).all(2) & (texels.face >= 0)
        near = np.linalg.norm(np.diff(points, axis=1), axis=2) < 0.1  # and not of another chart
        step = np.abs(np.diff(flat, axis=1))[near & open_wall[:, 1:] & open_wall[:, :-1]]
        steps[best] = (step > 0.02).sum()
    assert steps[1] > 50
    assert steps[3] < 0.2 * steps[1]


def test_the_same_input_gives_the_same_bits_on_any_number_of_threads(mesh, images, cameras, textured, with_threads):
    again = with_threads(1, lambda: bake(mesh, images, cameras, SETTINGS))
    np.testing.assert_array_equal(again.texture, textured.texture)
    assert again.glb() == textured.glb()


def test_pixels_that_may_not_be_used_leave_no_trace(mesh, images, cameras):
    """A black frame around every photograph, told of, is nowhere on the mesh."""
    shown, framed = [], []
    for image in images:
        usable = np.zeros(image.shape[:2], bool)
        usable[15:-15, 15:-15] = True
        shown.append(usable)
        framed.append(np.where(usable[..., None], np.maximum(image, 0.2), 0).astype(np.float32))
    texture = bake(mesh, framed, cameras, SETTINGS, shown=[np.pad(s[17:-17, 17:-17], 17) for s in shown])
    assert texture.texture.min() >= 0.19 * 255
    assert bake(mesh, framed, cameras, SETTINGS).texture.min() < 0.1 * 255


def test_a_mesh_that_no_capture_sees_is_an_error(mesh, images, cameras):
    away = [camera.at(look_at((50, 50, 1), (60, 60, 1))) for camera in cameras]
    with pytest.raises(GeometryError, match="no capture sees"):
        bake(mesh, images, away, SETTINGS)


def test_filling_keeps_what_is_known_and_stays_in_its_range():
    rng = np.random.default_rng(1)
    texture, known = rng.uniform(0.2, 0.7, (37, 37, 3)).astype(np.float32), rng.random((37, 37)) < 0.05
    out = filled(texture * known[..., None], known)
    np.testing.assert_array_equal(out[known], texture[known])
    assert out.min() >= texture[known].min() - 1e-5 and out.max() <= texture[known].max() + 1e-5
    half = np.zeros((32, 32), bool)
    half[:, :16] = True
    np.testing.assert_allclose(filled(np.full((32, 32, 3), 0.4, np.float32), half), 0.4, atol=1e-6)


def test_the_glb_is_the_same_mesh_again(textured):
    """Read by another library: Y up, metres, coordinates, texture and an unlit material."""
    data = textured.glb()
    loaded = trimesh.load(io.BytesIO(data), file_type="glb", force="mesh", process=False)
    positions = np.asarray(loaded.vertices)[:, [0, 2, 1]] * [1, -1, 1]
    np.testing.assert_allclose(positions, textured.vertices, atol=1e-6)
    np.testing.assert_array_equal(loaded.faces, textured.faces)
    np.testing.assert_allclose(loaded.visual.uv * [1, -1] + [0, 1], textured.uvs, atol=1e-6)
    picture = np.asarray(loaded.visual.material.baseColorTexture.convert("RGB"))
    np.testing.assert_array_equal(picture, textured.texture)
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    assert document["extensionsUsed"] == ["KHR_materials_unlit"]
    [material] = document["materials"]
    assert material["extensions"] == {"KHR_materials_unlit": {}}
    assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
