import fake_bundle
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.conditions import render_conditions  # noqa: E402


def pixels_of(path):
    """An EXR as (H, W, 4), the first row at the top."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)[::-1]


def test_depth_normals_and_provenance_are_the_proxys(scene, bundle, tmp_path):
    path = bundle.camera_path(0, 0)[-2:]
    proxy = fake_bundle.proxy()
    written = render_conditions(proxy, path, tmp_path)
    assert [file.name for file in written] == [
        "depth_0001.exr", "normal_0001.exr", "provenance_0001.exr",
        "depth_0002.exr", "normal_0002.exr", "provenance_0002.exr",
    ]  # fmt: skip
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(file.name for file in written)
    for frame, camera in enumerate(path):
        depth, normal, provenance = (pixels_of(f) for f in written[3 * frame : 3 * frame + 3])
        expected, face = traced(proxy, camera)
        inside = face == np.median(face)  # away from edges, where the ray may hit the neighbour
        np.testing.assert_allclose(depth[inside, 0], expected[inside], rtol=1e-4)
        np.testing.assert_array_equal(provenance[inside, 0], proxy.provenance[face[inside]] + 1)
        agreement = np.abs(np.sum(normal[inside, :3] * face_normals(proxy)[face[inside]], axis=1))
        np.testing.assert_allclose(agreement, 1.0, atol=1e-3)
    assert "R2S-EGO conditions" not in bpy.data.scenes


def face_normals(proxy):
    a, b, c = (proxy.vertices[proxy.faces[:, k]].astype(np.float64) for k in range(3))
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def traced(proxy, camera):
    """Planar depth (H, W) and face (H, W) by intersecting every ray with every triangle."""
    rays = camera.rays().reshape(-1, 3) @ camera.world_from_camera[:3, :3].T
    best, face = np.full(len(rays), np.inf), np.full(len(rays), -1)
    for index, corners in enumerate(proxy.vertices[proxy.faces].astype(np.float64)):
        edges = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)
        system = np.concatenate([np.broadcast_to(edges, (len(rays), 3, 2)), -rays[:, :, None]], axis=2)
        solvable = np.abs(np.linalg.det(system)) > 1e-12
        solution = np.full((len(rays), 3), -1.0)
        offset = np.broadcast_to(camera.centre - corners[0], (int(solvable.sum()), 3))[..., None]
        solution[solvable] = np.linalg.solve(system[solvable], offset)[..., 0]
        u, v, depth = solution.T
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (depth > 1e-6) & (depth < best)
        best[hit], face[hit] = depth[hit], index
    return best.reshape(camera.shape), face.reshape(camera.shape)
