"""An episode of a policy on the timeline: the robot as along a rollout, and what its head saw."""

from __future__ import annotations

import bpy

from ...core.errors import SceneError
from ...results.panels.bundle import Bundle
from ...results.panels.rollout_list import POLICY, attempts
from ...results.policy_evaluation import head_pictures
from ..shared.clip_images import clip_image, put_behind, remove_clips
from .show_robot import show_rollouts

HEAD_IMAGE = "R2S-EGO Head"
"""The image sequence of what the head saw."""


def show_policy_episode(
    scene: bpy.types.Scene, bundle: Bundle, number: int, *, look_through: bool = False
) -> bpy.types.Image | None:
    """The robot along a recorded episode, in place of the rollouts shown before, and what its head saw.

    The pictures stand before the head camera, frame by frame; returned is their image, None where they were not
    kept. ``look_through`` makes that camera the scene's. Raises SceneError as ``show_rollouts``, before anything
    changes.
    """
    episode = next((one for one in attempts(bundle, POLICY) if one.number == number), None)
    if episode is None:
        raise SceneError(f"there is no episode {number}", where=bundle.path, cure="Choose one of the list.")
    files = head_pictures(bundle, number, episode.frames)
    (root,) = show_rollouts(scene, bundle, POLICY, [number], look_through=look_through)
    root.name = f"Episode {number}"
    if not files:
        remove_clips(HEAD_IMAGE)  # of another episode
        return None
    image = clip_image(HEAD_IMAGE, files, SceneError)
    camera = next(part for part in root.children if part.type == "CAMERA")
    put_behind(camera, image, len(files), 0)
    return image
