"""A textured mesh as USD: its points and places are ours, its material shines, its checks pass."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade, UsdValidation

from r2sego_blender.geometry.texture.textured_mesh import TexturedMesh
from r2sego_blender.geometry.texture.textured_usd import write_textured_usd

CORNERS = np.float32([(0, 2, 0), (1, 2, 0), (1, 2, 1), (0, 2, 1)])
PLACES = np.float32([(0, 1), (1, 1), (1, 0.25), (0, 0.25)])  # v downwards


@pytest.fixture
def stage(tmp_path) -> Usd.Stage:
    texture = np.random.default_rng(0).integers(0, 255, (8, 8, 3), dtype=np.uint8)
    mesh = TexturedMesh(CORNERS, np.int32([(0, 1, 2), (0, 2, 3)]), PLACES, texture, "by hand", 1.0)
    (tmp_path / "room.png").write_bytes(mesh.png())
    write_textured_usd(tmp_path / "room.usdc", mesh, "room.png")
    return Usd.Stage.Open(str(tmp_path / "room.usdc"))


def test_the_points_are_ours_and_v_counts_upwards(stage):
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    np.testing.assert_array_equal(mesh.GetPointsAttr().Get(), CORNERS)
    np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), [0, 1, 2, 0, 2, 3])
    places = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert places.GetInterpolation() == UsdGeom.Tokens.vertex
    np.testing.assert_array_equal(places.Get(), PLACES * [1, -1] + [0, 1])


def test_its_material_emits_the_texture_and_reflects_nothing(stage, tmp_path):
    material, _ = UsdShade.MaterialBindingAPI(stage.GetDefaultPrim()).ComputeBoundMaterial()
    surface = material.ComputeSurfaceSource()[0]
    assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
    assert tuple(surface.GetInput("diffuseColor").Get()) == (0.0, 0.0, 0.0)
    source, output, _ = surface.GetInput("emissiveColor").GetConnectedSource()
    texture = UsdShade.Shader(source.GetPrim())
    assert output == "rgb" and texture.GetIdAttr().Get() == "UsdUVTexture"
    assert Path(texture.GetInput("file").Get().resolvedPath) == tmp_path / "room.png"
    reader = UsdShade.Shader(texture.GetInput("st").GetConnectedSource()[0].GetPrim())
    assert reader.GetInput("varname").Get() == "st"


def test_usds_own_validators_find_no_fault(stage):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert validators
    assert not [e.GetMessage() for e in UsdValidation.ValidationContext(validators).Validate(stage)]
