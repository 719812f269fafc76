import os

import pytest


@pytest.fixture
def bundle_path(tmp_path):
    from fake_bundle import write_bundle

    return write_bundle(tmp_path / "room.r2s")


@pytest.fixture(scope="session")
def blender_environment(tmp_path_factory):
    """The environment of a Blender whose own files go to a new folder."""
    return {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("blender_user"))}
