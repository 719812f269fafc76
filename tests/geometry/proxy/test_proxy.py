"""The geometry proxy on disk: its objects, and files older than they are."""

import dataclasses
import tracemalloc
import zipfile

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance


def proxy(**instances) -> GeometryProxy:
    """Three faces, the last of a prior."""
    vertices = np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32)
    faces = np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4]], np.int32)
    provenance = np.array([Provenance.OBSERVED, Provenance.COMPLETED, Provenance.PRIOR], np.uint8)
    return GeometryProxy(
        vertices, faces, provenance, np.array([2, 0, 1], np.uint16), np.ones(3, np.float32), **instances
    )


def test_objects_survive_the_disk_by_number_and_name(tmp_path):
    saved = proxy(instance=np.array([0, 0, 2], np.int32), instance_names=("table", "küche/stuhl"))
    saved.save(tmp_path / "proxy.npz")
    loaded = GeometryProxy.load(tmp_path / "proxy.npz")
    assert loaded.instance_names == ("table", "küche/stuhl")
    for name in ("vertices", "faces", "provenance", "support", "confidence", "instance"):
        assert getattr(loaded, name).dtype == getattr(saved, name).dtype
        np.testing.assert_array_equal(getattr(loaded, name), getattr(saved, name))


def test_a_file_without_objects_is_all_room(tmp_path):
    saved = proxy()
    arrays = {name: value for name, value in vars(saved).items() if not name.startswith("instance")}
    np.savez(tmp_path / "proxy.npz", **arrays)
    loaded = GeometryProxy.load(tmp_path / "proxy.npz")
    assert loaded.instance.tolist() == [0, 0, 0]
    assert (loaded.instance.dtype, loaded.instance_names) == (np.int32, ())


def test_the_ply_tells_faces_by_colour_and_object(tmp_path):
    proxy(instance=np.array([0, 0, 7], np.int32)).save_ply(tmp_path / "proxy.ply")
    mesh = trimesh.load(tmp_path / "proxy.ply", process=False)
    assert len(np.unique(mesh.visual.face_colors, axis=0)) == 3
    assert mesh.metadata["_ply_raw"]["face"]["data"]["instance"].tolist() == [0, 0, 7]


@pytest.mark.parametrize(
    "wrong",
    [
        {"support": np.ones(2, np.uint16)},
        {"confidence": np.ones((3, 1), np.float32)},
        {"provenance": np.zeros(3)},
        {"provenance": np.full(3, 7, np.uint8)},
        {"faces": np.array([[0, 1, 2], [1, 2, 3], [2, 3, 5]], np.int32)},
        {"vertices": np.full((5, 3), np.nan, np.float32)},
        {"confidence": np.full(3, np.nan, np.float32)},
        {"confidence": np.full(3, 1.5, np.float32)},
        {"confidence": np.full(3, -0.1, np.float32)},
        {"provenance": np.full(3, -1, np.int8)},
        {"faces": np.zeros((3, 3), np.float32)},
        {"support": np.full(3, -1, np.int32)},
        {"instance": np.array([0, 1, 0], np.int32)},
        {"instance": np.array([0, -1, 0], np.int32)},
    ],
)
def test_a_file_whose_arrays_do_not_belong_together_is_no_proxy(tmp_path, wrong):
    """Else the step that reads it fails on the way, and its message names no file."""
    dataclasses.replace(proxy(), **wrong).save(tmp_path / "proxy.npz")
    with pytest.raises(GeometryError, match=r"proxy\.npz: this is not a geometry proxy\. Run"):
        GeometryProxy.load(tmp_path / "proxy.npz")


@pytest.mark.parametrize("name", ["vertices", "faces", "confidence", "instance_names"])
@pytest.mark.parametrize("kind", ["bomb", "shape", "letters", "object", "bytes"])
def test_an_array_that_claims_more_than_it_has_is_refused_before_memory_is_taken(tmp_path, name, kind):
    file = tmp_path / "proxy.npz"
    saved = proxy(instance=np.array([0, 0, 1], np.int32), instance_names=("table",))
    saved.save(file)
    arrays = dict(np.load(file))
    if kind == "object":
        np.savez(file, **arrays | {name: np.array([{"a": 1}], object)})
    else:
        head = {"bomb": "'<f8', 'fortran_order': False, 'shape': (60000000,), }"}
        head |= {"shape": "'<f8', 'fortran_order': False, 'shape': (1099511627776,), }"}
        head |= {"letters": "'<U-7', 'fortran_order': False, 'shape': (9,), }"}
        text = ("{'descr': " + head.get(kind, "")).ljust(117).encode() + b"\n"
        content = b"not an array" if kind == "bytes" else b"\x93NUMPY\x01\x00v\x00" + text
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for other, array in arrays.items():
                with archive.open(f"{other}.npy", "w") as member:
                    if other != name:
                        np.lib.format.write_array(member, array)
                    else:
                        member.write(content)
                        for _ in range(480 if kind == "bomb" else 0):
                            member.write(bytes(1_000_000))
    tracemalloc.start()
    try:
        with pytest.raises(GeometryError, match=r"proxy\.npz"):
            GeometryProxy.load(file)
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()
