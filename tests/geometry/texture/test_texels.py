"""Texels against a plain reference that asks every face about every texel."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.geometry.texture.texels import overlapping_faces, texel_map

SIZE = 16


def triangles(seed: int, count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    uvs = rng.uniform(0, 1, (3 * count, 2))
    uvs[3::9] = uvs[4::9]  # some without an area
    return uvs, np.arange(3 * count).reshape(-1, 3)


def nearest_in_triangle(point: np.ndarray, corners: np.ndarray) -> tuple[float, np.ndarray]:
    """Distance from a point (2,) to a triangle (3, 2), and the barycentric weights of the nearest point."""
    matrix = np.vstack([corners.T, np.ones(3)])
    if abs(np.linalg.det(matrix)) > 1e-12:
        weights = np.linalg.solve(matrix, [*point, 1])
        if (weights >= 0).all():
            return 0.0, weights
    best = (np.inf, np.zeros(3))
    for i in range(3):
        a, b = corners[i], corners[(i + 1) % 3]
        length = (b - a) @ (b - a)
        t = np.clip((point - a) @ (b - a) / length, 0, 1) if length else 0.0
        distance = float(np.linalg.norm(point - a - t * (b - a)))
        if distance < best[0]:
            weights = np.zeros(3)
            weights[i], weights[(i + 1) % 3] = 1 - t, t
            best = (distance, weights)
    return best


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1.5]))
def test_every_texel_shows_the_nearest_face(seed, margin_px):
    uvs, faces = triangles(seed)
    texels = texel_map(uvs, faces, SIZE, margin_px)
    for row in range(SIZE):
        for column in range(SIZE):
            centre = np.array([column + 0.5, row + 0.5])
            found = [nearest_in_triangle(centre, uvs[face] * SIZE) for face in faces]
            distance = min(d for d, _ in found)
            face = texels.face[row, column]
            if abs(distance - margin_px) < 1e-4 and margin_px:
                continue  # on the line, either is right
            assert (face >= 0) == (distance <= margin_px)
            if face >= 0:
                assert found[face][0] <= distance + 1e-5
                place = texels.weights[row, column] @ uvs[faces[face]] * SIZE
                assert abs(np.linalg.norm(place - centre) - distance) < 1e-3
                np.testing.assert_allclose(texels.weights[row, column].sum(), 1, atol=1e-5)
                assert texels.inside[row, column] == (distance == 0)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_overlaps_are_what_two_faces_cover(seed):
    uvs, faces = triangles(seed, 6)
    covering = overlapping_faces(uvs, faces, SIZE)
    centres = (np.stack(np.meshgrid(np.arange(SIZE), np.arange(SIZE)), -1).reshape(-1, 2) + 0.5) / SIZE
    depth = []
    for face in faces:
        matrix = np.vstack([uvs[face].T, np.ones(3)])
        if abs(np.linalg.det(matrix)) < 1e-12:
            depth.append(np.full(len(centres), -1.0))
            continue
        weights = np.linalg.solve(matrix, np.column_stack([centres, np.ones(len(centres))]).T)
        heights = abs(np.linalg.det(matrix)) / np.linalg.norm(uvs[np.roll(face, 1)] - uvs[np.roll(face, -1)], axis=1)
        depth.append((weights * heights[:, None]).min(0) * SIZE)  # texels inside the nearest edge
    for index in range(len(faces)):
        others = np.any([depth[j] > 2e-3 for j in range(index)], axis=0) if index else False
        if (others & (depth[index] > 2e-3)).any():
            assert covering[index]
        elif not (np.any([d > 0 for d in depth[:index]], axis=0) & (depth[index] > 0)).any():
            assert not covering[index]


def test_faces_that_share_an_edge_do_not_overlap():
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9))
    uvs = np.stack([x, y], -1)
    uvs[1:-1, 1:-1] += rng.uniform(-0.03, 0.03, (7, 7, 2))
    corner = (9 * np.arange(8)[:, None] + np.arange(8)).ravel()
    quads = np.stack([corner, corner + 1, corner + 10, corner + 9], 1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    assert not overlapping_faces(uvs.reshape(-1, 2), faces, 200).any()
    assert (texel_map(uvs.reshape(-1, 2), faces, 200, 0.0).face >= 0).all()


def test_threads_do_not_change_the_bits(with_threads):
    uvs, faces = triangles(5, 300)

    def arrays():
        texels = texel_map(uvs, faces, 200, 1.5)
        return texels.face, texels.weights, overlapping_faces(uvs, faces, 200)

    for one, other in zip(with_threads(1, arrays), arrays(), strict=True):
        np.testing.assert_array_equal(one, other)
