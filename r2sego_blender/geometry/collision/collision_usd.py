"""The collision surface as USD with physics, for Isaac Sim and others that read UsdPhysics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics

from ..mesh.usd_prims import define_mesh, define_physics, set_world
from .collision import CollisionSurface
from .floor_box import FloorBox


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
    set_world(stage)
    define_physics(stage)
    room = UsdGeom.Xform.Define(stage, "/room")
    stage.SetDefaultPrim(room.GetPrim())
    Usd.ModelAPI(room).SetKind(Kind.Tokens.component)
    define_mesh(stage, "/room/visual", surface.vertices, surface.faces)
    colliders = UsdGeom.Scope.Define(stage, "/room/collision")
    colliders.CreatePurposeAttr(UsdGeom.Tokens.guide)
    if floor is not None:
        _cube(stage, "/room/collision/floor", floor)
    for name, (vertices, faces) in zip(names, surface.pieces, strict=True):
        mesh = define_mesh(stage, f"/room/collision/{name}", vertices, faces)
        UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
        UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    layer.Export(str(path))


def _cube(stage: Usd.Stage, path: str, box: FloorBox) -> None:
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(2.0)
    cube.CreateExtentAttr([(-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)])
    cube.AddTranslateOp().Set(Gf.Vec3d(*box.centre.tolist()))
    cube.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble).Set(float(np.degrees(box.yaw_rad)))
    cube.AddScaleOp().Set(Gf.Vec3f(*box.half.tolist()))
    UsdPhysics.CollisionAPI.Apply(cube.GetPrim())
