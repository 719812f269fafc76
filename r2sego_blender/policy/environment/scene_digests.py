"""What tells a training scene from another: digests of all that it is made of."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from ...bundle.scene import Scene
from ...config.fields import in_keys
from ...core.digests import content_digest
from ...geometry.objects.prior_files import PRIORS
from ...geometry.proxy.proxy import PROXY
from ...refine.behaviour import DeclaredBehaviour
from ...robot.scope.scope import BehaviourScope


def behaviour_of(scene: Scene, sits: bool, robot: str = "", scope: str = "") -> DeclaredBehaviour:
    """Robot and scope of the task to sit down where ``sits`` and else to walk; ``robot`` and ``scope`` stand in.

    A declared scope without the task's behaviour gives way to the library's. Raises RobotError as the scope's loader.
    """
    found = BehaviourScope.load(scope or scene.declaration.scope)
    if not scope and getattr(found.behaviours, "sit_on" if sits else "walk_to") <= 0.0:
        found = BehaviourScope.load("sit_down" if sits else "walk_and_look")
    return DeclaredBehaviour(found, robot or scene.declaration.robot)


def scene_digests(scene: Scene, asset: Path, behaviour: DeclaredBehaviour) -> dict[str, str]:
    """By name, a SHA-256 of each thing that a training scene is made of, which another place or name leaves the same.

    The region's corners follow from the captures' cameras and the proxy, a named object's place from its prior.
    Of the scope, the controller is left out: a policy's actions drive the robot.
    """
    scope, settings = behaviour.scope, scene.declaration.settings.rollouts
    source, mount = scope.robot_for(behaviour.robot)
    proxy = PROXY.of_round(scene.rounds_of_result() - 1)
    region = [scene.captures_folder / "cameras.json", *(scene.path / made.name for made in (proxy, PRIORS))]
    return {
        "asset_sha256": content_digest(asset),
        "collision_sha256": content_digest(scene.collision_folder),
        "region_sha256": digest_of([*map(content_digest, region)]),
        "scope_sha256": digest_of(in_keys(scope) | {"name": "", "robot": mount, "controller": ""}),
        "robot_sha256": digest_of(behaviour.robot_file or source),
        "rollouts_sha256": digest_of(in_keys(settings)),
    }


def digest_of(values: Any) -> str:
    """A SHA-256 of values of JSON and dataclasses of them."""
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=in_keys).encode()).hexdigest()
