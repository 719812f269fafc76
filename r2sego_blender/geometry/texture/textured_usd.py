"""A textured mesh as USD: one mesh that shines with what was baked on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from ..mesh.usd_prims import define_mesh, set_world
from .textured_mesh import TexturedMesh

_COLOUR, _PLACE = "rgb", "st"


def write_textured_usd(path: Path, mesh: TexturedMesh, picture: str) -> None:
    """Write ``path``: Z up, metres, the default prim ``/textured`` a mesh that collides with nothing.

    Its material is a UsdPreviewSurface that emits the texture in the file ``picture`` beside it and
    reflects nothing, since the light is in the texture.
    """
    stage = Usd.Stage.CreateNew(str(path))
    set_world(stage)
    prim = define_mesh(stage, "/textured", mesh.vertices, mesh.faces)
    stage.SetDefaultPrim(prim.GetPrim())
    places = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(_PLACE, Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    upwards = mesh.uvs * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)  # USD counts v upwards
    places.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(upwards, np.float32)))
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(_glowing(stage, picture))
    stage.GetRootLayer().Save()


def _glowing(stage: Usd.Stage, picture: str) -> UsdShade.Material:
    material = UsdShade.Material.Define(stage, "/textured/baked")
    reader = UsdShade.Shader.Define(stage, "/textured/baked/place")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(_PLACE)
    texture = UsdShade.Shader.Define(stage, "/textured/baked/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{picture}")
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    texture.CreateInput(_PLACE, Sdf.ValueTypeNames.Float2).ConnectToSource(
        reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    )
    surface = UsdShade.Shader.Define(stage, "/textured/baked/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.0))
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    surface.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
        texture.CreateOutput(_COLOUR, Sdf.ValueTypeNames.Float3)
    )
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    return material
