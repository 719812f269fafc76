"""What the bridge makes in Blender, in pip bpy."""

import json
import shutil

import fake_bundle
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from bpy_extras.object_utils import world_to_camera_view  # noqa: E402

from r2sego_blender.bridge.captures.show_captures import show_captures  # noqa: E402
from r2sego_blender.bridge.collision.show_collision import show_collision  # noqa: E402
from r2sego_blender.bridge.proxy.show_proxy import show_proxy  # noqa: E402
from r2sego_blender.bridge.scene.settings_properties import label, property_name, sections  # noqa: E402
from r2sego_blender.bridge.shared.cameras import camera_of, create_camera, use_frame_of  # noqa: E402
from r2sego_blender.bridge.shared.meshes import arrays_from_mesh, read_attribute  # noqa: E402
from r2sego_blender.bridge.shared.outliner import find_collection  # noqa: E402
from r2sego_blender.bridge.views.show_candidates import show_candidates  # noqa: E402
from r2sego_blender.config.presets import entries  # noqa: E402
from r2sego_blender.core.errors import SceneError  # noqa: E402
from r2sego_blender.core.images import load_image_uint8, save_image  # noqa: E402
from r2sego_blender.geometry.proxy.proxy import Provenance  # noqa: E402
from r2sego_blender.results.panels.bundle import Bundle  # noqa: E402
from r2sego_blender.results.panels.frusta import frustum_triangles  # noqa: E402


def blender_pixels(scene, camera_object, points):
    """Where Blender sees world points: (N, 2), origin at the top left."""
    use_frame_of(camera_object, scene)
    bpy.context.view_layer.update()
    width, height = scene.render.resolution_x, scene.render.resolution_y
    seen = np.array([world_to_camera_view(scene, camera_object, point) for point in to_vectors(points)])
    return np.stack([seen[:, 0] * width, (1.0 - seen[:, 1]) * height], axis=1)


def to_vectors(points):
    from mathutils import Vector

    return [Vector(point) for point in points]


@pytest.mark.parametrize("index", range(3), ids=["centred", "fx > fy, off centre", "fy > fx, off centre"])
def test_blender_sees_a_point_at_the_same_pixel(scene, index):
    camera = fake_bundle.cameras()[index]
    created = create_camera("camera", camera)
    scene.collection.objects.link(created)
    rng = np.random.default_rng(index)
    depth = rng.uniform(0.5, 5.0, 50)
    pixel = rng.uniform(0, 1, (50, 2)) * (camera.width, camera.height)
    local = np.column_stack(
        [(pixel[:, 0] - camera.cx) / camera.fx * depth, (pixel[:, 1] - camera.cy) / camera.fy * depth, depth]
    )
    points = local @ camera.world_from_camera[:3, :3].T + camera.centre
    expected, _ = camera.project(points)
    np.testing.assert_allclose(blender_pixels(scene, created, points), expected, atol=1e-3)


@pytest.mark.parametrize("index", range(3))
def test_a_camera_comes_back_from_its_object(scene, index):
    camera = fake_bundle.cameras()[index]
    created = create_camera("camera", camera)
    scene.collection.objects.link(created)
    bpy.context.view_layer.update()
    back = camera_of(created)
    np.testing.assert_allclose(back.world_from_camera, camera.world_from_camera, atol=1e-6)
    assert (back.width, back.height, back.fx, back.cy) == (camera.width, camera.height, camera.fx, camera.cy)


def test_a_cameras_scale_does_not_count(scene):
    camera = fake_bundle.cameras()[0]
    created = create_camera("scaled", camera)
    scene.collection.objects.link(created)
    created.scale = (2.0, 2.0, 0.5)  # how large it is drawn
    bpy.context.view_layer.update()
    np.testing.assert_allclose(camera_of(created).world_from_camera, camera.world_from_camera, atol=1e-6)


def test_a_camera_without_a_lens_is_refused(scene):
    with pytest.raises(SceneError, match="lens"):
        camera_of(bpy.data.objects.new("plain", bpy.data.cameras.new("plain")))


def test_captures_carry_their_photographs(scene, bundle):
    cameras = show_captures(scene, bundle)
    assert cameras[0]["r2sego_image"] == "captures/images/capture_0.png"  # on Windows too
    assert [camera.name for camera in cameras] == ["capture_0", "capture_1", "capture_2"]
    for camera, view in zip(cameras, bundle.captures(), strict=True):
        background = camera.data.background_images[0]
        assert bpy.path.abspath(background.image.filepath) == str(view.image_path)
        assert tuple(background.image.size) == (view.camera.width, view.camera.height)
    assert scene.camera == cameras[0]


def test_photographs_of_a_bundle_made_anew_in_its_place_are_its_own(scene, bundle_path, tmp_path):
    bundle = Bundle.open(shutil.copytree(bundle_path, tmp_path / "room.r2s"))
    file = bundle.captures()[0].image_path
    for level in (51, 204):
        height, width = load_image_uint8(file).shape[:2]
        save_image(file, np.full((height, width, 3), level, np.uint8))
        photograph = show_captures(scene, bundle)[0].data.background_images[0].image
        np.testing.assert_allclose(photograph.pixels[:3], level / 255.0, atol=1e-6)


def test_sparse_points_keep_their_places_and_colours(scene, bundle):
    show_captures(scene, bundle)
    mesh = bpy.data.objects["Sparse points"].data
    points, colours = bundle.sparse_points()
    found = np.empty(3 * len(points), np.float32)
    mesh.vertices.foreach_get("co", found)
    np.testing.assert_array_equal(found.reshape(-1, 3), points)
    shown = np.empty(4 * len(points), np.float32)
    mesh.color_attributes["colour"].data.foreach_get("color_srgb", shown)
    np.testing.assert_allclose(shown.reshape(-1, 4)[:, :3] * 255, colours, atol=0.51)


def test_points_become_point_geometry(scene, bundle):
    show_captures(scene, bundle, point_radius_m=0.02)
    bpy.context.view_layer.update()
    points = bpy.data.objects["Sparse points"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    geometry = points.evaluated_geometry() if hasattr(points, "evaluated_geometry") else None
    if geometry is None:
        pytest.skip("this Blender cannot show evaluated geometry to Python")
    assert len(geometry.pointcloud.points) == 50
    assert geometry.pointcloud.points[0].radius == pytest.approx(0.02)


def test_showing_twice_replaces(scene, bundle):
    for _ in range(2):
        show_captures(scene, bundle)
        show_proxy(scene, bundle, 0)
        show_candidates(scene, bundle, 0)
    assert len(find_collection(scene, bundle.path, "Captures").objects) == 4
    assert len(find_collection(scene, bundle.path, "Geometry proxy").objects) == 1
    assert len(find_collection(scene, bundle.path, "Target views").objects) == 2 * len(fake_bundle.TARGETS)
    assert len(bpy.data.cameras) == 3 + len(fake_bundle.TARGETS)
    assert len(bpy.data.meshes) == 1 + 1 + 1 + len(fake_bundle.TARGETS)


@pytest.mark.parametrize("round_index", [0, 1])
def test_the_shown_proxy_has_all_that_is_known_of_its_faces(scene, bundle, round_index):
    mesh = show_proxy(scene, bundle, round_index).data
    expected = fake_bundle.proxy(round_index)
    vertices, faces = arrays_from_mesh(mesh)
    np.testing.assert_array_equal(vertices, expected.vertices)
    np.testing.assert_array_equal(faces, expected.faces)
    for name in ("provenance", "support", "confidence", "instance"):
        np.testing.assert_array_equal(read_attribute(mesh, name), getattr(expected, name))
    assert tuple(json.loads(mesh["instance_names"])) == expected.instance_names


def test_the_proxy_is_coloured_by_provenance(scene, bundle):
    mesh = show_proxy(scene, bundle, 0).data
    slots = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", slots)
    np.testing.assert_array_equal(slots, fake_bundle.proxy().provenance)
    assert [m.name for m in mesh.materials] == [
        "R2S-EGO observed",
        "R2S-EGO prior",
        "R2S-EGO completed",
        "R2S-EGO measured",
        "R2S-EGO estimated",
    ]
    assert len({tuple(m.diffuse_color) for m in mesh.materials}) == len(Provenance)
    assert not mesh.validate()


def test_candidates_carry_their_scores(scene, bundle):
    views = bundle.candidates(0)
    swarm, targets = show_candidates(scene, bundle, 0)
    scores = views.selection.score
    assert len(swarm.data.polygons) == 4 * len(scores)
    np.testing.assert_allclose(read_attribute(swarm.data, "s")[::4], scores, rtol=1e-6)
    np.testing.assert_array_equal(read_attribute(swarm.data, "candidate")[::4], np.arange(len(scores)))
    assert [t["candidate"] for t in targets] == list(fake_bundle.TARGETS)
    bpy.context.view_layer.update()
    for target in targets:
        pose = views.poses[target["candidate"]]
        np.testing.assert_allclose(camera_of(target).world_from_camera, pose, atol=1e-6)


def test_a_frustum_ends_at_the_images_corners():
    camera = fake_bundle.cameras()[1]
    vertices, triangles = frustum_triangles(camera, camera.world_from_camera[None], 0.5)
    pixels, depth = camera.project(vertices[1:])
    np.testing.assert_allclose(pixels, [[0, 0], [80, 0], [80, 60], [0, 60]], atol=1e-4)
    np.testing.assert_allclose(depth, 0.5, atol=1e-6)
    assert triangles.shape == (4, 3)


@pytest.mark.parametrize(("pieces", "faces"), [(True, 6), (False, 13)])
def test_the_collision_surface_is_in_the_world_frame(scene, bundle, pieces, faces):
    shown = show_collision(scene, bundle, pieces=pieces)
    assert len(shown.data.polygons) == faces
    expected = fake_bundle.proxy().vertices[:4]
    found = np.array([vertex.co for vertex in shown.data.vertices])[: len(expected)]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_every_setting_has_its_property():
    from r2sego_blender.bridge.scene.settings_properties import settings_group

    names = set(settings_group().__annotations__)
    assert names == {property_name(entry.key) for entry in entries()}
    assert [key for keys in sections().values() for key in keys] == [entry.key for entry in entries()]


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("seed", "Seed"),
        ("training.steps_per_round", "Steps per Round"),
        ("training.sh_degree", "SH Degree"),
        ("proxy.min_component_m2", "Min Component (m²)"),
        ("rollouts.max_torque_nm", "Max Torque (N m)"),
        ("training.every_third_pixel_share", "Every Third Pixel Share"),
    ],
)
def test_a_setting_is_named_with_its_unit(key, name):
    assert label(key) == name


def test_the_name_of_a_setting_has_room_in_its_field():
    """Beside a number, in a side bar as wide as Blender makes it; the window tests look at it."""
    assert max(len(label(entry.key)) for entry in entries()) <= 25


def test_the_default_of_a_setting_can_be_read():
    """Rounded to the decimals that Blender shows, each number keeps two digits."""
    from r2sego_blender.bridge.scene.settings_properties import settings_group

    annotations = settings_group().__annotations__
    for entry in entries():
        if isinstance(entry.default, float):
            shown = round(entry.default, annotations[property_name(entry.key)].keywords["precision"])
            assert shown == pytest.approx(entry.default, rel=0.05), entry.key
