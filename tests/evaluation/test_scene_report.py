"""The report of a scene says what is so of it."""

import json

import numpy as np
import pytest

from r2sego_blender.evaluation.scene_report import write_scene_report
from r2sego_blender.scene import Scene
from r2sego_blender.scene_declaration import Declaration


@pytest.fixture
def scene(tmp_path):
    """A bundle without rounds, whose behaviour scope brings its own robot."""
    scope = tmp_path / "scope.toml"
    scope.write_text('[robot]\nmodel = "embedded:wheeled"\n')
    declaration = Declaration(
        captures_source="cameras.json", world_from_capture=tuple(map(tuple, np.eye(4).tolist())),
        ground="floor plane", scale_source="metric poses", scope=str(scope),
    )  # fmt: skip

    def fill(folder):
        (folder / "captures" / "images").mkdir(parents=True)
        (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": []}))

    return Scene.create(tmp_path / "room.r2s", declaration, fill)


def test_the_robot_is_the_one_in_use(scene):
    assert scene.declaration.robot == "embedded:humanoid"
    page = write_scene_report(scene).read_text(encoding="utf-8")
    assert "embedded:wheeled" in page and "embedded:humanoid" not in page
