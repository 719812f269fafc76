"""What the session that this Blender follows told last, ten times a second."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy

from ...r2sego_blender.bridge.trials.show_poses import move_poses
from ...r2sego_blender.core.errors import TrialError
from ...r2sego_blender.trials.running.live import Live
from ...r2sego_blender.trials.running.session_lock import is_run
from ...r2sego_blender.workers.jobs import Job
from .. import job
from . import facts

_told: tuple[str, Live] | None = None


def hear(followed: Job, data: Mapping[str, Any]) -> None:
    """Take over what a session told; what is shown of its poses follows it."""
    global _told
    try:
        live = Live.from_json(data)
    except ValueError:  # of another version
        return
    study = str(followed.notes.get("properties", {}).get("study", ""))
    before, _told = _told, (study, live)
    shown = bpy.context.window_manager.r2sego_job
    shown.task = f"{trial_name(live.index)} of {live.total}".capitalize()
    shown.fraction = live.index / max(1, live.total)
    if before is None or before[0] != study or (before[1].index, before[1].state) != (live.index, live.state):
        for scene in bpy.data.scenes:
            if scene.library is None and facts.study_path(scene) == study:
                move_poses(scene, Path(study), trial_name(live.index), live.robot_pose, live.chair_pose, live.chair)


def live_of(study: str) -> Live | None:
    """The followed session of a study, None where there is none."""
    if _told is None or not study or _told[0] != study or not job.is_live():
        return None
    return _told[1]


def forget() -> None:
    """Know of no session."""
    global _told
    _told = None


def trial_name(index: int) -> str:
    """How people call a trial: they count from 1."""
    return f"trial {index + 1}"


def require_session(study: str) -> None:
    """Raise TrialError unless a session of the study runs, here or elsewhere on this machine: what nobody
    reads is lost."""
    if live_of(study) is None and not is_run(Path(study)):
        raise TrialError("no session runs", where=study, cure="Start one with Run, or in a terminal.")
