"""What a training gives to other programs: the student as ONNX, and what it learnt from as a LeRobot dataset."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..core.errors import MachineError
from ..core.json_files import opened_json
from ..robot.controllers.drive_actions import NAMES
from .training import STUDENT_ONNX, TRAINED_IN

DEMONSTRATIONS = "demonstrations"
_TASK = "sit down"
_CURE = "Give the folder of `r2sego policy train`."


def export_training(folder: Path, to: Path) -> Path:
    """Write the student of the training ``folder`` and the teacher's episodes that succeeded into ``to``; its ONNX.

    Raises MachineError where ``folder`` has no training that can be read or a package of the extra ``policy`` is
    missing, RobotError where ``to`` has demonstrations already, or none succeeded.
    """
    from .dagger.checkpoints import load_settings, load_student
    from .dagger.episodes import EpisodeStore
    from .dagger.loop import CHECKPOINT
    from .demonstrations.lerobot import Demonstration, write_dataset
    from .environment.episode import STEP_S
    from .student.onnx_export import export_onnx

    with opened_json(folder / TRAINED_IN, MachineError, "this is no training of a policy", _CURE) as said:
        robot = str(said["robot"])
    student, settings = load_student(folder / CHECKPOINT), load_settings(folder / CHECKPOINT)
    store = EpisodeStore(folder / "episodes")

    def taught() -> Iterator[Demonstration]:
        for number in range(settings.teacher_episodes):
            if number in store and not (episode := store[number]).outcome.failure:
                numbers = {"observation.state": episode.proprio, "action": episode.actions}
                yield Demonstration(_TASK, episode.pictures, numbers)

    write_dataset(to / DEMONSTRATIONS, taught(), round(1.0 / STEP_S), robot, {"action": NAMES})
    export_onnx(student, to / STUDENT_ONNX)
    return to / STUDENT_ONNX
