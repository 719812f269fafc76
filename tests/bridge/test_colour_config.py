"""A studio's own OpenColorIO configuration, in which Blender's names of views and colour spaces are missing."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[2]
LEVELS = np.array([[0, 60], [128, 255]], np.uint8)
CONFIG = """ocio_profile_version: 2
search_path: luts
roles: {default: linear, scene_linear: linear, reference: linear, data: numbers, color_picking: film,
        default_byte: film, default_float: linear, default_sequencer: film, aces_interchange: linear}
displays:
  Screen:
    - !<View> {name: Film, colorspace: film}
active_displays: [Screen]
active_views: [Film]
colorspaces:
  - !<ColorSpace> {name: linear}
  - !<ColorSpace> {name: film, from_scene_reference: !<ExponentTransform> {value: 2.2, direction: inverse}}
  - !<ColorSpace> {name: numbers, isdata: true}
"""
SCRIPT = """
import json, sys
from pathlib import Path
import bpy, numpy as np
from r2sego_blender.bridge.generation.conditions import ConditionScene, render_path
from r2sego_blender.bridge.generation.view_pictures import read_levels
from r2sego_blender.bridge.proxy import object_masks
from r2sego_blender.captures.registered_views import RegisteredView
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.proxy.proxy import GeometryProxy

folder = Path(sys.argv[1])
assert bpy.context.scene.view_settings.view_transform == "Film"
floor = np.array([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]], np.float32)
faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
proxy = GeometryProxy(floor, faces, np.zeros(2, np.uint8), np.ones(2, np.uint16), np.ones(2, np.float32),
                      np.zeros(2, np.int32))
camera = Camera(2, 2, 20.0, 20.0, 1.0, 1.0, look_at((0.0, 0.0, 2.0), (0.0, 0.01, 0.0)))
render_path(ConditionScene(proxy), [camera], folder / "conditions", "cycles")
image = object_masks.mask_image("room.r2s", "chair", RegisteredView("one", folder / "levels.png", camera, {}))
object_masks.write_mask(image, np.array([[True, False], [False, True]]))
print(json.dumps({"levels": read_levels(folder / "levels.png")[..., 0].tolist(),
                  "mask": object_masks.read_mask(image).tolist()}))
"""


def test_conditions_masks_and_pictures_need_no_name_of_blenders_own(tmp_path):
    exr = pytest.importorskip("OpenEXR", reason="OpenEXR is not installed")
    (tmp_path / "config.ocio").write_text(CONFIG)
    Image.fromarray(LEVELS).save(tmp_path / "levels.png")
    environment = os.environ | {"OCIO": str(tmp_path / "config.ocio")}
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    ended = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    told = json.loads(ended.stdout.splitlines()[-1])
    np.testing.assert_allclose(told["levels"], LEVELS / 255.0, atol=1e-6)
    assert told["mask"] == [[True, False], [False, True]]
    with exr.File(str(tmp_path / "conditions" / "000.exr"), separate_channels=True) as image:
        depth = image.channels()["ViewLayer.Depth.Z"].pixels
    np.testing.assert_allclose(depth, 2.0, atol=0.01)
