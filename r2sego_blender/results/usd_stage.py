"""An exported room as one USD stage: what bodies touch and what cameras see, together."""

from __future__ import annotations

from pathlib import Path

from pxr import Kind, Usd, UsdGeom

from ..geometry.mesh.usd_prims import define_physics, set_world

ROOM_USDA = "room.usda"


def write_room_stage(folder: Path, collision: str, splats: str | None, textured: str | None) -> None:
    """Write ``room.usda`` into an exported folder that holds the stages named, of which two may be None.

    They are referred to by paths relative to it, below the default prim ``/room``: as
    ``/room/surface``, ``/room/splats`` and ``/room/textured``. Of what can be looked at the best is
    seen, splats before the textured mesh before the surface's ``visual``; the others are invisible.
    ``/physics`` is the PhysicsScene. Z up, in metres and kilograms.
    """
    stage = Usd.Stage.CreateNew(str(folder / ROOM_USDA))
    set_world(stage)
    define_physics(stage)
    room = UsdGeom.Xform.Define(stage, "/room")
    stage.SetDefaultPrim(room.GetPrim())
    Usd.ModelAPI(room).SetKind(Kind.Tokens.assembly)
    looks = []
    for prim, file, looked_at in (
        ("/room/splats", splats, "/room/splats"),
        ("/room/textured", textured, "/room/textured"),
        ("/room/surface", collision, "/room/surface/visual"),
    ):
        if file is not None:
            stage.DefinePrim(prim).GetReferences().AddReference(f"./{file}")
            looks.append(looked_at)
    for hidden in looks[1:]:
        UsdGeom.Imageable(stage.OverridePrim(hidden)).CreateVisibilityAttr(UsdGeom.Tokens.invisible)
    stage.GetRootLayer().Save()
