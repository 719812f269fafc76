"""The candidate stream as frusta coloured by a score, and as cameras the target views and the
photographs that a person had better take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bmesh
import bpy
import numpy as np

from ...core.cameras import Camera
from ...results.panels.bundle import Bundle, CandidateViews
from ...results.panels.frusta import FACES_PER_FRUSTUM, face_steps, frustum_triangles
from ...views.photographs import PhotographToTake
from ..shared.cameras import create_camera, object_pose, set_camera
from ..shared.materials import plain_material, ramp_materials
from ..shared.meshes import add_attribute, assign_materials, mesh_from_arrays, read_attribute
from ..shared.outliner import clear, find_collection, fresh_collection, link
from ..shared.simplified_viewport import draw_fewer_frusta, drawn_faces

_CANDIDATES, _TARGETS, _TO_TAKE = "Candidates", "Target views", "Photographs to take"
_ACTIVE, _VIEW = "Active candidate", "Candidate view"
_SCORE_STEPS = 8
_TARGET_COLOUR, _ACTIVE_COLOUR, _TO_TAKE_COLOUR = (0.90, 0.12, 0.35), (1.0, 0.45, 0.05), (0.10, 0.62, 0.30)
_TARGET_ENLARGEMENT, _ACTIVE_ENLARGEMENT = 2.5, 1.5


def show_candidates(
    scene: bpy.types.Scene,
    bundle: Bundle,
    round_index: int,
    *,
    frustum_m: float = 0.08,
    shown: str = "all",
    colour_by: str = "s",
) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """The candidates of a round in one mesh, its targets and the photographs to take as cameras with frusta.

    Frusta run from dark blue (0) to yellow (the best there is) by ``colour_by``: the score ``s``,
    the asset's deficit ``u`` or the geometry's availability ``g``; their faces carry the attributes
    ``candidate``, ``u``, ``g``, ``s``. ``shown`` is ``all``, ``survivors`` or ``targets``. Targets
    are named by their place in the selection and enlarged. Returns the candidates' object and the
    targets' cameras in that order. Raises SceneError when the round has none.
    """
    views = bundle.candidates(round_index)
    selection = views.selection
    kept = {"all": np.ones_like(selection.chosen), "survivors": selection.survived, "targets": selection.chosen}
    collection = fresh_collection(scene, bundle.path, _CANDIDATES)  # first, so that names are free again
    swarm = _candidate_object(views, np.flatnonzero(kept[shown]), round_index, frustum_m)
    swarm["round"], swarm["shown"], swarm["frustum_m"] = round_index, shown, frustum_m
    _colour(swarm, colour_by)
    draw_fewer_frusta(swarm, drawn_faces())
    link(collection, swarm)
    targets = fresh_collection(scene, bundle.path, _TARGETS)
    cameras = []
    for place, index in enumerate(selection.targets):
        camera, frustum = _target_objects(views, index, place, frustum_m * _TARGET_ENLARGEMENT)
        link(targets, camera)
        link(targets, frustum)
        cameras.append(camera)
    _show_photographs(scene, bundle, selection.photographs, frustum_m * _TARGET_ENLARGEMENT)
    return swarm, cameras


def photograph_camera(scene: bpy.types.Scene, bundle_path: str | Path, number: int) -> bpy.types.Object | None:
    """The camera of photograph to take ``number``, from 0, that ``show_candidates`` made; None for none."""
    collection = find_collection(scene, bundle_path, _TO_TAKE)
    found = [] if collection is None else [o for o in collection.objects if o.get("photograph") == number]
    return found[0] if found else None


def shown_candidates(scene: bpy.types.Scene, bundle_path: str | Path) -> bpy.types.Object | None:
    """The mesh of frusta that ``show_candidates`` made, None when it is not there."""
    collection = find_collection(scene, bundle_path, _CANDIDATES)
    found = [] if collection is None else [o for o in collection.objects if o.type == "MESH" and "round" in o]
    return found[0] if found else None


def draw_fewer_candidates(most: int) -> None:
    """Have the views draw fewer frusta of all that ``show_candidates`` made, with 0 all of them."""
    for one in bpy.data.objects:
        if one.type == "MESH" and "round" in one and "shown" in one:
            draw_fewer_frusta(one, most)


def recolour_candidates(swarm: bpy.types.Object, colour_by: str) -> None:
    """Colour the frusta by another of ``s``, ``u`` and ``g``."""
    if swarm["colour_by"] != colour_by:
        _colour(swarm, colour_by)


def candidate_of_face(frusta: bpy.types.Mesh, face: int) -> int:
    """The candidate that a face of the frusta belongs to."""
    return int(frusta.attributes["candidate"].data[face].value)


def candidate_on_ray(swarm: bpy.types.Object, origin, direction) -> int:
    """The candidate whose frustum a ray of the world meets first, -1 when it meets none that is drawn.

    What else stands in the way is passed through: frusta behind a wall can be had.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    inverse = swarm.matrix_world.inverted_safe()
    hit, _, _, face = swarm.ray_cast(inverse @ origin, inverse.to_3x3() @ direction, depsgraph=depsgraph)
    return candidate_of_face(swarm.evaluated_get(depsgraph).data, face) if hit else -1


def candidate_of_selection(swarm: bpy.types.Object) -> int:
    """The candidate of the face chosen in Edit Mode, -1 when none is."""
    if swarm.mode != "EDIT":
        return -1
    faces = bmesh.from_edit_mesh(swarm.data).faces
    chosen = faces.active if faces.active is not None and faces.active.select else None
    chosen = chosen or next((face for face in faces if face.select), None)
    return -1 if chosen is None else int(chosen[faces.layers.int["candidate"]])


def mark_candidate(
    scene: bpy.types.Scene, bundle_path: str | Path, views: CandidateViews, index: int, frustum_m: float
) -> bpy.types.Object | None:
    """A larger frustum in another colour at candidate ``index``; -1 takes it away."""
    collection = find_collection(scene, bundle_path, _ACTIVE)
    if index < 0:
        if collection is not None:
            clear(collection)
        return None
    marker = next((o for o in collection.objects if "frustum_m" in o), None) if collection else None
    size_m = frustum_m * _ACTIVE_ENLARGEMENT
    if marker is None or marker["frustum_m"] != size_m:
        marker = _frustum_object(_ACTIVE, views.camera, size_m, "R2S-EGO active", _ACTIVE_COLOUR)
        marker["frustum_m"] = size_m
        marker.show_in_front = True
        link(fresh_collection(scene, bundle_path, _ACTIVE), marker)
    marker["candidate"] = int(index)
    marker.matrix_world = object_pose(views.poses[index]).T.tolist()
    return marker


def candidate_camera(
    scene: bpy.types.Scene, bundle_path: str | Path, views: CandidateViews, index: int
) -> bpy.types.Object:
    """One camera with the exact lens, moved to candidate ``index``."""
    camera = views.camera.at(views.poses[index])
    collection = find_collection(scene, bundle_path, _VIEW)
    created = next((o for o in collection.objects if "candidate" in o), None) if collection else None
    if created is None:
        created = create_camera(_VIEW, camera)
        link(fresh_collection(scene, bundle_path, _VIEW), created)
    set_camera(created, camera)
    created["candidate"] = int(index)
    return created


def _candidate_object(views: CandidateViews, shown: np.ndarray, round_index: int, frustum_m: float) -> bpy.types.Object:
    vertices, triangles = frustum_triangles(views.camera, views.poses[shown], frustum_m)
    mesh = mesh_from_arrays(f"Candidates, round {round_index}", vertices, triangles)
    scores = _scores(views)
    for name, values in {"candidate": shown, **{key: one[shown] for key, one in scores.items()}}.items():
        add_attribute(mesh, name, np.repeat(values, FACES_PER_FRUSTUM))
    for material in ramp_materials("R2S-EGO score", _SCORE_STEPS):
        mesh.materials.append(material)
    created = bpy.data.objects.new(mesh.name, mesh)
    # The best of the whole round, so that colours mean the same whatever is shown.
    for name, values in scores.items():
        created[f"best_{name}"] = float(values.max(initial=0.0)) or 1.0
    return created


def _scores(views: CandidateViews) -> dict[str, np.ndarray]:
    """(M,) each: what the frusta can be coloured by."""
    told = views.selection
    return {"u": told.deficit, "g": told.availability, "s": told.score}


def _colour(swarm: bpy.types.Object, colour_by: str) -> None:
    mesh = swarm.data
    steps = face_steps(read_attribute(mesh, colour_by), swarm[f"best_{colour_by}"], _SCORE_STEPS)
    mesh.polygons.foreach_set("material_index", steps)
    mesh.update()
    swarm["colour_by"] = colour_by


def _target_objects(
    views: CandidateViews, index: int, place: int, frustum_m: float
) -> tuple[bpy.types.Object, bpy.types.Object]:
    name = f"Target {place:02d}"
    camera = create_camera(name, views.camera.at(views.poses[index]))
    camera.data.display_size = frustum_m
    camera["candidate"] = int(index)
    for key, values in _scores(views).items():
        camera[key] = float(values[index])
    frustum = _frustum_object(f"{name} frustum", views.camera, frustum_m, "R2S-EGO target", _TARGET_COLOUR)
    frustum.parent = camera  # moves with its camera
    return camera, frustum


def _show_photographs(
    scene: bpy.types.Scene, bundle: Bundle, photographs: Sequence[PhotographToTake], frustum_m: float
) -> None:
    """Cameras with frusta at the photographs to take; those of another selection go."""
    if not photographs and find_collection(scene, bundle.path, _TO_TAKE) is None:
        return
    collection = fresh_collection(scene, bundle.path, _TO_TAKE)
    for number, photograph in enumerate(photographs):
        name = f"Photograph to take {number + 1}"
        camera = create_camera(name, photograph.camera)
        camera.data.display_size = frustum_m
        camera["photograph"], camera["share"] = number, photograph.share
        frustum = _frustum_object(
            f"{name} frustum", photograph.camera, frustum_m, "R2S-EGO photograph to take", _TO_TAKE_COLOUR
        )
        frustum.parent = camera
        link(collection, camera)
        link(collection, frustum)


def _frustum_object(
    name: str, lens: Camera, frustum_m: float, material: str, colour: tuple[float, float, float]
) -> bpy.types.Object:
    """One frustum in Blender's camera axes, that cannot be selected."""
    vertices, triangles = frustum_triangles(lens, np.eye(4)[None], frustum_m)
    mesh = mesh_from_arrays(name, vertices * (1.0, -1.0, -1.0), triangles)
    assign_materials(mesh, [plain_material(material, colour)], np.zeros(FACES_PER_FRUSTUM, np.int32))
    created = bpy.data.objects.new(mesh.name, mesh)
    created.hide_select = True
    return created
