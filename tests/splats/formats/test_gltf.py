from __future__ import annotations

import base64
import copy
import json
import struct
import tracemalloc

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.registry import load_asset, save_asset

Y_UP_FROM_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
SPLATS = "KHR_gaussian_splatting"


def opened(path) -> tuple[dict, bytes]:
    """Document and buffer of a .glb, by the letter of glTF 2.0."""
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    binary_size, binary_kind = struct.unpack_from("<I4s", data, 20 + size)
    assert binary_kind == b"BIN\0"
    assert size % 4 == binary_size % 4 == 0
    assert 28 + size + binary_size == len(data)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def attribute(document: dict, buffer: bytes, name: str) -> np.ndarray:
    primitive = document["meshes"][0]["primitives"][0]
    accessor = document["accessors"][primitive["attributes"][name]]
    view = document["bufferViews"][accessor["bufferView"]]
    kind = {5126: "<f4", 5123: "<u2"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    values = np.frombuffer(buffer, kind, accessor["count"] * width, view["byteOffset"])
    return values.reshape(-1, width)


def as_gltf(path, document: dict, buffer: bytes | None = None) -> None:
    if buffer is not None:
        uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
        document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))


@pytest.fixture
def written(asset, tmp_path) -> tuple[dict, bytes]:
    save_asset(tmp_path / "written.glb", asset)
    document, buffer = opened(tmp_path / "written.glb")
    return copy.deepcopy(document), buffer


def test_the_file_has_the_names_and_values_of_the_extension(asset, written):
    document, buffer = written
    assert document["extensionsUsed"] == [SPLATS]
    (primitive,) = document["meshes"][0]["primitives"]
    assert primitive["mode"] == 0
    assert primitive["extensions"] == {SPLATS: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}}
    names = {"POSITION", "COLOR_0", *(f"{SPLATS}:{n}" for n in ("ROTATION", "SCALE", "OPACITY"))}
    names |= {f"{SPLATS}:SH_DEGREE_{d}_COEF_{k}" for d in range(4) for k in range(2 * d + 1)}
    assert set(primitive["attributes"]) == names
    positions = attribute(document, buffer, "POSITION")
    accessor = document["accessors"][primitive["attributes"]["POSITION"]]
    np.testing.assert_array_equal(np.float32(accessor["min"]), positions.min(axis=0))
    np.testing.assert_array_equal(np.float32(accessor["max"]), positions.max(axis=0))
    rotations = attribute(document, buffer, f"{SPLATS}:ROTATION")
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=1), 1.0, atol=1e-6)
    opacities = attribute(document, buffer, f"{SPLATS}:OPACITY")[:, 0]
    np.testing.assert_allclose(opacities, asset.opacities, atol=1e-6)
    scales = attribute(document, buffer, f"{SPLATS}:SCALE")
    np.testing.assert_allclose(scales, np.exp(asset.log_scales), rtol=1e-5)


def test_the_numbers_in_the_file_are_the_scene_with_y_up(asset, fidelity_db, written):
    """Read literally, with cameras turned to Y up, they give the same views: harmonics are turned too."""
    document, buffer = written
    values = {name: attribute(document, buffer, f"{SPLATS}:{name}") for name in ("ROTATION", "SCALE", "OPACITY")}
    harmonics = [f"{SPLATS}:SH_DEGREE_{d}_COEF_{k}" for d in range(4) for k in range(2 * d + 1)]
    literal = SplatAsset(
        means=attribute(document, buffer, "POSITION"),
        log_scales=np.log(values["SCALE"]),
        quaternions=values["ROTATION"][:, [3, 0, 1, 2]],
        logit_opacities=np.log(values["OPACITY"] / (1 - values["OPACITY"]))[:, 0],
        sh=np.stack([attribute(document, buffer, name) for name in harmonics], axis=1),
    )
    x, y, z = asset.means.T
    np.testing.assert_allclose(literal.means, np.stack([x, z, -y], axis=1), atol=1e-6)
    assert fidelity_db(literal, asset, Y_UP_FROM_WORLD) >= 50.0


def test_other_programs_see_coloured_points(asset, written, tmp_path):
    (cloud,) = trimesh.load(tmp_path / "written.glb").geometry.values()
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_allclose(cloud.vertices, asset.means @ Y_UP_FROM_WORLD[:3, :3].T, atol=1e-6)
    colours = attribute(*written, "COLOR_0") / 65535.0
    light = colours[:, :3]
    display = np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(display, asset.base_colours.clip(0, 1), atol=2e-4)
    np.testing.assert_allclose(colours[:, 3], asset.opacities, atol=1e-5)


def test_the_buffer_may_lie_beside_the_file(asset, fidelity_db, written, tmp_path):
    document, buffer = written
    document["buffers"][0]["uri"] = "the%20room.bin"
    as_gltf(tmp_path / "a.gltf", document)
    with pytest.raises(AssetError, match=r"the room\.bin: the buffer cannot be read"):
        load_asset(tmp_path / "a.gltf")
    (tmp_path / "the room.bin").write_bytes(buffer)
    assert fidelity_db(load_asset(tmp_path / "a.gltf"), asset) >= 50.0


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/hostname", "http://host/a.bin", "a/../../b.bin", "%2e%2e/b"])
def test_a_buffer_elsewhere_is_refused(written, tmp_path, uri):
    document, _ = written
    document["buffers"][0]["uri"] = uri
    as_gltf(tmp_path / "a.gltf", document)
    with pytest.raises(AssetError, match="not beside the file"):
        load_asset(tmp_path / "a.gltf")


def test_nodes_place_the_splats(asset, fidelity_db, written, tmp_path):
    document, buffer = written
    half_turn = [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]  # a quarter about y
    document["nodes"] = [
        {"children": [1], "rotation": half_turn, "translation": [0.0, 1.0, 2.0]},
        {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0.5, 0, 0, 1]},
        {"mesh": 0},  # in no scene
    ]
    as_gltf(tmp_path / "a.gltf", document, buffer)
    rotated = np.array([[0.0, 0, 1, 0], [0, 1, 0, 1], [-1, 0, 0, 2], [0, 0, 0, 1]])
    scaled = np.diag([2.0, 2.0, 2.0, 1.0])
    scaled[0, 3] = 0.5
    expected = asset.transformed(Y_UP_FROM_WORLD.T @ rotated @ scaled @ Y_UP_FROM_WORLD)
    loaded = load_asset(tmp_path / "a.gltf")
    np.testing.assert_allclose(loaded.means, expected.means, atol=1e-5)
    assert fidelity_db(loaded, expected) >= 50.0


def test_two_nodes_give_two_copies(asset, written, tmp_path):
    document, buffer = written
    document["nodes"].append({"mesh": 0, "translation": [0, 5, 0]})
    del document["scenes"], document["scene"]
    as_gltf(tmp_path / "a.gltf", document, buffer)
    loaded = load_asset(tmp_path / "a.gltf")
    assert len(loaded) == 2 * len(asset)
    assert np.ptp(loaded.means[:, 2]) > 5.0


def test_quantised_attributes_are_read(asset, fidelity_db, written, tmp_path):
    document, buffer = written
    attributes = document["meshes"][0]["primitives"][0]["attributes"]

    def replaced(name: str, values: np.ndarray, component: int, normalised: bool) -> None:
        nonlocal buffer
        padded = np.zeros((len(values), -(-values[0].nbytes // 4) * 4 // values.itemsize), values.dtype)
        padded[:, : values.shape[1]] = values
        view = {"buffer": 0, "byteOffset": len(buffer), "byteLength": padded.nbytes, "byteStride": padded[0].nbytes}
        document["bufferViews"].append(view)
        document["accessors"][attributes[name]] |= {
            "bufferView": len(document["bufferViews"]) - 1,
            "componentType": component,
            "normalized": normalised,
        }
        buffer += padded.tobytes()
        document["buffers"][0]["byteLength"] = len(buffer)

    rotations = attribute(document, buffer, f"{SPLATS}:ROTATION")
    opacities = attribute(document, buffer, f"{SPLATS}:OPACITY")
    scales = attribute(document, buffer, f"{SPLATS}:SCALE")
    replaced(f"{SPLATS}:ROTATION", np.rint(rotations * 32767).astype("<i2"), 5122, True)
    replaced(f"{SPLATS}:OPACITY", np.rint(opacities * 255).astype("u1"), 5121, True)
    replaced(f"{SPLATS}:SCALE", np.rint(scales * 65535).astype("<u2"), 5123, True)
    as_gltf(tmp_path / "a.gltf", document, buffer)
    assert fidelity_db(load_asset(tmp_path / "a.gltf"), asset) >= 45.0


def primitive_of(document: dict) -> dict:
    return document["meshes"][0]["primitives"][0]


CHANGES = {
    "no splats": (lambda d: primitive_of(d).pop("extensions"), "no mesh with KHR_gaussian_splatting"),
    "no opacity": (lambda d: primitive_of(d)["attributes"].pop(f"{SPLATS}:OPACITY"), "OPACITY' is missing"),
    "half a degree": (
        lambda d: primitive_of(d)["attributes"].pop(f"{SPLATS}:SH_DEGREE_2_COEF_1"),
        "SH_DEGREE_2_COEF_1' is missing",
    ),
    "linear colours": (
        lambda d: primitive_of(d)["extensions"][SPLATS].update(colorSpace="lin_rec709_display"),
        "lin_rec709_display",
    ),
    "compressed": (lambda d: d["accessors"][0].pop("bufferView"), "sparse or compressed"),
    "a huge count": (lambda d: d["accessors"][0].update(count=10**15), "cut short"),
    "a negative count": (lambda d: d["accessors"][0].update(count=-1), "damaged"),
    "counts that differ": (lambda d: d["accessors"][0].update(count=3), "damaged"),
    "a stride of zero": (
        lambda d: (d["bufferViews"][0].update(byteStride=0), d["accessors"][0].update(count=500)),
        "damaged",
    ),
    "a huge buffer": (lambda d: d["buffers"][0].update(byteLength=10**15), "cut short"),
    "a negative index": (lambda d: d["accessors"][0].update(bufferView="x"), "damaged"),
    "a cycle": (lambda d: d["nodes"][0].update(children=[0]), "damaged"),
    "a shear": (lambda d: d["nodes"][0].update(matrix=[1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), "shears"),
    "a mirror": (lambda d: d["nodes"][0].update(scale=[-1, 1, 1]), "mirrors"),
    "text for a matrix": (lambda d: d["nodes"][0].update(matrix="no"), "damaged"),
    "thousands of copies": (
        lambda d: (d["nodes"].extend({"mesh": 0} for _ in range(5000)), d["scenes"][0].update(nodes=list(range(5001)))),
        "repeats its splats too often",
    ),
}


@pytest.mark.parametrize("case", CHANGES)
def test_what_cannot_be_read_is_said(written, tmp_path, case):
    document, buffer = written
    change, message = CHANGES[case]
    change(document)
    as_gltf(tmp_path / "a.gltf", document, buffer)
    with pytest.raises(AssetError, match=message) as caught:
        load_asset(tmp_path / "a.gltf")
    assert "a.gltf" in str(caught.value)


def test_json_nested_without_end(tmp_path):
    (tmp_path / "a.gltf").write_text('{"a":' + "[" * 200_000)
    with pytest.raises(AssetError, match="damaged"):
        load_asset(tmp_path / "a.gltf")


def test_a_large_text_file_is_written_in_little_memory(asset, tmp_path):
    large = asset.subset(np.arange(20_000) % len(asset))
    tracemalloc.start()
    save_asset(tmp_path / "large.gltf", large)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (tmp_path / "large.gltf").stat().st_size > 20_000 * 320
    assert peak < 21 << 20  # attributes, the asset turned, and one buffer of 4.9 MB; its text was held too
    np.testing.assert_allclose(load_asset(tmp_path / "large.gltf").means, large.means, atol=1e-6)


def test_a_glb_beyond_four_gigabytes_is_refused(asset, tmp_path, monkeypatch):
    monkeypatch.setattr("r2sego_blender.splats.formats.gltf._LARGEST_GLB", 1000)
    with pytest.raises(AssetError, match=r"too large for a \.glb"):
        save_asset(tmp_path / "a.glb", asset)
    assert not list(tmp_path.iterdir())


def test_gaussians_that_are_not_finite_are_dropped(asset, written, tmp_path):
    document, buffer = written
    values = np.frombuffer(buffer, "<f4").copy()
    values[:9] = np.nan  # the first three means
    as_gltf(tmp_path / "a.gltf", document, values.tobytes())
    assert len(load_asset(tmp_path / "a.gltf")) == len(asset) - 3
