"""Conditions survive the disk: the EXRs to the bit, the PNGs to their steps."""

from dataclasses import fields, replace

import cv2
import numpy as np
import OpenEXR
import pytest
from box_room import arc, proxy

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.generation.conditions.condition_files import load_conditions, save_conditions
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.conditions.point_condition import PointConditions


@pytest.fixture(scope="module")
def conditions():
    """Three frames of different sizes; the last one looks at the room from outside."""
    with_table = replace(proxy(), instance=np.where(np.arange(24) >= 12, 300, 0).astype(np.int32))
    path = [*arc(2, 96, 72), arc(1)[0].at(look_at([0.0, -6.0, 1.2], [0.0, 0.0, 1.2]))]
    return ZBufferRenderer(with_table).render(path)


@pytest.fixture(scope="module")
def points(box_room, conditions):
    return PointConditions(box_room.captures, box_room.depths, GenerationSettings()).render(0, conditions)


@pytest.mark.parametrize("derived", [False, True])
def test_conditions_survive_the_disk_to_the_bit(tmp_path, conditions, points, derived):
    save_conditions(tmp_path, conditions, points, derived)
    for loaded, saved in zip(load_conditions(tmp_path), conditions, strict=True):
        assert loaded.camera.to_json() == saved.camera.to_json()
        for part in [field.name for field in fields(saved) if field.name != "camera"]:
            assert getattr(loaded, part).dtype == getattr(saved, part).dtype
            np.testing.assert_array_equal(getattr(loaded, part), getattr(saved, part))


def test_an_exr_has_blenders_names_and_float32(tmp_path, conditions, points):
    save_conditions(tmp_path, conditions, points, derived=True)
    with OpenEXR.File(str(tmp_path / "001.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    scalars = {"Depth", "Distance", "Validity", "Provenance", "Instance", "Visibility"}
    vectors = {f"{name}.{axis}" for name in ("Normal", "NormalCamera") for axis in "XYZ"}
    passes = {f"{name}.V" for name in scalars} | vectors | {f"Combined.{c}" for c in "RGBA"}
    assert set(channels) == {f"ViewLayer.{name}" for name in passes}
    assert {pixels.dtype for pixels in channels.values()} == {np.dtype(np.float32)}
    np.testing.assert_array_equal(channels["ViewLayer.Distance.V"], conditions[1].distance)
    np.testing.assert_array_equal(channels["ViewLayer.NormalCamera.Z"], conditions[1].normal_camera[..., 2])
    np.testing.assert_array_equal(channels["ViewLayer.Visibility.V"], points[1].visibility)
    np.testing.assert_array_equal(channels["ViewLayer.Combined.A"] > 0, points[1].known)
    half = np.abs(points[1].colour[..., 0] - 0.5) < 1e-3  # sRGB one half is 0.214 of the light
    np.testing.assert_allclose(channels["ViewLayer.Combined.R"][half], 0.214, atol=2e-3)


def test_blender_finds_the_passes_by_name(tmp_path, conditions, points):
    bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")
    save_conditions(tmp_path, conditions, points)
    tree = bpy.data.node_groups.new("conditions", "CompositorNodeTree")
    node, image = tree.nodes.new("CompositorNodeImage"), bpy.data.images.load(str(tmp_path / "000.exr"))
    node.image = image
    assert image.type == "MULTILAYER"
    assert {output.name for output in node.outputs} == {
        "Depth",
        "Normal",
        "Provenance",
        "Validity",
        "Instance",
        "Visibility",
    }
    bpy.data.node_groups.remove(tree)
    bpy.data.images.remove(image)


def test_pngs_hold_what_their_bits_can(tmp_path, conditions, points):
    save_conditions(tmp_path, conditions, points)
    for index, (condition, point) in enumerate(zip(conditions, points, strict=True)):
        images = {
            name: cv2.imread(str(tmp_path / f"{index:03d}_{name}.png"), cv2.IMREAD_UNCHANGED)
            for name in ("depth", "normal", "provenance", "instance", "validity", "points")
        }
        assert images["depth"].dtype == np.uint16
        np.testing.assert_allclose(images["depth"] / 1000.0, condition.depth, atol=5.1e-4)
        normal = images["normal"][..., ::-1] / 127.5 - 1.0
        seen = condition.depth > 0
        np.testing.assert_allclose(normal[seen], (condition.normal_camera * (1, -1, -1))[seen], atol=0.0041)
        assert (normal[seen][:, 2] > -0.005).all()  # towards the camera
        assert not images["normal"][~seen].any()
        np.testing.assert_array_equal(images["provenance"], condition.provenance)
        np.testing.assert_array_equal(images["instance"] == 255, condition.instance == 300)
        np.testing.assert_allclose(images["validity"] / 255.0, condition.validity)
        np.testing.assert_allclose(images["points"][..., ::-1] / 255.0, point.colour, atol=0.5001 / 255)


def test_depth_beyond_16_bits_is_unknown_in_the_png_alone(tmp_path, conditions):
    far = replace(conditions[0], depth=np.full_like(conditions[0].depth, 70.0))
    save_conditions(tmp_path, [far])
    assert not cv2.imread(str(tmp_path / "000_depth.png"), cv2.IMREAD_UNCHANGED).any()
    assert (load_conditions(tmp_path)[0].depth == 70.0).all()


@pytest.mark.parametrize("kept", [None, 0, 100, 2000])
def test_damaged_conditions_are_named(tmp_path, conditions, kept):
    save_conditions(tmp_path, conditions)
    file = tmp_path / "001.exr"
    if kept is None:
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(GenerationError, match="again") as raised:
        load_conditions(tmp_path)
    assert str(tmp_path if kept is None else file) in str(raised.value)


def test_files_of_another_kind_are_refused(tmp_path, conditions):
    with pytest.raises(GenerationError, match="no conditions"):
        load_conditions(tmp_path)
    values = np.zeros((4, 4), np.float32)
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"ViewLayer.Depth.V": values}) as file:
        file.write(str(tmp_path / "000.exr"))
    with pytest.raises(GenerationError, match="damaged"):
        load_conditions(tmp_path)
