"""The collision surface as USD with physics, for Isaac Sim and others that read UsdPhysics."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from .collision import CollisionSurface

if TYPE_CHECKING:
    from .collision_files import FloorBox

_GRAVITY_M_S2 = 9.81


def write_usd(path: Path, surface: CollisionSurface, names: list[str], floor: FloorBox | None) -> None:
    """Write ``path``, a binary USD file: Z up, metres and kilograms.

    ``/room``, the default prim, holds ``visual``, the simplified mesh, which collides with
    nothing, and ``collision``: the floor's box as a cube and each piece as a mesh with
    CollisionAPI and MeshCollisionAPI, approximation convexHull, all of purpose "guide", which
    viewers hide. No prim is a rigid body, so all of it is static. ``/physics`` is the
    PhysicsScene, outside the default prim: who refers to ``/room`` keeps their own.
    """
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    define_physics(stage)
    room = UsdGeom.Xform.Define(stage, "/room")
    stage.SetDefaultPrim(room.GetPrim())
    Usd.ModelAPI(room).SetKind(Kind.Tokens.component)
    _mesh(stage, "/room/visual", surface.vertices, surface.faces)
    colliders = UsdGeom.Scope.Define(stage, "/room/collision")
    colliders.CreatePurposeAttr(UsdGeom.Tokens.guide)
    if floor is not None:
        _cube(stage, "/room/collision/floor", floor)
    for name, (vertices, faces) in zip(names, surface.pieces, strict=True):
        mesh = _mesh(stage, f"/room/collision/{name}", vertices, faces)
        UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
        UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(
            UsdPhysics.Tokens.convexHull
        )
    layer.Export(str(path))


def define_physics(stage: Usd.Stage) -> None:
    """Make a stage's units metres and kilograms and its up axis Z; add ``/physics``, the PhysicsScene."""
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    scene = UsdPhysics.Scene.Define(stage, "/physics")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0.0, 0.0, -1.0))
    scene.CreateGravityMagnitudeAttr(_GRAVITY_M_S2)


def _mesh(stage: Usd.Stage, path: str, vertices: np.ndarray, faces: np.ndarray) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = np.ascontiguousarray(vertices, np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(faces, np.int32).ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
    return mesh


def _cube(stage: Usd.Stage, path: str, box: FloorBox) -> None:
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(2.0)
    cube.CreateExtentAttr([(-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)])
    cube.AddTranslateOp().Set(Gf.Vec3d(*box.centre.tolist()))
    cube.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble).Set(float(np.degrees(box.yaw_rad)))
    cube.AddScaleOp().Set(Gf.Vec3f(*box.half.tolist()))
    UsdPhysics.CollisionAPI.Apply(cube.GetPrim())
