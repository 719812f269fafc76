"""Objects by learned backends: what those answer becomes masks and meshes in the bundle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.core.images import save_image
from r2sego_blender.editing import object_backends
from r2sego_blender.editing.object_backends import generated_meshes, segmented_objects
from r2sego_blender.geometry.objects.objects import DeclaredObject, load_objects, save_objects
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry
from r2sego_blender.workers.sam3 import FoundMask

PLACES = np.array([[-0.5, 0.0, 0.4], [0.5, 0.0, 0.4]])


@pytest.fixture
def captures(tmp_path: Path) -> list[Capture]:
    found = []
    for index in range(3):
        path = tmp_path / f"p{index}.png"
        save_image(path, np.full((60, 80, 3), 0.25 * index, np.float32))
        camera = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, look_at((index - 1.0, -2, 1.4), (0, 0.2, 0.4)))
        found.append(Capture(path.name, path, camera))
    return found


@pytest.fixture
def observed() -> ObservedGeometry:
    """Two small balls of points that every capture sees."""
    around = 0.12 * np.random.default_rng(0).uniform(-1, 1, (60, 3))
    points = np.concatenate([place + around for place in PLACES]).astype(np.float32)
    empty = np.zeros_like(points)
    return ObservedGeometry(points, empty, empty, np.ones((120, 3), bool), np.ones(120, np.float32))


def disc(capture: Capture, place: np.ndarray) -> np.ndarray:
    (centre,), _ = capture.camera.project(place[None])
    rows, columns = np.mgrid[:60, :80]
    return np.hypot(columns - centre[0], rows - centre[1]) < 9


def test_words_become_objects_seen_in_several_captures(captures, observed, monkeypatch):
    def answer(photographs, vocabulary):
        assert list(photographs) == ["p0.png", "p1.png", "p2.png"] and vocabulary == ["arm chair", "lamp"]
        assert all(image.shape == (60, 80, 3) for image in photographs.values())
        found = [FoundMask(c.name, "arm chair", 0.9, disc(c, place)) for c in captures for place in PLACES]
        lamp = np.zeros((60, 80), bool)
        lamp[:4, :4] = True
        return "SAM 3 0.1.0", (*found, FoundMask("p1.png", "lamp", 0.8, lamp))

    monkeypatch.setattr(object_backends, "segment_externally", answer)
    objects = segmented_objects(["arm chair", "lamp"], captures, observed)
    assert [one.name for one in objects] == ["arm_chair", "arm_chair_2"]
    for one, place in zip(objects, PLACES, strict=True):
        assert dict(one.backends) == {"masks": "SAM 3 0.1.0"} and set(one.masks) == {"p0.png", "p1.png", "p2.png"}
        for capture in captures:
            np.testing.assert_array_equal(one.masks[capture.name], disc(capture, place))


def test_nothing_found_is_an_error_that_names_the_backend(captures, observed, monkeypatch):
    monkeypatch.setattr(object_backends, "segment_externally", lambda *_: ("SAM 3 0.1.0", ()))
    with pytest.raises(GeometryError, match=r"SAM 3 0\.1\.0 found nothing") as caught:
        segmented_objects(["unicorn"], captures, observed)
    assert caught.value.cure


def test_a_mesh_is_made_from_the_photograph_that_shows_most(captures, monkeypatch, tmp_path):
    small, large = np.zeros((60, 80), bool), np.zeros((60, 80), bool)
    small[:5, :5], large[:20, :20] = True, True

    def answer(pictures, folder):
        ((name, (image, mask)),) = pictures.items()
        assert name == "chair" and mask is large
        np.testing.assert_allclose(image, 0.25, atol=0.01)
        trimesh.creation.box((1, 2, 3)).export(folder / "chair.glb")
        return "SAM 3D Objects 0.0.1", {"chair": folder / "chair.glb"}

    monkeypatch.setattr(object_backends, "generate_shapes_externally", answer)
    drawn = DeclaredObject("chair", {"p0.png": small, "p1.png": large})
    (made,) = generated_meshes([drawn], captures, tmp_path)
    assert dict(made.backends) == {"mesh": "SAM 3D Objects 0.0.1"}
    save_objects(tmp_path / "objects", [made], [one.name for one in captures])
    (again,) = load_objects(tmp_path / "objects", captures)
    assert dict(again.backends) == dict(made.backends) and again.mesh.suffix == ".glb"


def test_no_mesh_or_no_mask_is_an_error(captures, monkeypatch, tmp_path):
    monkeypatch.setattr(object_backends, "generate_shapes_externally", lambda *_: ("SAM 3D Objects 0.0.1", {}))
    mask = np.ones((60, 80), bool)
    with pytest.raises(GeometryError, match="made no mesh of it"):
        generated_meshes([DeclaredObject("chair", {"p0.png": mask})], captures, tmp_path)
    with pytest.raises(GeometryError, match="no mask shows the object"):
        generated_meshes([DeclaredObject("chair", {"p0.png": ~mask})], captures, tmp_path)
    assert generated_meshes([], captures, tmp_path) == ()


@pytest.mark.parametrize("content", ["[]", "{", ""])
def test_a_damaged_record_of_backends_is_named(captures, tmp_path, content):
    drawn = DeclaredObject("chair", {"p0.png": np.ones((60, 80), bool)}, backends={"masks": "x"})
    save_objects(tmp_path, [drawn], [one.name for one in captures])
    (tmp_path / "chair" / "backends.json").write_text(content)
    with pytest.raises(GeometryError, match=r"backends\.json"):
        load_objects(tmp_path, captures)
