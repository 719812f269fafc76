"""The candidate stream as frusta coloured by score, and the target views as cameras."""

from __future__ import annotations

import bpy
import numpy as np

from .bundle import Bundle, CandidateViews
from .cameras import create_camera
from .frusta import FACES_PER_FRUSTUM, frustum_triangles
from .materials import plain_material, ramp_materials
from .meshes import add_attribute, assign_materials, mesh_from_arrays
from .outliner import fresh_collection

_CANDIDATES, _TARGETS = "Candidates", "Target views"
_SCORE_STEPS = 8
_TARGET_COLOUR = (0.90, 0.12, 0.35)
_TARGET_ENLARGEMENT = 2.5


def show_candidates(
    scene: bpy.types.Scene, bundle: Bundle, round_index: int, *,
    frustum_m: float = 0.08, survivors_only: bool = False,
) -> tuple[bpy.types.Object, list[bpy.types.Object]]:  # fmt: skip
    """The candidates of a round in one mesh and its targets as cameras with frusta.

    Frusta run from dark blue (score 0) to yellow (the best score); their faces carry the
    attributes ``candidate``, ``u``, ``g``, ``s``. Targets are named by their place in the
    selection and enlarged. Returns the candidates' object and the targets' cameras in
    that order. Raises SceneError when the round has none.
    """
    views = bundle.candidates(round_index)
    shown = np.flatnonzero(views.survived if survivors_only else np.ones(len(views.score), bool))
    swarm = _candidate_object(views, shown, round_index, frustum_m)
    fresh_collection(scene, bundle.name, _CANDIDATES).objects.link(swarm)
    targets = fresh_collection(scene, bundle.name, _TARGETS)
    cameras = []
    for place, index in enumerate(views.targets()):
        camera, frustum = _target_objects(views, index, place, frustum_m * _TARGET_ENLARGEMENT)
        targets.objects.link(camera)
        targets.objects.link(frustum)
        cameras.append(camera)
    return swarm, cameras


def _candidate_object(
    views: CandidateViews, shown: np.ndarray, round_index: int, frustum_m: float
) -> bpy.types.Object:
    vertices, triangles = frustum_triangles(views.camera, views.poses[shown], frustum_m)
    mesh = mesh_from_arrays(f"Candidates, round {round_index}", vertices, triangles)
    score = views.score[shown]
    for name, values in (
        ("candidate", shown), ("u", views.deficit[shown]), ("g", views.availability[shown]), ("s", score),
    ):  # fmt: skip
        add_attribute(mesh, name, np.repeat(values, FACES_PER_FRUSTUM))
    best = float(score.max(initial=0.0)) or 1.0
    step = np.clip(score / best * _SCORE_STEPS, 0, _SCORE_STEPS - 1).astype(np.int32)
    materials = ramp_materials("R2S-EGO score", _SCORE_STEPS)
    assign_materials(mesh, materials, np.repeat(step, FACES_PER_FRUSTUM))
    return bpy.data.objects.new(mesh.name, mesh)


def _target_objects(
    views: CandidateViews, index: int, place: int, frustum_m: float
) -> tuple[bpy.types.Object, bpy.types.Object]:
    name = f"Target {place:02d}"
    camera = create_camera(name, views.camera.at(views.poses[index]))
    camera.data.display_size = frustum_m
    camera.show_name = True
    camera["candidate"] = int(index)
    camera["u"], camera["g"] = float(views.deficit[index]), float(views.availability[index])
    camera["s"] = float(views.score[index])
    vertices, triangles = frustum_triangles(views.camera, np.eye(4)[None], frustum_m)
    mesh = mesh_from_arrays(f"{name} frustum", vertices * (1.0, -1.0, -1.0), triangles)
    material = plain_material("R2S-EGO target", _TARGET_COLOUR)
    assign_materials(mesh, [material], np.zeros(FACES_PER_FRUSTUM, np.int32))
    frustum = bpy.data.objects.new(mesh.name, mesh)
    frustum.parent = camera  # moves with its camera
    frustum.hide_select = True
    return camera, frustum
