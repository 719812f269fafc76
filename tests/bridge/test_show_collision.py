"""Meshes that Blender itself would end or wander off on."""

from __future__ import annotations

import json

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from r2sego_blender.bridge.collision.show_collision import read_obj, show_textured  # noqa: E402
from r2sego_blender.core.errors import SceneError  # noqa: E402


def test_a_mesh_is_read_as_it_was_written(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0.5\nf 1/1 2/2 3/3\n")
    vertices, faces = read_obj(tmp_path / "a.obj")
    np.testing.assert_array_equal(vertices[2], [0, 1, 0.5])
    np.testing.assert_array_equal(faces, [[0, 1, 2]])


@pytest.mark.parametrize(
    "text",
    ["f 1 2 3\n", "v 0 0 0\nf 1 1 9\n", "v 0 0 0\nf 0 1 1\n", "v nan 0 0\nf 1 1 1\n", "v 0 0 0\nf 1 1 9999999999\n"],
)
def test_a_face_of_vertices_that_are_not_there_is_refused(tmp_path, text):
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(SceneError, match=r"a\.obj"):
        read_obj(tmp_path / "a.obj")


def test_the_importer_follows_no_buffer_out_of_a_file(tmp_path):
    document = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": "../outside.bin"}]}
    (tmp_path / "outside.bin").write_bytes(b"1234")
    (tmp_path / "inside").mkdir()
    (tmp_path / "inside" / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(SceneError, match=r"a\.gltf"):
        show_textured(bpy.context.scene, None, tmp_path / "inside" / "a.gltf")
