"""bpy's own files go to a folder of their own."""

import os
import tempfile

import pytest

_own_files = tempfile.TemporaryDirectory(prefix="r2sego-blender-user-")  # goes when the tests end
os.environ.setdefault("BLENDER_USER_RESOURCES", _own_files.name)


@pytest.fixture
def scene():
    """An empty Blender scene."""
    bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")
    bpy.ops.wm.read_homefile(use_empty=True)
    return bpy.context.scene
