"""Captures as Blender cameras that carry their photographs, and the sparse points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ...bundle.containment import inside
from ...core.errors import CaptureError
from ...core.image_sizes import require_sensible_png
from ...results.panels.bundle import Bundle
from ..asset.asset_pictures import photographs_behind
from ..shared.cameras import create_camera, use_frame_of
from ..shared.materials import attribute_material
from ..shared.meshes import add_attribute, add_colours, mesh_from_arrays
from ..shared.moved_bundle import BUNDLE_MARK
from ..shared.outliner import find_collection, fresh_collection, link
from ..shared.preview_range import give_back
from .registration_marks import note_registration, was_corrected_since

CAPTURES_PART = "Captures"
"""The part of the bundle's collection that holds the captures."""

_NAME, _IMAGE, _IS_CLOUD = "r2sego_capture", "r2sego_image", "r2sego_sparse_points"
_COLOUR = "colour"
_POINTS = "R2S-EGO sparse points"
_RADIUS = "radius_m"


def show_captures(
    scene: bpy.types.Scene,
    bundle: Bundle,
    *,
    photographs: bool = True,
    points: bool = True,
    point_radius_m: float = 0.006,
    photograph_alpha: float = 0.6,
    display_size_m: float = 0.25,
) -> list[bpy.types.Object]:
    """One camera a capture, in place of those shown before.

    The scene's becomes that of the capture it had before, else the first.
    Returns the camera objects. Raises SceneError when the bundle's cameras are damaged.
    """
    views = bundle.captures()
    cloud = bundle.sparse_points() if points and bundle.sparse_file.is_file() else None
    before = capture_name(scene.camera)
    collection = fresh_collection(scene, bundle.path, CAPTURES_PART)
    cameras = []
    for view in views:
        created = create_camera(view.name, view.camera)
        created.data.display_size = display_size_m
        created[_NAME] = view.name
        note_registration(created, bundle)
        # The bundle may be moved, and the .blend opened on another system.
        created[_IMAGE] = view.image_path.relative_to(bundle.path).as_posix()
        if photographs:
            _add_photograph(created.data, view.image_path, photograph_alpha)
        link(collection, created)
        cameras.append(created)
    if cloud is not None:
        points_object = _point_object("Sparse points", *cloud, point_radius_m)
        points_object[_IS_CLOUD] = True
        link(collection, points_object)
    if cameras:
        give_back(scene)
        use_frame_of(next((one for one in cameras if one[_NAME] == before), cameras[0]), scene)
    return cameras


def capture_name(camera: bpy.types.Object | None) -> str:
    """The capture whose camera this is, '' for any other object."""
    return str(camera.get(_NAME, "")) if camera is not None else ""


def looked_through(scene: bpy.types.Scene, bundle_path: str | Path) -> str:
    """The capture of the bundle at ``bundle_path`` whose camera is the scene's, '' where it is another."""
    camera = scene.camera
    return capture_name(camera) if camera is not None and camera.get(BUNDLE_MARK) == str(bundle_path) else ""


def capture_camera(scene: bpy.types.Scene, bundle_path: str, name: str) -> bpy.types.Object | None:
    """The camera of a capture of the bundle at ``bundle_path``, None when it is not shown."""
    return next((one for one in capture_cameras(scene, bundle_path) if capture_name(one) == name), None)


def shows_older_captures(scene: bpy.types.Scene, bundle_path: str, registration: Sequence[float]) -> bool:
    """Whether captures are shown where they stood in another registration of the world."""
    shown = capture_cameras(scene, bundle_path)[:1]  # all were placed at once
    return any(was_corrected_since(one, registration) for one in shown)


def show_photographs(scene: bpy.types.Scene, bundle_path: str, shown: bool, alpha: float) -> None:
    """Show or hide the photographs behind all captures' cameras, and set their opacity; renderings of
    the asset stay as they are."""
    for camera in capture_cameras(scene, bundle_path):
        data = camera.data
        if shown and not photographs_behind(data):
            _add_photograph(data, inside(Path(bundle_path), str(camera[_IMAGE])), alpha)
        for background in photographs_behind(data):
            background.show_background_image = shown
            background.alpha = alpha
        data.show_background_images = any(one.show_background_image for one in data.background_images)


def shows_points(scene: bpy.types.Scene, bundle_path: str | Path) -> bool:
    """Whether the sparse points stand beside the captures as an object."""
    collection = find_collection(scene, bundle_path, CAPTURES_PART)
    return collection is not None and any(one.get(_IS_CLOUD) for one in collection.objects)


def capture_cameras(scene: bpy.types.Scene, bundle_path: str) -> list[bpy.types.Object]:
    """The cameras of those captures of the bundle at ``bundle_path`` that are shown."""
    collection = find_collection(scene, bundle_path, CAPTURES_PART)
    return [one for one in collection.objects if capture_name(one)] if collection is not None else []


def _add_photograph(data: bpy.types.Camera, path: Path, alpha: float) -> None:
    if not path.is_file():
        return
    require_sensible_png(path, CaptureError)
    background = data.background_images.new()
    background.image = bpy.data.images.load(str(path), check_existing=True)
    if not background.image.is_dirty:
        background.image.reload()  # a bundle made anew in the place of another has other photographs
    background.alpha = alpha
    # The photograph and the frame have the same pixels: no letterbox, no crop.
    background.frame_method = "STRETCH"
    background.display_depth = "BACK"
    data.show_background_images = True


def _point_object(name: str, points: np.ndarray, colours: np.ndarray, radius_m: float) -> bpy.types.Object:
    mesh = mesh_from_arrays(name, points, np.empty((0, 3), np.int32))
    add_colours(mesh, _COLOUR, colours)
    # An attribute and no input of the modifier: those are set in another way from 5.2 on.
    add_attribute(mesh, _RADIUS, np.full(len(points), radius_m, np.float32), "POINT")
    created = bpy.data.objects.new(name, mesh)
    created.modifiers.new("Points", "NODES").node_group = _points_group()
    return created


def _points_group() -> bpy.types.NodeTree:
    """Vertices to coloured points, in every Blender from 4.3 on; no native point cloud data needed."""
    group = bpy.data.node_groups.get(_POINTS)
    if group is not None:
        return group
    group = bpy.data.node_groups.new(_POINTS, "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, link = group.nodes, group.links.new
    first, last = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    to_points, paint = nodes.new("GeometryNodeMeshToPoints"), nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = attribute_material(_POINTS, _COLOUR)
    link(first.outputs["Geometry"], to_points.inputs["Mesh"])
    radius = nodes.new("GeometryNodeInputNamedAttribute")
    radius.data_type = "FLOAT"
    radius.inputs["Name"].default_value = _RADIUS
    link(radius.outputs["Attribute"], to_points.inputs["Radius"])
    link(to_points.outputs[0], paint.inputs["Geometry"])
    link(paint.outputs[0], last.inputs[0])
    for place, node in enumerate((first, to_points, paint, last)):
        node.location.x = 200.0 * place
    return group
