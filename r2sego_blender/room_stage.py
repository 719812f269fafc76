"""An exported room as one USD stage: what bodies touch and what cameras see, together."""

from __future__ import annotations

from pathlib import Path

from pxr import Kind, Usd, UsdGeom

from .geometry.collision_usd import define_physics

ROOM_USDA = "room.usda"


def write_room_stage(folder: Path, collision: str, splats: str) -> None:
    """Write ``room.usda`` into an exported folder that holds the stages ``collision`` and ``splats``.

    Both are referred to by paths relative to it, below the default prim ``/room``: as ``/room/surface``
    and ``/room/splats``. The surface's ``visual`` is hidden, since the splats show what it shows;
    ``/physics`` is the PhysicsScene. Z up, in metres and kilograms.
    """
    stage = Usd.Stage.CreateNew(str(folder / ROOM_USDA))
    define_physics(stage)
    room = UsdGeom.Xform.Define(stage, "/room")
    stage.SetDefaultPrim(room.GetPrim())
    Usd.ModelAPI(room).SetKind(Kind.Tokens.assembly)
    for name, file in (("surface", collision), ("splats", splats)):
        stage.DefinePrim(f"/room/{name}").GetReferences().AddReference(f"./{file}")
    UsdGeom.Imageable(stage.OverridePrim("/room/surface/visual")).CreateVisibilityAttr(
        UsdGeom.Tokens.invisible
    )
    stage.GetRootLayer().Save()
