"""Splat files of strangers: clean values or an error that names the file, in little time and memory."""

from __future__ import annotations

import base64
import gzip
import json
import os
import struct
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard

from r2sego_blender.core.errors import AssetError
from r2sego_blender.results.panels.splat_ply import read_splats
from r2sego_blender.splats.asset import LARGEST, LARGEST_LOG_SCALE, SplatAsset
from r2sego_blender.splats.formats import usd_stage
from r2sego_blender.splats.formats.ply import save_ply
from r2sego_blender.splats.formats.ply_vertices import vertex_count
from r2sego_blender.splats.formats.registry import load_asset, save_asset

HOSTILE = Path(__file__).parents[3].parent / "shared" / "failing" / "hostile"
FILES = sorted(HOSTILE.glob("splat*/*")) + sorted(HOSTILE.glob("bundle_asset.ply/*"))
MOST_BYTES = 200 << 20
MOST_S = 1.0
OPENUSD_BYTES = 150 << 20
"""What it takes before it has opened anything."""


def read(path: Path) -> SplatAsset | None:
    """The asset, whose values are checked, or None where the file is refused; in bounded time and memory."""
    tracemalloc.start()
    before = time.process_time()
    try:
        asset = load_asset(path)
    except AssetError as error:
        assert path.name in str(error)
        assert error.cure
        return None
    finally:
        taken, (_, peak) = time.process_time() - before, tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < max(MOST_BYTES, 10 * path.stat().st_size)
        assert taken < MOST_S
    require_clean(asset)
    return asset


def require_clean(asset: SplatAsset) -> None:
    for values in (asset.means, asset.logit_opacities, asset.sh):
        assert np.abs(values).max(initial=0.0) <= LARGEST  # no number is not less either
    assert asset.log_scales.max(initial=0.0) <= LARGEST_LOG_SCALE
    lengths = np.sqrt((asset.quaternions * asset.quaternions).sum(axis=1))  # in float32, as kernels do
    assert ((lengths > 0.0) & (lengths < np.inf)).all()


@pytest.mark.skipif(not FILES, reason="the collected files are not beside this checkout")
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.name[:8]}")
def test_every_file_that_once_did_harm(path):
    read(path)


@pytest.fixture
def few(asset) -> SplatAsset:
    return asset.subset(np.arange(20)).copy()


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("means", 1e18),
        ("means", -3e38),
        ("log_scales", 89.0),
        ("quaternions", np.nan),
        ("logit_opacities", 1e38),
        ("sh", 3e38),
    ],
)
def test_a_gaussian_beyond_all_bounds_is_dropped_by_the_engine_and_by_blender(few, tmp_path, part, value):
    getattr(few, part)[3] = value
    save_ply(tmp_path / "a.ply", few)
    loaded = read(tmp_path / "a.ply")
    assert loaded is not None
    np.testing.assert_array_equal(loaded.means, np.delete(few.means, 3, axis=0))
    np.testing.assert_array_equal(read_splats(tmp_path / "a.ply").means, loaded.means)


def test_an_asset_without_gaussians_is_shown_as_none(tmp_path):
    save_ply(tmp_path / "a.ply", SplatAsset.empty(3))
    assert len(read_splats(tmp_path / "a.ply")) == len(load_asset(tmp_path / "a.ply")) == 0


def test_what_others_write_as_infinite_is_shown_as_the_engine_reads_it(few, tmp_path):
    few.logit_opacities[1], few.log_scales[2, 0] = np.inf, -np.inf
    save_ply(tmp_path / "a.ply", few)
    loaded, shown = load_asset(tmp_path / "a.ply"), read_splats(tmp_path / "a.ply")
    for name in ("means", "log_scales", "opacities"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(loaded, name))
    assert len(loaded) == len(few)


@pytest.mark.parametrize("length", [0.0, 1e-30, 1e-10, 1e10, 1e30, 3e38])
def test_quaternions_that_float32_cannot_give_length_1_have_it_already(few, tmp_path, length):
    unit = few.quaternions[3] / np.linalg.norm(few.quaternions[3])
    few.quaternions[3] = unit * length
    save_ply(tmp_path / "a.ply", few)
    loaded = read(tmp_path / "a.ply")
    assert loaded is not None
    np.testing.assert_allclose(loaded.quaternions[3], unit if length > 1e-12 else [1, 0, 0, 0], atol=1e-6)
    np.testing.assert_array_equal(np.delete(loaded.quaternions, 3, 0), np.delete(few.quaternions, 3, 0))
    np.testing.assert_array_equal(read_splats(tmp_path / "a.ply").quaternions, loaded.quaternions)


@pytest.mark.parametrize("count", ["9" * 5000, "2147483648", "9223372036854775808", "-1", "\xb2", "1e3", "100000"])
@pytest.mark.parametrize("layout", ["ascii", "binary_little_endian"])
def test_a_count_that_the_file_cannot_hold_is_refused_before_anything_is_made_of_it(few, tmp_path, count, layout):
    path = tmp_path / "a.ply"
    save_ply(path, few)
    header, _, body = path.read_bytes().partition(b"end_header\n")
    header = header.replace(b"element vertex 20", f"element vertex {count}".encode("latin-1"))
    header = header.replace(b"binary_little_endian", layout.encode())
    path.write_bytes(header + b"end_header\n" + body)
    assert read(path) is None
    if count != "100000":  # by the file's size it could be
        with pytest.raises(AssetError):
            vertex_count(path)


def test_a_header_of_properties_without_end_is_refused(tmp_path):
    lines = ["ply", "format ascii 1.0", "element vertex 0", *(f"property float a{k}" for k in range(40_000))]
    (tmp_path / "a.ply").write_text("\n".join([*lines, "end_header", ""]))
    assert read(tmp_path / "a.ply") is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes among its files")
@pytest.mark.parametrize("suffix", [".ply", ".splat", ".spz", ".glb", ".usdc"])
def test_a_pipe_is_no_file(tmp_path, suffix):
    os.mkfifo(tmp_path / f"a{suffix}")
    assert read(tmp_path / f"a{suffix}") is None


def test_packed_nothing_is_no_million_gaussians(tmp_path):
    count, degree = 4_000_000, 3
    size = count * (9 + 1 + 3 + 3 + 4 + 45)
    header = struct.pack("<4sIIBBBB", b"NGSP", 3, count, degree, 12, 0, 0)
    (tmp_path / "a.spz").write_bytes(gzip.compress(header + bytes(size), 1))
    assert read(tmp_path / "a.spz") is None


def test_a_frame_that_claims_too_little_is_no_way_around(tmp_path):
    widths = (9, 1, 3, 3, 4)
    streams = [zstandard.compress(bytes(100_000_000)) for _ in widths]
    table = b"".join(struct.pack("<QQ", len(s), 10 * w) for s, w in zip(streams, widths, strict=True))
    header = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, 10, 0, 12, 0, 5, 32)
    (tmp_path / "a.spz").write_bytes(header + table + b"".join(streams))
    assert read(tmp_path / "a.spz") is None


@pytest.fixture
def document(few, tmp_path) -> dict:
    save_asset(tmp_path / "a.gltf", few)
    return json.loads((tmp_path / "a.gltf").read_text())


def test_one_mesh_shown_by_many_nodes_is_refused(document, tmp_path):
    document["nodes"] = [{"mesh": 0}] * 20_000
    document["scenes"][0]["nodes"] = list(range(20_000))
    document["buffers"][0]["uri"] = "a.bin"
    (tmp_path / "a.bin").write_bytes(bytes(document["buffers"][0]["byteLength"]))
    count = document["buffers"][0]["byteLength"] // 12
    for accessor in document["accessors"]:  # all read the same bytes
        accessor |= {"bufferView": 0, "count": count // 20}
    document["bufferViews"][0] = {"buffer": 0, "byteLength": document["buffers"][0]["byteLength"]}
    (tmp_path / "b.gltf").write_text(json.dumps(document))
    assert read(tmp_path / "b.gltf") is None


@pytest.mark.parametrize(
    "broken",
    [
        lambda document: document | {"nodes": [{"children": [0]}]},
        lambda document: document | {"nodes": [{}] * 100_000},
        lambda document: document | {"extras": json.loads("[" * 200 + "]" * 200)},
        lambda document: document | {"extras": 10**400},
        lambda document: document | {"extras": float("nan")},
        lambda document: document | {"buffers": [{"byteLength": 1, "uri": "data:;base64,@@@@"}]},
        lambda document: document | {"buffers": [{"byteLength": 2**62, "uri": "data:;base64,AAAA"}]},
        lambda document: document | {"accessors": [{**document["accessors"][0], "count": 2**40}] * 60},
    ],
)
def test_gltf_without_end_is_refused(document, tmp_path, broken):
    (tmp_path / "b.gltf").write_text(json.dumps(broken(document)))
    assert read(tmp_path / "b.gltf") is None


def test_a_buffer_that_is_named_a_thousand_times_is_read_once(document, tmp_path):
    buffer = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    (tmp_path / "a.bin").write_bytes(buffer + bytes(1_000_000))
    document["buffers"] = [{"byteLength": len(buffer), "uri": "a.bin"}] * 1000
    (tmp_path / "b.gltf").write_text(json.dumps(document))
    assert read(tmp_path / "b.gltf") is not None


@pytest.mark.parametrize("is_link_of", ["file", "folder"])
def test_a_link_out_of_the_folder_is_not_followed(document, tmp_path, is_link_of):
    (tmp_path / "inside").mkdir()
    (tmp_path / "outside").mkdir()
    buffer = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    (tmp_path / "outside" / "a.bin").write_bytes(buffer)
    if is_link_of == "file":
        (tmp_path / "inside" / "a.bin").symlink_to(tmp_path / "outside" / "a.bin")
        document["buffers"][0]["uri"] = "a.bin"
    else:
        (tmp_path / "inside" / "there").symlink_to(tmp_path / "outside")
        document["buffers"][0]["uri"] = "there/a.bin"
    (tmp_path / "inside" / "b.gltf").write_text(json.dumps(document))
    assert read(tmp_path / "inside" / "b.gltf") is None


OUTSIDE = [
    'over "Splats" (prepend references = @{outside}@) {{}}',
    'over "Splats" (prepend payload = @{outside}@) {{}}',
    'over "Splats" (prepend references = @../outside/splats.usda@) {{}}',
    'over "Splats" (prepend references = @./linked.usda@) {{}}',
    'over "Splats" (prepend references = @./through.usda@) {{}}',
    'over "Splats" (prepend references = @`"${{P}}"`@) {{}}',
    """def "A" (variants = {{string v = "b"}}; prepend variantSets = "v") {{
 variantSet "v" = {{
 "b" (prepend references = @{outside}@) {{
 }}
 }}
 }}""",
    'def "A" (clips = {{dictionary a = {{asset[] assetPaths = [@{outside}@]; string primPath = "/Splats"}}}}) {{}}',
]


@pytest.mark.parametrize(("suffix", "prim"), [(".usdc", OUTSIDE[0]), *((".usda", prim) for prim in OUTSIDE)])
def test_a_stage_reads_nothing_outside_of_its_folder(few, tmp_path, prim, suffix):
    from pxr import Sdf

    for folder in ("inside", "outside"):
        (tmp_path / folder).mkdir()
    outside = tmp_path / "outside" / "splats.usda"
    save_asset(outside, few)
    (tmp_path / "inside" / "linked.usda").symlink_to(outside)
    head = f'#usda 1.0\n(upAxis = "Z"; metersPerUnit = 1; expressionVariables = {{string P = "{outside}"}})\n'
    (tmp_path / "inside" / "through.usda").write_text(head + OUTSIDE[0].format(outside=outside))
    stage = tmp_path / "inside" / f"a{suffix}"
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(head + prim.format(outside=outside))
    layer.Export(str(stage))
    with pytest.raises(AssetError, match=rf"a\{suffix}: the (stage refers|prim /A takes)"):
        load_asset(stage)


def test_a_sublayer_outside_is_refused_and_one_beside_is_read(few, tmp_path):
    save_asset(tmp_path / "splats.usda", few)
    (tmp_path / "inside").mkdir()
    text = '#usda 1.0\n(upAxis = "Z"; metersPerUnit = 1; subLayers = [@{}@])\n'
    (tmp_path / "inside" / "a.usda").write_text(text.format("../splats.usda"))
    (tmp_path / "b.usda").write_text(text.format("./splats.usda"))
    (tmp_path / "c.usda").write_text(text.format("splats.usda"))
    assert read(tmp_path / "inside" / "a.usda") is None
    for name in ("b.usda", "c.usda"):
        loaded = load_asset(tmp_path / name)
        np.testing.assert_array_equal(loaded.means, few.means)


def test_what_a_stage_looks_for_is_not_found_where_the_program_runs(few, tmp_path, monkeypatch):
    (tmp_path / "inside").mkdir()
    save_asset(tmp_path / "elsewhere.usda", few)
    (tmp_path / "inside" / "a.usda").write_text(
        '#usda 1.0\n(upAxis = "Z"; metersPerUnit = 1; subLayers = [@elsewhere.usda@])\n'
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PXR_AR_DEFAULT_SEARCH_PATH", str(tmp_path))
    assert read(tmp_path / "inside" / "a.usda") is None


@pytest.mark.skipif(sys.platform != "linux", reason="its memory is counted on Linux alone")
def test_prims_that_multiply_end_in_bounded_memory(tmp_path):
    """Twenty levels, each of which refers to the next four times: a trillion prims."""
    lines = ["#usda 1.0"]
    for level in range(20):
        shown = "".join(f' def "c{k}" (prepend references = </L{level + 1}>) {{}}' for k in range(4))
        lines.append(f'def "L{level}" {{{shown}}}')
    (tmp_path / "a.usda").write_text("\n".join([*lines, 'def "L20" {}', ""]))
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], stderr=-3); "
    code += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    command = [sys.executable, "-c", code, sys.executable, usd_stage.__file__, str(tmp_path / "a.usda"), "arrays.npz"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert int(done.stdout) << 10 < MOST_BYTES + OPENUSD_BYTES
    assert read(tmp_path / "a.usda") is None


def test_a_stage_may_be_large_by_what_it_refers_to(tmp_path):
    """Text of many megabytes behind a stage of a few bytes."""
    count = 30_000
    rng = np.random.default_rng(0)
    large = SplatAsset(
        rng.random((count, 3)),
        -rng.random((count, 3)),
        rng.random((count, 4)),
        rng.random(count),
        rng.random((count, 16, 3)),
    )
    save_asset(tmp_path / "large.usda", large)
    (tmp_path / "a.usda").write_text('#usda 1.0\n(upAxis = "Z"; metersPerUnit = 1; subLayers = [@./large.usda@])\n')
    assert len(load_asset(tmp_path / "a.usda")) == count


def test_a_gltf_whose_positions_are_of_another_kind_is_named(tmp_path):
    rng = np.random.default_rng(0)
    means, scales = rng.normal(size=(2, 12, 3)).astype(np.float32)
    turned = np.tile(np.array([1, 0, 0, 0], np.float32), (12, 1))
    save_asset(tmp_path / "a.glb", SplatAsset(means, scales, turned, np.zeros(12, np.float32), np.zeros((12, 4, 3))))
    content = (tmp_path / "a.glb").read_bytes()
    (tmp_path / "a.glb").write_bytes(content.replace(b'"POSITION": 0', b'"POSITION": 1'))
    assert read(tmp_path / "a.glb") is None
