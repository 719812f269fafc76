"""Charts: inside the texture, apart from each other, and on the same surface."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from progress_recorder import ProgressRecorder

from r2sego_blender.config.settings import TextureSettings
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.texture import unwrapping
from r2sego_blender.geometry.texture.box_unwrapping import box_unwrapped
from r2sego_blender.geometry.texture.texels import overlapping_faces, texel_map
from r2sego_blender.geometry.texture.unwrapping import unwrapped

SETTINGS = TextureSettings(size_px=256, padding_px=2)


def folded() -> trimesh.Trimesh:
    """A spiral ramp of two turns: seen from above it covers itself."""
    angle = np.linspace(0, 4 * np.pi, 80)
    rim = np.stack([np.cos(angle), np.sin(angle), 0.05 * angle], 1)
    vertices = np.concatenate([rim, rim * (0.5, 0.5, 1)])
    i = np.arange(79)
    faces = np.concatenate([np.stack([i, i + 1, i + 81], 1), np.stack([i, i + 81, i + 80], 1)])
    return trimesh.Trimesh(vertices, faces, process=False)


def sorted_triangles(vertices, faces):
    """(F, 9) the triangles' corners, each from its lowest corner on, in one order."""
    corners = np.asarray(vertices, np.float32)[faces]
    first = np.array([np.lexsort(triangle.T)[0] for triangle in corners])
    turned = np.take_along_axis(corners, ((first[:, None] + np.arange(3)) % 3)[..., None], axis=1)
    flat = turned.reshape(-1, 9)
    return flat[np.lexsort(flat.T)]


def check_charts(mesh, vertices, faces, uvs, size_px):
    assert uvs.dtype == np.float32 and uvs.min() >= 0 and uvs.max() <= 1
    assert not overlapping_faces(uvs, faces, size_px).any()
    assert not overlapping_faces(uvs, faces, 4 * size_px).any()
    np.testing.assert_array_equal(sorted_triangles(vertices, faces), sorted_triangles(mesh.vertices, mesh.faces))
    assert texel_map(uvs, faces, size_px, 0.0).inside.mean() > 0.15


@pytest.mark.parametrize("seconds", [60.0, 0.0])
@pytest.mark.parametrize("shape", ["room", "folded"])
def test_charts_do_not_overlap_and_the_surface_is_the_same(room, shape, seconds):
    mesh = room.mesh.copy().subdivide_to_size(0.8) if shape == "room" else folded()
    result = unwrapped(mesh.vertices, mesh.faces, replace(SETTINGS, unwrap_seconds=seconds))
    assert result.method.startswith("xatlas" if seconds else "boxes")
    check_charts(mesh, result.vertices, result.faces, result.uvs, SETTINGS.size_px)


def test_the_fallback_says_why(room):
    recorder = ProgressRecorder()
    mesh, settings = room.mesh, replace(SETTINGS, unwrap_seconds=0.0)
    result = unwrapped(mesh.vertices, mesh.faces, settings, recorder)
    assert result.method == "boxes, since xatlas gave no charts"
    assert [level for level, _ in recorder.messages] == ["warning"] * 2
    assert all("took longer" in text for _, text in recorder.messages)


def test_fewer_faces_are_tried_before_boxes(room, monkeypatch):
    """All of the time is the second attempt's."""
    monkeypatch.setattr(unwrapping, "_FIRST_SHARE", 0.0)
    mesh = room.mesh.copy().subdivide_to_size(0.3)
    result = unwrapped(mesh.vertices, mesh.faces, SETTINGS)
    assert result.method == f"xatlas, with {len(result.faces)} faces for want of time"
    assert len(result.faces) <= len(mesh.faces) // 2
    assert trimesh.Trimesh(result.vertices, result.faces).area == pytest.approx(mesh.area, rel=0.01)
    assert not overlapping_faces(result.uvs, result.faces, SETTINGS.size_px).any()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_boxes_never_overlap_whatever_the_mesh(seed):
    """Crumpled spheres and loose triangles across each other."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(2)
    ball.vertices *= 1 + 0.4 * rng.normal(size=(len(ball.vertices), 1))
    soup = trimesh.Trimesh(rng.normal(size=(90, 3)), np.arange(90).reshape(-1, 3), process=False)
    mesh = trimesh.util.concatenate([ball, soup])
    vertices, faces, uvs = box_unwrapped(mesh.vertices.astype(np.float32), np.asarray(mesh.faces), 256, 1)
    assert uvs.min() >= 0 and uvs.max() <= 1
    assert not overlapping_faces(uvs, faces, 256).any()
    np.testing.assert_array_equal(sorted_triangles(vertices, faces), sorted_triangles(mesh.vertices, mesh.faces))


def test_charts_are_the_padding_apart():
    mesh = trimesh.creation.box()
    _, faces, uvs = box_unwrapped(mesh.vertices.astype(np.float32), np.asarray(mesh.faces), 128, 4)
    face = texel_map(uvs, faces, 128, 0.0).face
    side = np.where(face >= 0, mesh.face_normals[face] @ [1, 2, 4], 0).astype(int)
    for shift in range(1, 8):
        for one, other in ((side[shift:], side[:-shift]), (side[:, shift:], side[:, :-shift])):
            assert not ((one != 0) & (other != 0) & (one != other)).any()


def test_more_charts_than_texels_is_an_error():
    rng = np.random.default_rng(0)
    soup = rng.normal(size=(30000, 3)).astype(np.float32)
    with pytest.raises(GeometryError, match=r"do not fit .* texture\.size_px"):
        box_unwrapped(soup, np.arange(30000).reshape(-1, 3), 64, 4)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int)),
        (np.full((3, 3), np.inf), [[0, 1, 2]]),
        (np.eye(3), [[0, 1, 7]]),
        (np.ones((3, 3)), [[0, 1, 2]]),
    ],
)
def test_damaged_meshes_never_reach_native_code(vertices, faces):
    with pytest.raises(GeometryError):
        unwrapped(vertices, np.array(faces), SETTINGS)
