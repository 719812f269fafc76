"""Start poses on the floor: each stands where the episode began, faces as it did, in the colour of its end."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.robot.show_starts import EPISODE, colours, show_starts  # noqa: E402
from r2sego_blender.bridge.shared.meshes import read_attribute  # noqa: E402
from r2sego_blender.core.colours import linear_from_srgb  # noqa: E402

STARTS = np.array([[1.0, 2.0, 0.0], [np.nan] * 3, [-0.5, 0.25, 2.5], [3.0, -1.0, -1.0], [0.0, 0.0, 1.0]])
ENDED = ["", "no_goal", "fall", "", "missed_target"]


def test_each_start_is_an_arrow_of_its_pose_and_of_its_ends_colour(scene, bundle):
    for _ in range(2):  # the second takes the place of the first
        shown = show_starts(scene, bundle, STARTS, ENDED)
    assert list(scene.objects) == [shown]
    mesh = shown.data
    places = np.array([vertex.co for vertex in mesh.vertices])
    episodes = read_attribute(mesh, EPISODE)
    assert sorted(set(episodes.tolist())) == [0, 2, 3, 4]
    for number in set(episodes.tolist()):
        faces = [mesh.polygons[face] for face in np.flatnonzero(episodes == number)]
        ways = places[sorted({vertex for face in faces for vertex in face.vertices}), :2] - STARTS[number, :2]
        farthest = ways[np.linalg.norm(ways, axis=1).argmax()]
        assert np.arctan2(farthest[1], farthest[0]) == pytest.approx(STARTS[number, 2], abs=1e-5)
        assert all(face.normal.z > 0.99 for face in faces)
        (material,) = {mesh.materials[face.material_index] for face in faces}
        expected = linear_from_srgb(np.array(colours(sorted(set(ENDED)))[ENDED[number]]))
        np.testing.assert_allclose(material.diffuse_color[:3], expected, atol=1e-6)


def test_ends_have_colours_of_their_own():
    ends = ["", "body_contact", "fall", "left_region", "missed_target", "time_out"]
    assert len(set(colours(ends).values())) == len(ends)
    assert colours(ends[1:])["fall"] == colours(ends)["fall"]  # success or not changes no failure's
