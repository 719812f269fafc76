"""Masks painted and objects removed by a script, with pip bpy and the real engine."""

import shutil
from functools import partial

import numpy as np
import pytest
from click.testing import CliRunner
from example_runs import run_with_engine

from r2sego_blender.commands.cli import main
from r2sego_blender.core.images import load_image_uint8, save_image

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_with_engine, "proxy_masks.py")


def picture(file, height, width):
    """A mask: white in a part that is no symmetry's."""
    mask = np.zeros((height, width, 3), np.float32)
    mask[5 : height // 2, 3 : width // 3] = 1.0
    save_image(file, mask)
    return file


def test_painted_masks_are_declared_as_the_command_does(bundle_path, blender_environment, tmp_path):
    same = shutil.copytree(bundle_path, tmp_path / "same.r2s")
    masks = shutil.copytree(bundle_path / "objects" / "crate" / "masks", tmp_path / "masks" / "crate")
    (masks.parent / "shelf").mkdir()
    wide = picture(masks.parent / "shelf" / "capture_0.png", 48, 64)
    tall = picture(masks.parent / "shelf" / "capture_2.png", 80, 60)
    done = run(
        blender_environment,
        bundle_path,
        "--paint",
        f"shelf:capture_0={wide}",
        "--paint",
        f"shelf:capture_2={tall}",
        "--remove",
        "lamp",
    )
    assert done.returncode == 0, done.stderr + done.stdout
    assert "crate: 3 masks, aligned" in done.stdout and "shelf: 2 masks, not run yet" in done.stdout
    assert "lamp: " not in done.stdout
    said = CliRunner().invoke(main, ["objects", str(same), "--masks", str(masks.parent)])
    assert said.exit_code == 0, said.output
    made, expected = bundle_path / "objects", same / "objects"
    files = sorted(str(file.relative_to(expected)) for file in expected.rglob("*.*"))
    assert sorted(str(file.relative_to(made)) for file in made.rglob("*.*")) == files
    assert "shelf/masks/capture_2.png" in files and not any(name.startswith("lamp") for name in files)
    for file in files:
        np.testing.assert_array_equal(load_image_uint8(made / file), load_image_uint8(expected / file))


def test_a_picture_of_another_size_is_refused(bundle_path, blender_environment, tmp_path):
    file = picture(tmp_path / "small.png", 20, 30)
    done = run(blender_environment, bundle_path, "--paint", f"shelf:capture_0={file}")
    assert done.returncode == 1
    assert "the picture is 30x20, not 64x48" in done.stderr and "Traceback" not in done.stderr
    assert sorted(one.name for one in (bundle_path / "objects").iterdir()) == ["crate", "lamp"]
