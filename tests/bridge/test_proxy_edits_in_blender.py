"""Which faces a box and a lasso mean, and which pixels a drawn mask takes."""

import struct
import zlib

import numpy as np
import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

import bpy

from r2sego_blender.bridge.proxy.object_masks import drawn_region, known_masks
from r2sego_blender.bridge.proxy.proxy_edits import faces_in_lasso, world_triangles
from r2sego_blender.bridge.proxy.show_proxy import show_proxy
from r2sego_blender.bridge.robot.scope_outline import outline_of
from r2sego_blender.bridge.shared.simplified_viewport import draw_fewer_faces
from r2sego_blender.bundle.layout import mask_stems
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError, SceneError
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb
from r2sego_blender.splats.regions import in_polygon


def test_a_polygon_holds_what_is_inside_even_if_it_is_not_convex():
    horseshoe = [(0, 0), (6, 0), (6, 6), (4, 6), (4, 2), (2, 2), (2, 6), (0, 6)]
    points = np.array([(1, 5), (3, 5), (5, 5), (3, 1), (7, 1), (-1, 3)])
    assert in_polygon(points, horseshoe).tolist() == [True, False, True, True, False, False]
    assert not in_polygon(np.zeros((0, 2)), horseshoe).size


def test_polygons_and_brushes_take_their_pixels():
    square = drawn_region((10, 12), [(2, 3), (7, 3), (7, 8), (2, 8)], "LASSO", 0.0)
    assert square.sum() == 25 and square[3:8, 2:7].all()
    outside = drawn_region((10, 12), [(-5, -5), (30, -5), (30, 30), (-5, 30)], "POLYGON", 0.0)
    assert outside.all()
    dot = drawn_region((41, 41), [(20.5, 20.5)], "BRUSH", 10.0)
    assert dot.sum() == pytest.approx(np.pi * 100, rel=0.03) and dot[20, 20] and not dot[20, 31]
    line = drawn_region((41, 41), [(5, 20), (35, 20)], "BRUSH", 3.0)
    assert line.sum() == pytest.approx(30 * 6 + np.pi * 9, rel=0.06)
    assert not drawn_region((5, 5), [(50, 50), (60, 50), (60, 60)], "LASSO", 0.0).any()


@pytest.fixture
def corners():
    """Small triangles at random in a cube of side 4, facing all ways."""
    rng = np.random.default_rng(3)
    return (rng.uniform(-2, 2, (400, 1, 3)) + rng.normal(0, 0.02, (400, 3, 3))).astype(np.float32)


def test_a_proxy_of_which_fewer_faces_are_drawn_is_read_whole(scene, bundle):
    proxy = show_proxy(scene, bundle, 0)
    faces = len(proxy.data.polygons)
    draw_fewer_faces(proxy, faces - 4)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for _ in range(2):
        assert len(world_triangles(proxy, depsgraph)[1]) == faces
        depsgraph.update()
        assert len(proxy.evaluated_get(depsgraph).data.polygons) < faces


@pytest.mark.parametrize("hidden", ["object", "collection", "layer"])
def test_what_blender_does_not_evaluate_is_refused_and_not_read_without_its_modifiers(scene, bundle, hidden):
    collection = bpy.data.collections.new("drawn")
    scene.collection.children.link(collection)
    drawn = bpy.data.objects.new("drawn", show_proxy(scene, bundle, 0).data)
    collection.objects.link(drawn)
    drawn.modifiers.new("twice", "ARRAY").count = 2
    faces = 2 * len(drawn.data.polygons)
    assert len(world_triangles(drawn, bpy.context.evaluated_depsgraph_get())[1]) == faces
    drawn.hide_set(True)
    assert len(world_triangles(drawn, bpy.context.evaluated_depsgraph_get())[1]) == faces
    if hidden == "layer":
        bpy.context.view_layer.layer_collection.children["drawn"].exclude = True
    else:
        {"object": drawn, "collection": collection}[hidden].hide_viewport = True
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for read in (world_triangles, outline_of):
        with pytest.raises(SceneError, match="Outliner"):
            read(drawn, depsgraph)


@pytest.mark.parametrize("parallel", [False, True])
def test_a_lasso_holds_what_is_drawn_within_it(corners, parallel):
    scale = 40.0 if parallel else 100.0
    camera = Camera(200, 160, scale, scale, 100.0, 80.0, look_at((0.5, -5.0, 1.0), (0, 0, 0)))
    polygon = np.array([(60, 40), (150, 50), (120, 130)])
    found = faces_in_lasso(corners, camera, polygon, parallel=parallel, farthest_m=5.5)
    both = faces_in_lasso(corners, camera, polygon, parallel=parallel, farthest_m=5.5, facing=False)
    for k, triangle in enumerate(corners.astype(float)):
        middle = triangle.mean(0)
        local = camera.camera_from_world[:3, :3] @ middle + camera.camera_from_world[:3, 3]
        place = local[:2] / (1.0 if parallel else local[2]) * scale + (100, 80)
        inside = in_polygon(place[None], polygon)[0] and 0 < local[2] <= 5.5
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        towards = normal @ (camera.forward if parallel else middle - camera.centre) < 0
        assert both[k] == inside and found[k] == (inside and towards)
    assert 0 < found.sum() < both.sum()


def test_a_mask_of_a_billion_pixels_is_refused_before_blender_loads_it(bundle):
    masks = bundle.path / "objects" / "chair" / "masks"
    masks.mkdir(parents=True)
    side, packer = 30_000, zlib.compressobj(1)
    pixels = b"".join(packer.compress(bytes(side // 8 + 1)) for _ in range(side)) + packer.flush()
    parts = ((b"IHDR", struct.pack(">2I5B", side, side, 1, 0, 0, 0, 0)), (b"IDAT", pixels), (b"IEND", b""))
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    ]
    (stem,) = mask_stems([bundle.captures()[0].name])
    (masks / f"{stem}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    forget_peak_memory()
    before_mb = peak_memory_mb() or 0.0
    with pytest.raises(GeometryError, match="pixels"):
        known_masks(bundle, "chair")
    assert (peak_memory_mb() or 0.0) - before_mb < 200.0
