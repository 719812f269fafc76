"""How well cameras see faces, against what they draw."""

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.visibility.face_sight import face_sight
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

LENS = Camera(640, 480, 500.0, 510.0, 320.0, 240.0, np.eye(4))


def squares(*centres, side=0.2):
    """Level squares, two triangles each, facing up."""
    corner = side / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    vertices = np.concatenate([np.array(centre) + corner for centre in centres])
    faces = np.concatenate([[[0, 1, 2], [0, 2, 3]] + 4 * np.full((2, 3), k) for k in range(len(centres))])
    return vertices, faces


def sight_of(vertices, faces, *cameras):
    return face_sight(vertices, faces, cameras)


def test_angle_and_density_are_those_of_the_best_camera():
    vertices, faces = squares((0.0, 0.0, 0.0))
    above, aside = LENS.at(look_at((0.01, 0, 2.0), (0, 0, 0))), LENS.at(look_at((3.0, 0, 1.0), (0, 0, 0)))
    both, flat = sight_of(vertices, faces, aside, above), sight_of(vertices, faces, aside)
    np.testing.assert_allclose(flat.cosine, 1.0 / np.sqrt(10.0), rtol=0.03)
    np.testing.assert_allclose(both.cosine, 1.0, atol=0.002)
    assert (both.density > flat.density).all()


@pytest.mark.parametrize("eye", [(0.3, 0.1, 2.0), (1.5, 1.0, 1.2), (-2.0, 0.4, 1.0)])
def test_the_density_times_the_area_is_what_is_drawn(eye):
    vertices, faces = squares((0.1, 0.2, 0.0))
    camera = LENS.at(look_at(eye, (0, 0, 0)))
    drawn = (MeshRasterizer(vertices, faces).render(camera).face >= 0).sum()
    assert (sight_of(vertices, faces, camera).density * 0.5 * 0.2**2).sum() == pytest.approx(drawn, rel=0.05)


def test_what_is_hidden_outside_or_seen_from_behind_is_not_seen():
    vertices, faces = squares((0, 0, 0), (0, 0, 0.5), (9, 0, 0), side=0.6)
    above, below = LENS.at(look_at((0.01, 0, 2.0), (0, 0, 0))), LENS.at(look_at((0.01, 0, -2.0), (0, 0, 0)))
    assert (sight_of(vertices, faces, above).density > 0).tolist() == [False, False, True, True, False, False]
    assert not sight_of(vertices, faces, below).density.any()
    assert not sight_of(vertices, faces).cosine.any()
