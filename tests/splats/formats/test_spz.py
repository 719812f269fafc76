from __future__ import annotations

import gzip
import struct
import tracemalloc

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.registry import load_asset, save_asset

RUB_FROM_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def octets(values) -> bytes:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8).tobytes()


def parts_of(asset: SplatAsset, version: int) -> list[bytes]:
    """The parts of a file as the format's own text describes them, Gaussian by Gaussian."""
    if version == 1:
        positions = asset.means.astype("<f2").tobytes()
    else:
        fixed = [round(float(v) * 4096) for v in asset.means.ravel()]
        positions = b"".join(v.to_bytes(3, "little", signed=True) for v in fixed)
    rotations = b""
    for w, x, y, z in asset.quaternions / np.linalg.norm(asset.quaternions, axis=1, keepdims=True):
        q = np.array([x, y, z, w])
        if version < 3:
            rotations += octets((q[:3] if w >= 0 else -q[:3]) * 127.5 + 127.5)
            continue
        largest = int(np.abs(q).argmax())
        q = q if q[largest] > 0 else -q
        word = largest
        for k in range(4):
            if k != largest:
                word = word << 10 | int(q[k] < 0) << 9 | round(abs(q[k]) * 2**0.5 * 511)
        rotations += struct.pack("<I", word)
    return [
        positions,
        octets(asset.opacities * 255),
        octets(asset.sh[:, 0] * 0.15 * 255 + 127.5),
        octets((asset.log_scales + 10) * 16),
        rotations,
        octets(asset.sh[:, 1:] * 128 + 128),
    ]


def written(asset: SplatAsset, version: int, degree: int | None = None, extensions: bytes = b"") -> bytes:
    degree = asset.degree if degree is None else degree
    parts = [p for p in parts_of(asset, version) if p]
    flags = 2 if extensions else 0
    if version < 4:
        header = struct.pack("<4sIIBBBB", b"NGSP", version, len(asset), degree, 12, flags, 0)
        return gzip.compress(b"".join([header, *parts, extensions]))
    streams = [zstandard.compress(p) for p in parts]
    table = b"".join(struct.pack("<QQ", len(s), len(p)) for s, p in zip(streams, parts, strict=True))
    header = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, len(asset), degree, 12, flags, len(parts), 32 + len(extensions))
    return header + extensions + table + b"".join(streams)


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_every_version_is_read(asset, fidelity_db, tmp_path, version):
    path = tmp_path / "a.spz"
    path.write_bytes(written(asset.transformed(RUB_FROM_WORLD), version))
    loaded = load_asset(path)
    np.testing.assert_allclose(loaded.means, asset.means, atol=1e-3 if version == 1 else 2e-4)
    assert fidelity_db(loaded, asset) >= (27.0 if version < 3 else 35.0)  # eight bits a rotation's part


@pytest.mark.parametrize("version", [1, 2, 3])
@pytest.mark.parametrize("extensions", [False, True])
def test_a_file_without_its_gzip_is_the_same(asset, tmp_path, version, extensions):
    turned = written(asset.transformed(RUB_FROM_WORLD), version, extensions=coordinate_system(0) * extensions)
    (tmp_path / "a.spz").write_bytes(turned)
    (tmp_path / "raw.spz").write_bytes(gzip.decompress(turned))
    packed, raw = load_asset(tmp_path / "a.spz"), load_asset(tmp_path / "raw.spz")
    for part in ("means", "log_scales", "quaternions", "logit_opacities", "sh"):
        np.testing.assert_array_equal(getattr(raw, part), getattr(packed, part))
    (tmp_path / "raw.spz").write_bytes(gzip.decompress(written(asset, version))[:-1])
    with pytest.raises(AssetError, match="cut short"):
        load_asset(tmp_path / "raw.spz")


def test_the_written_file_is_version_3_in_the_axes_of_spz(asset, tmp_path):
    path = tmp_path / "a.spz"
    save_asset(path, asset)
    raw = gzip.decompress(path.read_bytes())
    magic, version, count, degree, bits, flags, _ = struct.unpack_from("<4sIIBBBB", raw)
    assert (magic, version, count, degree, bits, flags) == (b"NGSP", 3, len(asset), 3, 14, 0)
    words = np.frombuffer(raw, "u1", 9 * count, 16).reshape(count, 3, 3).astype(np.int64)
    fixed = words[..., 0] + 256 * words[..., 1] + 65536 * words[..., 2]
    means = np.where(fixed >= 2**23, fixed - 2**24, fixed) / 2**bits
    x, y, z = asset.means.T
    np.testing.assert_allclose(means, np.stack([x, z, -y], axis=1), atol=0.5 / 2**bits + 1e-7)
    expected = b"".join(parts_of(asset.transformed(RUB_FROM_WORLD), 3)[1:])
    body = np.frombuffer(raw, "u1", offset=16 + 9 * count)
    different = body != np.frombuffer(expected, "u1")
    assert different.mean() < 1e-3  # values on the edge of two steps


@pytest.mark.parametrize(("reach_m", "bits"), [(5.0, 14), (511.9, 14), (512.1, 13), (3000.0, 11), (2e6, 2)])
def test_fractional_bits_fit_the_asset(asset, tmp_path, reach_m, bits):
    far = asset.subset(np.arange(3))
    far.means[0] = reach_m, -reach_m, 0.001
    save_asset(tmp_path / "a.spz", far)
    assert gzip.decompress((tmp_path / "a.spz").read_bytes())[13] == bits
    np.testing.assert_allclose(load_asset(tmp_path / "a.spz").means, far.means, atol=0.5001 / 2**bits)


def test_an_asset_beyond_all_bits_is_refused(asset, tmp_path):
    far = asset.subset(np.arange(3))
    far.means[1, 1] = 1e7
    with pytest.raises(AssetError, match="beyond the reach"):
        save_asset(tmp_path / "a.spz", far)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0, width=32), min_size=4, max_size=4))
def test_rotations_keep_a_quarter_of_a_degree(tmp_path_factory, quaternion):
    q = np.array(quaternion, np.float64)
    if np.linalg.norm(q) < 1e-3:
        return
    path = tmp_path_factory.mktemp("q") / "a.spz"
    save_asset(path, SplatAsset(np.zeros((1, 3)), np.zeros((1, 3)), q[None], np.zeros(1), np.zeros((1, 1, 3))))
    loaded = load_asset(path).quaternions[0].astype(np.float64)
    cosine = abs(loaded @ q) / np.linalg.norm(loaded) / np.linalg.norm(q)
    assert np.degrees(2 * np.arccos(min(cosine, 1.0))) < 0.25


def coordinate_system(number: int) -> bytes:
    unknown = struct.pack("<II3s", 0x12340001, 3, b"abc")
    return unknown + struct.pack("<III", 0xADBE0003, 4, number)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize(
    ("number", "file_from_world"),
    [
        (6, [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),  # right down front
        (7, [[-1, 0, 0], [0, 0, 1], [0, 1, 0]]),  # left up front
        (12, np.eye(3)),  # right front up, our world
        (0, RUB_FROM_WORLD[:3, :3]),
    ],
)
def test_the_coordinate_system_extension_is_obeyed(asset, fidelity_db, tmp_path, version, number, file_from_world):
    turn = np.eye(4)
    turn[:3, :3] = file_from_world
    path = tmp_path / "a.spz"
    path.write_bytes(written(asset.transformed(turn), version, extensions=coordinate_system(number)))
    assert fidelity_db(load_asset(path), asset) >= 35.0


@pytest.mark.parametrize(("number", "name"), [(8, "RUF"), (3, "LUB"), (99, "number 99")])
def test_left_handed_and_unknown_systems_are_refused(asset, tmp_path, number, name):
    path = tmp_path / "a.spz"
    path.write_bytes(written(asset, 4, extensions=coordinate_system(number)))
    with pytest.raises(AssetError, match=f"{name}, not a right-handed one"):
        load_asset(path)


def test_of_degree_4_the_first_three_are_kept(asset, tmp_path):
    wide = asset.subset(np.arange(5)).transformed(RUB_FROM_WORLD)
    sh = np.concatenate([wide.sh, np.full((5, 9, 3), 0.25, np.float32)], axis=1)
    parts = parts_of(wide, 3)[:-1]
    header = struct.pack("<4sIIBBBB", b"NGSP", 3, 5, 4, 12, 0, 0)
    (tmp_path / "a.spz").write_bytes(gzip.compress(b"".join([header, *parts, octets(sh[:, 1:] * 128 + 128)])))
    loaded = load_asset(tmp_path / "a.spz")
    assert loaded.degree == 3
    np.testing.assert_allclose(loaded.sh[:, 1:], asset.sh[:5, 1:], atol=0.02)


def hostile_files() -> dict[str, bytes]:
    def header(version=3, count=10, degree=3):
        return struct.pack("<4sIIBBBB", b"NGSP", version, count, degree, 12, 0, 0)

    def table(length, size):
        return struct.pack("<QQ", length, size) * 6

    huge = zstandard.ZstdCompressor(write_content_size=True).compress(b"\0" * (1 << 26))
    start = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, 10, 3, 12, 0, 6, 32)
    return {
        "a count of four thousand million": gzip.compress(header(count=2**32 - 1)),
        "more than the file holds": gzip.compress(header(count=100)),
        "version 9": gzip.compress(header(version=9)),
        "version 3 without gzip": header() + b"\0" * 64,
        "degree 200": gzip.compress(header(degree=200)),
        "v4 count": struct.pack("<4sIIBBBBI12x", b"NGSP", 4, 2**32 - 1, 3, 12, 0, 6, 32),
        "v4 table beyond the end": struct.pack("<4sIIBBBBI12x", b"NGSP", 4, 1, 3, 12, 0, 6, 2**32 - 1),
        "v4 stream beyond the end": start + table(2**63, 90),
        "v4 stream claims 64 MiB": start + table(len(huge), 90) + huge,
        "v4 stream is noise": start + table(20, 90) + b"noise" * 40,
    }


def test_what_follows_the_gaussians_takes_no_memory(asset, tmp_path):
    path = tmp_path / "a.spz"
    raw = gzip.decompress(written(asset, 3))
    path.write_bytes(gzip.compress(raw + b"\0" * (1 << 27)))
    tracemalloc.start()
    try:
        assert len(load_asset(path)) == len(asset)
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("case", hostile_files())
def test_a_header_is_not_believed(tmp_path, case):
    path = tmp_path / "a.spz"
    path.write_bytes(hostile_files()[case])
    tracemalloc.start()
    try:
        with pytest.raises(AssetError, match=r"a\.spz"):
            load_asset(path)
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()
