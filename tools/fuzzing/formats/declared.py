"""What people declare in TOML: scenes, scopes and kept settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..harness import Harness
from ..seeds import of_tests


def _bundle(folder: Path) -> None:
    of_tests("bundles").new_bundle(folder / "a.r2s", overrides={"selection.target_views": 3, "proxy.planes": 8})


def _scene(folder: Path) -> Any:
    from r2sego_blender.bundle.scene import Scene

    declaration = Scene.open(folder / "a.r2s").declaration
    return declaration, declaration.settings


def _scope(folder: Path) -> None:
    from r2sego_blender.robot.scope.scope import BehaviourScope
    from r2sego_blender.robot.scope.scope_file import save_scope

    save_scope(BehaviourScope.load("walk_and_look"), folder / "scope.toml")


def _read_scope(folder: Path) -> Any:
    from r2sego_blender.robot.scope.scope import BehaviourScope

    return BehaviourScope.load(str(folder / "scope.toml"))


def _kept(folder: Path) -> None:
    from r2sego_blender.config.kept_settings import keep_settings

    keep_settings(folder, "mine", "preview", {"rounds": 2, "proxy.planes": 8, "selection.target_views": 3})


def _read_kept(folder: Path) -> Any:
    from r2sego_blender.config.kept_settings import read_settings

    return read_settings(folder, "mine")


HARNESSES = (
    Harness("declared/scene.toml", _bundle, "a.r2s/scene.toml", "toml", _scene),
    Harness("declared/scope.toml", _scope, "scope.toml", "toml", _read_scope),
    Harness("declared/kept.toml", _kept, "mine.toml", "toml", _read_kept),
)
