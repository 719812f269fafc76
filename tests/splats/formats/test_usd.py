from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdValidation, UsdVol, Vt

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.formats.registry import load_asset, save_asset

SH = "radiance:sphericalHarmonicsCoefficients"


@pytest.mark.parametrize("suffix", [".usd", ".usda", ".usdc"])
def test_the_stage_says_what_the_schema_says(asset, tmp_path, suffix):
    path = tmp_path / f"room{suffix}"
    save_asset(path, asset)
    assert path.read_bytes().startswith(b"#usda" if suffix == ".usda" else b"PXR-USDC")
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    prim = stage.GetDefaultPrim()
    assert prim.IsA(UsdVol.ParticleField3DGaussianSplat)
    np.testing.assert_array_equal(np.array(prim.GetAttribute("positions").Get()), asset.means)
    np.testing.assert_allclose(np.array(prim.GetAttribute("scales").Get()), np.exp(asset.log_scales), rtol=1e-6)
    np.testing.assert_array_equal(np.array(prim.GetAttribute("opacities").Get()), asset.opacities)
    first = prim.GetAttribute("orientations").Get()[0]
    unit = asset.quaternions[0] / np.linalg.norm(asset.quaternions[0])
    np.testing.assert_allclose([first.real, *first.imaginary], unit, atol=1e-6)
    assert prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get() == 3
    harmonics = prim.GetAttribute(SH)
    assert harmonics.GetMetadata("elementSize") == 16
    np.testing.assert_array_equal(np.array(harmonics.Get()).reshape(-1, 16, 3), asset.sh)


@pytest.mark.parametrize("suffix", [".usdc", ".usdz"])
def test_usd_finds_nothing_wrong(asset, tmp_path, suffix):
    save_asset(tmp_path / f"room{suffix}", asset)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    stage = Usd.Stage.Open(str(tmp_path / f"room{suffix}"))
    assert not UsdValidation.ValidationContext(validators).Validate(stage)


def test_the_extent_holds_three_sigmas(asset, tmp_path):
    one = asset.subset(np.arange(1))
    save_asset(tmp_path / "one.usda", one)
    stage = Usd.Stage.Open(str(tmp_path / "one.usda"))
    low, high = np.array(stage.GetDefaultPrim().GetAttribute("extent").Get())
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    w, x, y, z = one.quaternions[0].astype(np.float64)
    rotation = np.array(Gf.Matrix3d(Gf.Quatd(w, x, y, z).GetNormalized())).T  # Gf has row vectors
    sphere = directions / np.linalg.norm(directions, axis=1, keepdims=True) * 3.0
    surface = one.means + (sphere * np.exp(one.log_scales)) @ rotation.T
    np.testing.assert_allclose(low, surface.min(axis=0), atol=2e-3)
    np.testing.assert_allclose(high, surface.max(axis=0), atol=2e-3)


def test_the_file_reads_as_text_without_the_schema(asset, tmp_path):
    """An older OpenUSD sees the prim's type as a name, and its attributes by theirs."""
    save_asset(tmp_path / "room.usdc", asset)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "room.usdc"))
    spec = layer.GetPrimAtPath("/Splats")
    assert spec.typeName == "ParticleField3DGaussianSplat"
    types = {name: str(spec.attributes[name].typeName) for name in spec.attributes.keys()}  # noqa: SIM118
    assert types == {
        "positions": "point3f[]",
        "orientations": "quatf[]",
        "scales": "float3[]",
        "opacities": "float[]",
        "extent": "float3[]",
        SH: "float3[]",
        "radiance:sphericalHarmonicsDegree": "int",
    }


def stage_of(path, asset, up: str, metres: float, under: Gf.Matrix4d) -> Usd.Stage:
    """A stage that holds the asset's numbers as they are, under a transform."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.Xform.Define(stage, "/World").AddTransformOp().Set(under)
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/World/Splats")
    field.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(asset.means))
    unit = asset.quaternions / np.linalg.norm(asset.quaternions, axis=1, keepdims=True)
    field.CreateOrientationsAttr([Gf.Quatf(*map(float, q)) for q in unit])
    field.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.exp(asset.log_scales)))
    field.CreateOpacitiesAttr(Vt.FloatArray.FromNumpy(asset.opacities))
    field.CreateRadianceSphericalHarmonicsDegreeAttr(asset.degree)
    field.CreateRadianceSphericalHarmonicsCoefficientsAttr(Vt.Vec3fArray.FromNumpy(asset.sh.reshape(-1, 3)))
    stage.Save()
    return stage


def test_up_axis_unit_and_transforms_are_obeyed(asset, fidelity_db, tmp_path):
    path = tmp_path / "room.usda"
    hundredfold = np.diag([100.0, 100.0, 100.0, 1.0])
    y_up = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    shift = Gf.Matrix4d().SetTranslate(Gf.Vec3d(30.0, 0.0, 0.0))  # centimetres
    stage_of(path, asset.transformed(hundredfold @ y_up), "Y", 0.01, shift)
    wanted = np.eye(4)
    wanted[0, 3] = 0.3
    expected = asset.transformed(wanted)
    loaded = load_asset(path)
    np.testing.assert_allclose(loaded.means, expected.means, atol=1e-5)
    assert fidelity_db(loaded, expected) >= 50.0


def test_all_fields_are_joined_and_halves_read(asset, fidelity_db, tmp_path):
    path = tmp_path / "room.usda"
    half, rest = asset.subset(np.arange(200)), asset.subset(np.arange(200, 400))
    stage = stage_of(path, half, "Z", 1.0, Gf.Matrix4d(1.0))
    other = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/World/More")
    other.CreatePositionshAttr([Gf.Vec3h(*map(float, v)) for v in rest.means])
    unit = rest.quaternions / np.linalg.norm(rest.quaternions, axis=1, keepdims=True)
    other.CreateOrientationshAttr([Gf.Quath(*map(float, q)) for q in unit])
    other.CreateScaleshAttr([Gf.Vec3h(*map(float, s)) for s in np.exp(rest.log_scales)])
    other.CreateOpacitieshAttr(Vt.HalfArray.FromNumpy(rest.opacities.astype(np.float16)))
    other.CreateRadianceSphericalHarmonicsDegreeAttr(3)
    coefficients = [Gf.Vec3h(*map(float, c)) for c in rest.sh.reshape(-1, 3)]
    other.CreateRadianceSphericalHarmonicsCoefficientshAttr(coefficients)
    stage.Save()
    loaded = load_asset(path)
    assert len(loaded) == len(asset)
    assert fidelity_db(loaded, asset) >= 45.0


def test_what_a_field_lacks_has_the_default_of_the_schema(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "bare.usda"))
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/Bare")
    field.CreatePositionsAttr([Gf.Vec3f(1, 2, 3), Gf.Vec3f(4, 5, 6)])
    field.CreateScalesAttr([Gf.Vec3f(2, 2, 2)])  # too short: ignored
    field.CreateOpacitiesAttr([0.25, 0.5, 0.75])  # too long: cut
    stage.Save()
    asset = load_asset(tmp_path / "bare.usda")
    np.testing.assert_allclose(asset.means, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(asset.log_scales, 0.0, atol=1e-6)
    np.testing.assert_allclose(asset.quaternions, [[1, 0, 0, 0]] * 2, atol=1e-6)
    np.testing.assert_allclose(asset.opacities, [0.25, 0.5], atol=1e-6)
    np.testing.assert_allclose(asset.base_colours, 0.5)


def test_of_degree_4_the_first_three_are_kept(asset, tmp_path):
    few = asset.subset(np.arange(5))
    stage = stage_of(tmp_path / "a.usda", few, "Z", 1.0, Gf.Matrix4d(1.0))
    prim = stage.GetPrimAtPath("/World/Splats")
    wide = np.concatenate([few.sh, np.ones((5, 9, 3), np.float32)], axis=1)
    prim.GetAttribute(SH).Set(Vt.Vec3fArray.FromNumpy(wide.reshape(-1, 3)))
    for degree, readable in ((4, True), (-1, False), (2**30, False)):
        prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(degree)
        stage.Save()
        if readable:
            np.testing.assert_allclose(load_asset(tmp_path / "a.usda").sh, few.sh, atol=1e-6)
        else:
            with pytest.raises(AssetError, match="not a readable USD"):
                load_asset(tmp_path / "a.usda")


def test_a_stage_without_splats_is_refused(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "mesh.usda"))
    UsdGeom.Sphere.Define(stage, "/Ball")
    stage.Save()
    with pytest.raises(AssetError, match=r"mesh\.usda: there is no ParticleField3DGaussianSplat"):
        load_asset(tmp_path / "mesh.usda")


def test_an_impossible_unit_is_refused(asset, tmp_path):
    stage_of(tmp_path / "a.usda", asset.subset(np.arange(3)), "Z", 0.0, Gf.Matrix4d(1.0))
    with pytest.raises(AssetError, match=r"a\.usda: the splats stand under a transform"):
        load_asset(tmp_path / "a.usda")


def test_a_process_that_dies_is_an_error_of_the_file(asset, tmp_path, monkeypatch):
    program = tmp_path / "dies.py"
    program.write_text("import os; os.abort()")
    monkeypatch.setattr("r2sego_blender.splats.formats.usd_stage.__file__", str(program))
    save_asset(tmp_path / "a.usdc", asset)
    with pytest.raises(AssetError, match="not a readable USD"):
        load_asset(tmp_path / "a.usdc")
