"""Mesh files of strangers: a finite mesh or an error that names the file, in little time and memory."""

from __future__ import annotations

import base64
import json
import os
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.mesh.mesh_files import LARGEST, MESH_SUFFIXES, read_mesh
from r2sego_blender.geometry.objects.shapes import load_shape

HOSTILE = Path(__file__).parents[3].parent / "shared" / "failing" / "hostile"
FILES = sorted(HOSTILE.glob("mesh*/*"))
MOST_BYTES = 200 << 20
MOST_S = 1.0
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def read(path: Path) -> int | None:
    """The faces of the shape, whose values are checked, or None where the file is refused; within bounds."""
    tracemalloc.start()
    before = time.thread_time()
    try:
        shape = load_shape(path)
    except GeometryError as error:
        assert path.name in str(error)
        assert error.cure
        assert time.thread_time() - before < MOST_S
        return None
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < max(MOST_BYTES, 10 * path.stat().st_size)
    assert np.abs(shape.vertices).max() <= LARGEST
    assert 0 <= shape.faces.min() <= shape.faces.max() < len(shape.vertices)
    assert np.isfinite(shape.canonical_from_own).all()
    return len(shape.faces)


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """What is compiled and imported once is nobody's memory."""
    trimesh.load(trimesh.util.wrap_as_stream(TRIANGLE + "f 1 2 3\n"), file_type="obj")


@pytest.mark.skipif(not FILES, reason="the collected files are not beside this checkout")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name[:17])
def test_every_file_that_once_did_harm(path):
    read(path)


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_a_mesh_is_what_trimesh_reads(tmp_path, suffix):
    mesh = trimesh.creation.icosphere(2)
    mesh.export(tmp_path / f"a{suffix}")
    vertices, faces = read_mesh(tmp_path / f"a{suffix}")
    there = trimesh.load(tmp_path / f"a{suffix}", force="mesh", process=False, skip_materials=True)
    np.testing.assert_array_equal(vertices, there.vertices)
    np.testing.assert_array_equal(faces, there.faces)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("fan.obj", TRIANGLE + "f " + "1 2 3 " * 16_600),
        ("fan of megabytes.obj", TRIANGLE + "f " + "1 2 3 " * 350_000),
        ("short.obj", "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"),
        ("digits.obj", TRIANGLE + f"f 1 2 {'9' * 5000}\n"),
        ("beyond int64.obj", TRIANGLE + f"f 1 2 {2**63}\n"),
        ("negative.obj", TRIANGLE + "f -1 -2 -9\n"),
        ("infinite.obj", "v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n"),
        ("far.obj", "v 0 0 0\nv 1 0 0\nv 0 3e38 0\nf 1 2 3\n"),
        ("speck.obj", TRIANGLE + "v 0 0 9e8\nf 1 2 3\nf 1 1 4\n".replace("v 0 0 0", "v 0 0 1e-9")),
        ("parts.obj", TRIANGLE + "".join(f"usemtl m{k}\nf 1 2 3\n" for k in range(20_000))),
        ("parts.stl", "solid a\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendsolid\n" * 20_000),
        ("count.off", "OFF\n9999999999999999 1 0\n0 0 0\n"),
        ("count.ply", "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n0\n"),
        ("digits.ply", f"ply\nformat ascii 1.0\nelement vertex {'9' * 5000}\nproperty float x\nend_header\n0\n"),
        (
            "header.ply",
            "ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + "property list int int a\n" * 20_000,
        ),
        ("entities.dae", "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>"),
        ("zipped.3mf", "PK"),
    ],
)
def test_what_claims_or_repeats_too_much_is_refused(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    assert read(tmp_path / name) is None or name == "fan.obj"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes among its files")
@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_a_pipe_is_no_mesh(tmp_path, suffix):
    os.mkfifo(tmp_path / f"a{suffix}")
    assert read(tmp_path / f"a{suffix}") is None


@pytest.fixture
def document() -> dict:
    """A glTF of a box whose buffer is inside."""
    exported = trimesh.Scene(trimesh.creation.box()).export(file_type="gltf")
    document = json.loads(exported.pop("model.gltf"))
    for entry in document["buffers"]:
        entry["uri"] = "data:application/octet-stream;base64," + base64.b64encode(exported[entry["uri"]]).decode()
    return document


def changed(document: dict, **parts) -> dict:
    return document | parts


BOMBS = {
    "an accessor without a view": lambda d: changed(
        d, accessors=[{"count": 2**30, "type": "MAT4", "componentType": 5126}, *d["accessors"][1:]]
    ),
    "the same view a million times": lambda d: changed(
        d, bufferViews=[*d["bufferViews"], *[d["bufferViews"][0]] * 40_000]
    ),
    "the same mesh in all nodes": lambda d: changed(
        d,
        nodes=[{"mesh": 0}] * 4000,
        scenes=[{"nodes": list(range(4000))}],
        scene=0,
        accessors=[one | {"count": one["count"] * 1} for one in d["accessors"]],
        meshes=[{"primitives": d["meshes"][0]["primitives"] * 2000}],
    ),
    "nodes with several parents": lambda d: changed(
        d, nodes=[*({"children": [k + 1, k + 1]} for k in range(30)), {"mesh": 0}], scenes=[{"nodes": [0]}], scene=0
    ),
    "nodes in a ring": lambda d: changed(d, nodes=[{"children": [1]}, {"children": [0]}], scenes=[{"nodes": [0]}]),
    "nesting": lambda d: changed(d, extras=json.loads("[" * 300 + "]" * 300)),
    "a negative count": lambda d: changed(d, accessors=[one | {"count": -5} for one in d["accessors"]]),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_gltf_that_tells_of_more_than_it_has_is_refused(document, tmp_path, bomb):
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert read(tmp_path / "a.gltf") == 12
    (tmp_path / "b.gltf").write_text(json.dumps(BOMBS[bomb](document)))
    assert read(tmp_path / "b.gltf") is None


@pytest.mark.parametrize(
    "uri",
    ["../outside.bin", "{outside}", "file://{outside}", "http://127.0.0.1:9/a.bin", "%2e%2e/outside.bin", "link.bin"],
)
def test_a_buffer_outside_of_the_folder_is_not_read(document, tmp_path, uri):
    (tmp_path / "inside").mkdir()
    outside = tmp_path / "outside.bin"
    outside.write_bytes(base64.b64decode(document["buffers"][0]["uri"].partition(",")[2]))
    (tmp_path / "inside" / "link.bin").symlink_to(outside)
    document["buffers"][0]["uri"] = uri.format(outside=outside)
    (tmp_path / "inside" / "a.gltf").write_text(json.dumps(document))
    assert read(tmp_path / "inside" / "a.gltf") is None
    (tmp_path / "inside" / "there.bin").write_bytes(outside.read_bytes())
    document["buffers"][0]["uri"] = "there.bin"
    (tmp_path / "inside" / "a.gltf").write_text(json.dumps(document))
    assert read(tmp_path / "inside" / "a.gltf") == 12


@pytest.mark.parametrize("line", ["mtllib ../outside.mtl", "mtllib {outside}", "mtllib link.mtl"])
def test_materials_are_not_read_at_all(tmp_path, line, monkeypatch):
    outside = tmp_path / "outside.mtl"
    os.mkfifo(outside) if hasattr(os, "mkfifo") else outside.write_text("newmtl a\n")  # reading it would wait
    (tmp_path / "inside").mkdir()
    (tmp_path / "inside" / "link.mtl").symlink_to(outside)
    trimesh.creation.box().export(tmp_path / "inside" / "a.obj")
    text = (tmp_path / "inside" / "a.obj").read_text()
    (tmp_path / "inside" / "a.obj").write_text(f"{line.format(outside=outside)}\n{text}")
    assert read(tmp_path / "inside" / "a.obj") == 12
