"""Algorithm 1 of the paper, line for line.

Each procedure stands in ``refine/steps.py`` as a step of the bundle: it takes what earlier ones have
published, publishes what it returns, and is passed over while nothing it takes has changed. Starting a
refinement again therefore goes on where it stopped.
"""

from __future__ import annotations

import contextlib

from .bundle.runner import Runner
from .bundle.scene import Scene
from .core.progress import SILENT, Progress
from .refine.behaviour import DeclaredBehaviour
from .refine.capture_steps import Reached
from .refine.steps import Steps, Views


def refine(scene: Scene, progress: Progress = SILENT, until: str = "", runner: Runner | None = None) -> None:
    """R2S-EGO dual-proxy scene refinement: the refined asset and collision surface of a scene.

    The captures were registered in the world frame when the bundle was made; the rounds
    L, the budget K and the rest of H come from the scene's declaration. With ``until``, the
    bundle's name of what a step publishes, it ends when that is there. Another ``runner`` of the
    scene may look at the steps in place of running them. Raises SceneError while another process
    or thread writes to the scene, and RobotError before anything runs where its scope names a program as
    policy that nobody has trusted on this machine.
    """
    if runner is None:
        DeclaredBehaviour.of(scene).require_trusted()
    runner = runner or Runner(scene)
    with runner.held(), contextlib.suppress(Reached):
        _algorithm_1(Steps(runner, scene.declaration.settings, progress, until))


def _algorithm_1(step: Steps) -> None:
    """The numbers are the paper's lines. What is passed on are artifacts of the bundle."""
    captures, asset = step.register_inputs()  # 1
    observed, priors = step.observed_and_prior_geometry(captures)  # 2
    aligned_priors = step.align_priors(captures, observed, priors)  # 3, fixed in all rounds
    pseudo_observations: tuple[Views, ...] = ()  # 4
    for l in range(step.h.rounds):  # 5
        step.progress.message(f"Round {l} ({step.h.rounds} in all)")
        proxy = step.geometry_proxy(l, captures, observed, aligned_priors, asset)  # 6
        collision = step.replace_collision_mesh(l, proxy)  # 7
        candidates = step.successful_ego_poses(l, captures, aligned_priors, proxy, collision, asset)  # 8
        targets = step.robot_proxy(l, captures, aligned_priors, candidates, proxy, asset)  # 9, 10
        generated = step.ego_video_reg(l, captures, aligned_priors, proxy, targets)  # 11
        pseudo_observations += generated  # 12
        asset = step.update_visual_asset(l, asset, captures, aligned_priors, proxy, pseudo_observations)  # 13
    step.publish_refined_scene(collision, asset)  # 14
