"""bpy's own files go to a folder of their own; a small bundle for every test here."""

import os
import tempfile

import pytest

_own_files = tempfile.TemporaryDirectory(prefix="r2sego-blender-user-")  # goes when the tests end
os.environ.setdefault("BLENDER_USER_RESOURCES", _own_files.name)


@pytest.fixture(scope="session")
def bundle_path(tmp_path_factory):
    """A fake bundle; tests only read it."""
    from fake_bundle import write_bundle

    return write_bundle(tmp_path_factory.mktemp("bundle") / "room.r2s")


@pytest.fixture
def bundle(bundle_path):
    """The fake bundle, opened."""
    from r2sego_blender.results.panels.bundle import Bundle

    return Bundle.open(bundle_path)


@pytest.fixture
def scene():
    """An empty Blender scene."""
    bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")
    bpy.ops.wm.read_homefile(use_empty=True)
    return bpy.context.scene
