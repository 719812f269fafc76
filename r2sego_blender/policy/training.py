"""A policy of a scene: trained, evaluated and exported, as the commands do it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bundle.scene import Scene
from ..config.declared_files import Reader, did_you_mean
from ..config.fields import fields_of
from ..core.digests import content_digest
from ..core.errors import SettingsError
from ..core.progress import SILENT, Progress
from ..results.policy_evaluation import EMBEDDED_DRIVE
from .dagger.settings import DaggerSettings
from .packages import policy_package
from .same_run import begin_or_go_on

if TYPE_CHECKING:
    from .dagger.bundle_episodes import BundleEpisodes
    from .dagger.episodes import Outcome
    from .dagger.evaluation import Evaluation
    from .environment.environments import SitEnv

TEACHER = "teacher"
"""In place of a training's folder: the privileged teacher."""
STUDENT_ONNX = "student.onnx"
TRAINED_IN = "trained_in.json"
"""Of what task a training's folder is."""


@dataclass(frozen=True)
class Task:
    """What is trained and evaluated in: a scene's room, seen through ``asset``, its own if that is ''.

    Without ``chairs``, names of ``environment.chairs.CHAIRS``, the robot sits down on the room's own seats. With
    ``reference``, a reference room's folder, episodes take place there and begin as in the scene. A ``tracker``,
    TWIST2's ONNX file, balances the robot in place of the embedded controller, unaided.
    """

    scene: Path
    asset: str = ""
    chairs: tuple[str, ...] = ()
    reference: str = ""
    tracker: str = ""

    @property
    def driver(self) -> str:
        """What carries the actions out, to be said with every result."""
        return f"TWIST2 ({Path(self.tracker).name}), unaided" if self.tracker else EMBEDDED_DRIVE

    def environment(self) -> SitEnv:
        """The environment. Raises MachineError without the extra ``policy``, and what ``SitEnv`` raises."""
        policy_package("gymnasium")
        from .environment.environments import SitEnv

        return SitEnv(self.scene, asset=self.asset, chairs=self.chairs, reference=self.reference, tracker=self.tracker)

    def declared(self) -> dict[str, Any]:
        """All that decides how its episodes go, ready for JSON; files by their content. Raises as ``environment``."""
        from .environment.reference_room import COLLISION, LIGHT
        from .environment.scene_digests import behaviour_of, digest_of, scene_digests

        scene = Scene.open(self.scene)
        asset = Path(self.asset) if self.asset else scene.asset_file
        reference = [content_digest(Path(self.reference, one)) for one in (LIGHT, COLLISION)] if self.reference else []
        return {
            "scene": self.scene.name,
            "asset": asset.name,
            "chairs": list(self.chairs),
            "driver": self.driver,
            "robot": scene.declaration.robot,
            **scene_digests(scene, asset, behaviour_of(scene, sits=True)),
            "tracker_sha256": content_digest(Path(self.tracker)) if self.tracker else "",
            "reference_sha256": digest_of(reference),
        }


def settings_of(overrides: Mapping[str, str]) -> DaggerSettings:
    """Settings with the texts of a command line. Raises SettingsError naming the key, or the allowed range."""
    known = fields_of(DaggerSettings)
    reader = Reader(Path("settings"), "setting", SettingsError)
    changed: dict[str, Any] = {}
    for key, text in overrides.items():
        if key not in known:
            cure = did_you_mean(key, known, f"Known: {', '.join(known)}.")
            raise SettingsError(f"there is no setting '{key}'", where="--set", cure=cure)
        try:
            value: Any = known[key].kind(text)
        except ValueError:
            value = text
        changed[key] = reader.value(known[key], value)
    return DaggerSettings(**changed)


def train_policy(task: Task, folder: Path, settings: DaggerSettings, progress: Progress = SILENT) -> Path:
    """Train a student in ``folder``, or go on with the training there; its ONNX file.

    Raises SettingsError where ``folder`` holds a training of another task (``Task.declared``), or of an older version
    that did not write all of it down, and as ``dagger.loop.train_student``.
    """
    env = task.environment()
    from .dagger.bundle_episodes import BundleEpisodes
    from .dagger.loop import train_student
    from .student.onnx_export import export_onnx

    episodes = BundleEpisodes(env)
    folder.mkdir(parents=True, exist_ok=True)
    begin_or_go_on(folder / TRAINED_IN, task.declared(), "training")
    student = train_student(episodes, episodes, settings, folder, env.limits, progress)
    export_onnx(student, folder / STUDENT_ONNX)
    return folder / STUDENT_ONNX


def policy_outcomes(
    task: Task,
    policy: str | Path,
    episodes: int,
    seed: int,
    progress: Progress = SILENT,
    room: BundleEpisodes | None = None,
) -> Iterator[Outcome]:
    """How so many episodes end in which a training's student, or the teacher, acts.

    Episodes are drawn by ``seed`` and differ from those of trainings; ``room`` has them, the task's own if it is
    not given. Raises MachineError where the folder ``policy`` has no checkpoint that can be read.
    """
    policy_package("gymnasium")
    from .dagger.acting import outcomes, taught_outcomes
    from .dagger.bundle_episodes import BundleEpisodes
    from .dagger.checkpoints import load_student
    from .dagger.loop import CHECKPOINT

    room = room or BundleEpisodes(task.environment())
    seeds = progress.track(evaluation_seeds(seed, episodes), "Episodes", episodes)
    if policy == TEACHER:
        yield from taught_outcomes(room, room, room.limits, iter(seeds))
    else:
        yield from outcomes(room, load_student(Path(policy) / CHECKPOINT), iter(seeds))


def evaluate_policy(
    task: Task, policy: str | Path, episodes: int, seed: int, progress: Progress = SILENT
) -> Evaluation:
    """How often ``policy_outcomes`` are successes."""
    from .dagger.evaluation import Evaluation

    return Evaluation.of(policy_outcomes(task, policy, episodes, seed, progress))


def evaluation_seeds(seed: int, count: int) -> Sequence[int]:
    """Seeds of episodes that no training has."""
    return [int(np.random.SeedSequence([seed, number, 1]).generate_state(1)[0]) for number in range(count)]


def lines(task: Task, policy: str | Path, found: Evaluation) -> Iterator[str]:
    """An evaluation for a person."""
    what = "the teacher, which knows the true state" if policy == TEACHER else f"the student of {policy}"
    on = f"on a {', a '.join(task.chairs)}" if task.chairs else "on the room's own seats"
    where = f"the reference room {task.reference}" if task.reference else task.scene.name
    yield f"{what}, in {where}{f' seen through {task.asset}' if task.asset else ''}, {on}:"
    yield str(found)
    helped = "no force helps" if task.tracker else "the helping force on the base is the mean assist"
    yield f"driven by {task.driver}: {helped}"
