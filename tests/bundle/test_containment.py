"""What is written for a person never lands among what a bundle's steps read and publish."""

from __future__ import annotations

import pytest
from expected_errors import refused

from r2sego_blender.bundle.containment import require_outside
from r2sego_blender.bundle.layout import DECLARATION
from r2sego_blender.core.errors import SceneError


@pytest.fixture
def bundle(tmp_path):
    place = tmp_path / "room.r2s"
    (place / "captures/images").mkdir(parents=True)
    (place / DECLARATION).write_text("")
    return place


@pytest.mark.parametrize("name", ["", "captures/images", "new/deep", "captures/../asset.ply", "report.png"])
def test_nothing_is_written_among_a_scenes_own(bundle, name):
    with refused(SceneError, bundle / name):
        require_outside(bundle / name)


def test_a_link_into_a_scene_leads_into_it(bundle, tmp_path):
    (tmp_path / "link").symlink_to(bundle / "captures", target_is_directory=True)
    with refused(SceneError, tmp_path / "link/images"):
        require_outside(tmp_path / "link/images")


@pytest.mark.parametrize("name", ["room.r2s/.renderings/0", "beside", "room.r2s.pictures/deep"])
def test_beside_it_and_where_blender_has_its_own_is_free(bundle, tmp_path, name):
    require_outside(tmp_path / name)
