"""The head's picture: the asset to the bit where no body is, and bodies before and behind a wall of splats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.colours import linear_from_srgb, srgb_from_linear
from r2sego_blender.core.images import to_uint8
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.bodies import BodyShape
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.views.drawn_bodies import DrawnBody
from r2sego_blender.views.head_image import SIZE_PX, HeadCamera, HeadView
from r2sego_blender.views.room_looks import SplatLooks

WALL_M = 2.0
RED = (1.0, 0.0, 0.0)
ROBOT = RobotModel.load()
REST = ROBOT.rest_qpos
HEAD = ROBOT.camera_poses(REST[None])[0, :3, 3]
AHEAD = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""Columns: the camera's axes of one that looks along x."""


def wall(logit: float = 6.0) -> SplatAsset:
    """Grey-green discs across the view, ``WALL_M`` from the world's origin."""
    y, z = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 90), np.linspace(-1.5, 3.5, 90)))
    count = len(y)
    return SplatAsset(
        np.stack([np.full(count, WALL_M), y, z], 1),
        np.tile(np.log([0.002, 0.05, 0.05]), (count, 1)),
        np.tile([1.0, 0, 0, 0], (count, 1)),
        np.full(count, logit),
        np.tile([-0.4, 0.5, -0.4], (count, 1, 1)),
    )


def box(colour: tuple[float, float, float] = RED) -> DrawnBody:
    """A cube of 20 cm about its origin."""
    cube = trimesh.creation.box((0.2, 0.2, 0.2))
    colours = np.tile(np.float32(colour), (len(cube.faces), 1))
    return DrawnBody.of(BodyShape(-1, "box", np.float32(cube.vertices), np.int32(cube.faces), colours))


def at(*place: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose


def level_view() -> HeadView:
    """The robot's lens, looking along x from where its head is."""
    view = HeadView.of(ROBOT)
    turned = view.parent_from_camera.copy()
    turned[:3, :3] = AHEAD
    return replace(view, parent_from_camera=turned)


VIEW = level_view()
CAMERA = VIEW.lens.at(np.block([[AHEAD, HEAD[:, None]], [np.zeros(3), 1.0]]))


def head(asset: SplatAsset) -> HeadCamera:
    return HeadCamera(SplatLooks(PackedGaussians.of(asset)), ROBOT)


@pytest.fixture(scope="module")
def before_wall() -> HeadCamera:
    return head(wall())


def ahead(distance_m: float) -> np.ndarray:
    """In the middle of the view, the front of a box ``distance_m`` from the world's origin."""
    return at(distance_m + 0.1, HEAD[1], HEAD[2])


def is_red(picture: np.ndarray) -> np.ndarray:
    return (picture[..., 0] > 120) & (picture[..., 1:].max(axis=-1) < 60)


def test_without_bodies_in_view_the_picture_is_the_assets_own_to_the_bit(before_wall):
    asset = wall()
    seen, rendered = before_wall.see(REST, VIEW), render(asset, CAMERA)
    assert seen.colour.shape == (*reversed(SIZE_PX), 3) and seen.colour.dtype == np.uint8
    np.testing.assert_array_equal(seen.colour, to_uint8(rendered.colour))
    np.testing.assert_array_equal(seen.depth_m, rendered.depth)
    assert not seen.body.any() and seen.colour.std() > 0.0
    behind_the_head = before_wall.see(REST, VIEW, [(box(), at(-1.0, *HEAD[1:]))])
    np.testing.assert_array_equal(behind_the_head.colour, seen.colour)


def test_a_body_before_the_wall_is_shown_at_its_depth_and_one_behind_is_hidden(before_wall):
    alone = before_wall.see(REST, VIEW)
    shown = before_wall.see(REST, VIEW, [(box(), ahead(1.5))])
    side_px = 0.2 / (1.5 - HEAD[0]) * VIEW.lens.fx
    assert abs(np.sqrt(is_red(shown.colour).sum()) - side_px) < 1.0
    assert (is_red(shown.colour) == shown.body).all()
    np.testing.assert_allclose(shown.depth_m[shown.body], 1.5 - HEAD[0], atol=1e-4)
    np.testing.assert_array_equal(shown.colour[~shown.body], alone.colour[~shown.body])
    hidden = before_wall.see(REST, VIEW, [(box(), ahead(2.2))])
    np.testing.assert_array_equal(hidden.colour, alone.colour)
    touching = before_wall.see(REST, VIEW, [(box(), ahead(2.03))])  # splats lie before what they show
    assert touching.body.sum() >= 100


def test_through_a_thin_wall_a_body_is_seen_as_the_rasterisers_background_is(before_wall):
    """A body behind all splats is a background; its pixels lie inside the box, where it is one colour."""
    thin = wall(logit=-1.5)
    seen = head(thin).see(REST, VIEW, [(box(), ahead(2.5))])
    opaque = head(SplatAsset.empty()).see(REST, VIEW, [(box(), ahead(2.5))])
    (colour,) = np.unique(opaque.colour[opaque.body], axis=0)
    expected = to_uint8(render(thin, CAMERA, colour / 255.0).colour)
    difference = np.abs(seen.colour.astype(int) - expected)[opaque.body]
    assert difference.max() <= 1
    assert not is_red(seen.colour).any()
    np.testing.assert_array_equal(seen.colour[~opaque.body], to_uint8(render(thin, CAMERA).colour)[~opaque.body])


def test_the_nearer_of_two_bodies_is_seen_and_its_faces_are_shaded_by_the_light(before_wall):
    both = [(box((0.0, 0.0, 1.0)), ahead(1.6)), (box(), ahead(1.2))]
    for bodies in (both, both[::-1]):
        assert is_red(before_wall.see(REST, VIEW, bodies).colour[48, 64])
    below = at(1.2, HEAD[1], HEAD[2] - 0.35)
    reds = [
        before_wall.see(REST, replace(VIEW, light=light), [(box(), below)]).colour[..., 0]
        for light in ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0))
    ]
    top, front = np.argmax(reds[0]), np.argmax(reds[1])
    assert top != front
    assert reds[0].flat[top] == 255 == reds[1].flat[front]
    assert reds[0].flat[front] == reds[1].flat[top] == round(0.55 * 255)


def test_the_robot_sees_its_own_arms_and_not_the_inside_of_its_head(before_wall):
    view = HeadView.of(ROBOT)
    reach = REST.copy()
    for name in ("left_shoulder_pitch_joint", "right_shoulder_pitch_joint"):
        reach[ROBOT.model.jnt_qposadr[ROBOT.model.joint(name).id]] = -0.9
    assert not before_wall.see(REST, view).body.any()
    arms = before_wall.see(reach, view).body
    assert 0.05 < arms.mean() < 0.5
    assert arms[:, :64].any() and arms[:, 64:].any()


def test_gains_are_of_linear_light_and_the_same_state_gives_the_same_bytes(before_wall):
    bodies = [(box(), ahead(1.5))]
    plain, again = (before_wall.see(REST, VIEW, bodies) for _ in range(2))
    assert plain.colour.tobytes() == again.colour.tobytes() and plain.depth_m.tobytes() == again.depth_m.tobytes()
    gains = (1.3, 1.0, 0.8)
    exposed = before_wall.see(REST, replace(VIEW, gains=gains), bodies)
    expected = srgb_from_linear(linear_from_srgb(plain.colour / 255.0) * np.float32(gains))
    assert np.abs(exposed.colour / 255.0 - expected).max() <= 0.5 / 255.0 + 1e-6
    np.testing.assert_array_equal(exposed.colour[..., 1], plain.colour[..., 1])
    np.testing.assert_array_equal(exposed.depth_m, plain.depth_m)


def test_drawing_changes_no_threads_and_needs_none(before_wall, with_threads):
    one, two = (with_threads(count, lambda: before_wall.see(REST, VIEW, [(box(), ahead(1.5))])) for count in (1, 2))
    np.testing.assert_array_equal(one.colour, two.colour)
