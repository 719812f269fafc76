"""Where renderings of the assets stand in a bundle, and that there are never many."""

import os
import shutil
import time

import pytest

from r2sego_blender.core.errors import AssetError
from r2sego_blender.results.panels.asset_renderings import (
    FOLDER,
    SIDES,
    camera_folder,
    prune,
    remove_rendering,
    renderings_of_view,
    stage_beside,
    views_folder,
)
from r2sego_blender.results.panels.bundle import Bundle

YESTERDAY = time.time() - 86_400.0


@pytest.fixture
def copied(bundle_path, tmp_path):
    """A copy of the fake bundle, to write into."""
    return Bundle.open(shutil.copytree(bundle_path, tmp_path / "room.r2s"))


def rendered(folder, when=YESTERDAY):
    """A folder of renderings, as the engine leaves it."""
    folder.mkdir(parents=True)
    (folder / "000.png").write_bytes(b"png")
    os.utime(folder, (when, when))
    return folder


def test_each_rounds_assets_are_the_ones_before_and_after_it(copied):
    assert [stage_beside(copied, 0, side).name for side in SIDES] == ["initial", "0"]
    assert [stage_beside(copied, 1, side).name for side in SIDES] == ["0", "1"]
    with pytest.raises(AssetError, match="no asset '2'"):
        stage_beside(copied, 2, "AFTER")


def test_renderings_are_found_until_the_asset_changes(copied):
    stage = stage_beside(copied, 1, "AFTER")
    file = rendered(views_folder(copied, 1, stage)) / "000.png"
    assert renderings_of_view(copied, 1, 0) == {"asset after the round": file}
    assert renderings_of_view(copied, 1, 1) == renderings_of_view(copied, 0, 0) == {}
    os.utime(stage.file, (YESTERDAY, YESTERDAY))
    assert renderings_of_view(copied, 1, 0) == {}


def test_what_nothing_shows_any_more_is_removed(copied):
    current = [
        rendered(views_folder(copied, index, stage_beside(copied, index, side))) for index in (0, 1) for side in SIDES
    ]
    earlier = [rendered(copied.path / FOLDER / f"{number:016x}") for number in range(5)]
    begun = rendered(copied.path / FOLDER / "begun", time.time())
    prune(copied)
    assert sorted((copied.path / FOLDER).iterdir()) == sorted([*current, begun])
    assert not any(folder.exists() for folder in earlier)
    stage = stage_beside(copied, 1, "AFTER")
    os.utime(stage.file, (YESTERDAY, YESTERDAY))
    prune(copied)
    assert not current[3].exists() and all(folder.exists() for folder in current[:3])


def test_a_bundle_without_renderings_is_left_alone(copied):
    before = sorted(copied.path.iterdir())
    prune(copied)
    assert sorted(copied.path.iterdir()) == before


def test_one_cameras_rendering_goes_and_nothing_else(copied):
    folder = rendered(camera_folder(copied, stage_beside(copied, 0, "AFTER"), {"name": "picture"}))
    remove_rendering(copied, folder / "000.png")
    assert not folder.exists() and (copied.path / FOLDER).is_dir()
    for other in (copied.path / "asset.ply", copied.path / "rounds" / "0" / "asset.ply"):
        remove_rendering(copied, other)
        assert other.exists()
