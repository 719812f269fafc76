"""Shape priors as Blender objects that can be moved, and how they fit where they stand now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...captures.registered_views import RegisteredView
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.json_files import write_json
from ...geometry.objects.masked_points import points_on_object
from ...geometry.room.completed_depth import COMPLETED, CompletedDepth
from ...geometry.stereo.observed_geometry import OBSERVED
from ...results.panels.bundle import Bundle
from ...results.panels.placement import Fit, MaskWindow, fit_of, mask_window, surface_samples
from ...results.panels.proxy_objects import prior_file, prior_mesh, read_objects
from ..shared.materials import plain_material
from ..shared.meshes import arrays_from_mesh, mesh_from_arrays
from ..shared.outliner import find_collection, fresh_collection, link
from .object_masks import known_masks
from .proxy_edits import world_triangles

_PART = "Shape priors"
_KEY = "r2sego_prior"
_COLOURS = {True: (0.82, 0.30, 0.25), False: (0.13, 0.62, 0.59)}  # refused, and prior teal
_POINTS = 300


@dataclass(frozen=True)
class Placement:
    """What is needed to rate a prior: ``samples`` (N, 3) of its surface and ``tree`` of its faces, both
    in its own frame, its object's ``windows`` and observed ``points`` (P, 3) in the world, and the
    ``cameras`` of all captures by name."""

    samples: np.ndarray
    tree: BVHTree
    windows: tuple[MaskWindow, ...]
    points: np.ndarray
    cameras: Mapping[str, Camera]

    def rated(self, world_from_own: np.ndarray) -> tuple[Fit, float]:
        """The fit and the median distance of the observed points, metres (nan: none), of a pose (4, 4)."""
        return fit_of(self.windows, self.placed(world_from_own)), self._residual_m(world_from_own)

    def placed(self, world_from_own: np.ndarray) -> np.ndarray:
        """(N, 3) float32: the samples in the world."""
        pose = np.asarray(world_from_own, np.float32)
        return self.samples @ pose[:3, :3].T + pose[:3, 3]

    def _residual_m(self, world_from_own: np.ndarray) -> float:
        if not len(self.points):
            return float("nan")
        linear = world_from_own[:3, :3]
        if not np.linalg.det(linear):  # scaled to nothing, as while a person types "0.9"
            return float("nan")
        local = (self.points - world_from_own[:3, 3]) @ np.linalg.inv(linear).T
        near = [self.tree.find_nearest(Vector(point))[3] for point in local]
        return float(np.median([far for far in near if far is not None]) * np.cbrt(abs(np.linalg.det(linear))))


def show_priors(scene: bpy.types.Scene, bundle: Bundle) -> list[bpy.types.Object]:
    """An object for each prior of the last run, teal, or red where it was refused.

    Their meshes stand in their own frame, so ``matrix_world`` is ``world_from_own``.
    """
    collection = fresh_collection(scene, bundle.path, _PART)
    shown = []
    for known in read_objects(bundle):
        if prior_file(bundle, known.name) is None:
            continue
        vertices, faces = prior_mesh(bundle, known.name)
        pose = np.eye(4) if known.world_from_own is None else known.world_from_own
        own = (vertices - pose[:3, 3]) @ np.linalg.inv(pose[:3, :3]).T
        mesh = mesh_from_arrays(f"Prior {known.name}", own, faces)
        refused = known.state in ("refused", "rejected")
        mesh.materials.append(
            plain_material("R2S-EGO refused prior" if refused else "R2S-EGO shape prior", _COLOURS[refused])
        )
        created = bpy.data.objects.new(mesh.name, mesh)
        created.matrix_world = pose.T.tolist()
        created[_KEY] = known.name
        if known.world_from_own is None:  # made by symmetry: nothing to place
            created.lock_location = created.lock_rotation = created.lock_scale = (True, True, True)
        link(collection, created)
        shown.append(created)
    return shown


def prior_object(scene: bpy.types.Scene, bundle_path: str | Path, name: str) -> bpy.types.Object | None:
    """The shown prior of an object."""
    collection = find_collection(scene, bundle_path, _PART)
    objects = collection.objects if collection is not None else ()
    return next((one for one in objects if one.get(_KEY) == name), None)


def prior_name(shown: bpy.types.Object | None) -> str:
    """The object whose prior this is; '' for anything else."""
    return str(shown.get(_KEY, "")) if shown is not None else ""


def pose_of(shown: bpy.types.Object) -> np.ndarray:
    """(4, 4) ``world_from_own`` where a prior stands now. Raises GeometryError when it is stretched."""
    pose = np.array(shown.matrix_world, np.float64)
    linear = pose[:3, :3]
    determinant = np.linalg.det(linear)
    scale = np.cbrt(determinant)
    if not determinant > 0.0 or np.abs(linear @ linear.T - scale**2 * np.eye(3)).max() > 1e-3 * scale**2:
        raise GeometryError(
            "a prior may be moved, turned and scaled evenly, but not stretched or mirrored",
            where=shown.name,
            cure="Clear the scale, then scale along all axes together.",
        )
    return pose


def write_placement(file: Path, shown: bpy.types.Object, *, locked: bool) -> None:
    """Write where a prior stands as ``r2sego objects --place`` reads it."""
    write_json(file, {"world_from_own": pose_of(shown).tolist(), "locked": locked})


def write_mesh(file: Path, one: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
    """Write a mesh object in the world as an OBJ of triangles. Raises GeometryError when it is empty."""
    vertices, triangles = world_triangles(one, depsgraph)
    if not len(triangles):
        raise GeometryError("the mesh has no faces", where=one.name, cure="Choose a mesh with faces.")
    with file.open("wb") as stream:
        np.savetxt(stream, vertices, fmt="v %.7g %.7g %.7g")
        np.savetxt(stream, triangles + 1, fmt="f %d %d %d")


def placement_of(bundle: Bundle, shown: bpy.types.Object) -> Placement:
    """Gather what rates a shown prior; the bundle's masks join those that Blender holds.

    Raises GeometryError for damaged files.
    """
    name = prior_name(shown)
    masks = known_masks(bundle, name)
    views = bundle.captures()
    chosen = [k for k, view in enumerate(views) if view.name in masks and masks[view.name].any()]
    windows, completed = [], bundle.read(COMPLETED)
    for k in chosen:
        view = views[k]
        depth = _known_depth(completed.found(views, k), view.camera)
        windows.append(mask_window(view.name, view.camera, masks[view.name], depth))
    vertices, faces = arrays_from_mesh(shown.data)
    return Placement(
        surface_samples(vertices, faces),
        BVHTree.FromPolygons(vertices.tolist(), faces.tolist()),
        tuple(window for window in windows if window is not None),
        _observed_on(bundle, views, masks, chosen),
        {view.name: view.camera for view in views},
    )


def _known_depth(completed: CompletedDepth | None, camera: Camera) -> np.ndarray | None:
    """(H, W) a capture's completed depth at its camera's size, if there is one."""
    if completed is None:
        return None
    depth = completed.depth
    rows = ((np.arange(camera.height) + 0.5) * depth.shape[0] / camera.height).astype(int)
    columns = ((np.arange(camera.width) + 0.5) * depth.shape[1] / camera.width).astype(int)
    return depth[np.ix_(rows, columns)]


def _observed_on(bundle: Bundle, views: Sequence[RegisteredView], masks, indices: list[int]) -> np.ndarray:
    """(P, 3) some of the points observed on the object, metres."""
    if not (bundle.path / OBSERVED.name).is_file() or not indices:
        return np.zeros((0, 3))
    observed = bundle.read(OBSERVED)
    points, visibility = observed.points, observed.visibility
    cameras = [views[k].camera for k in indices]
    shown = [masks[views[k].name] for k in indices]
    found = points[points_on_object(points, visibility, cameras, shown, indices)].astype(np.float64)
    return found[:: 1 + len(found) // _POINTS]
