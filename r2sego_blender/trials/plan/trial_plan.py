"""The frozen plan of a study: every trial with its policy, poses and chair, in the order they are run."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...bundle.containment import require_contained
from ...config.declared_files import Reader, is_place
from ...config.fields import setting
from ...core.errors import SceneError, TrialError, may_not_be_read
from ...core.json_files import parse_json
from ...core.printable import printable
from ...core.text_files import read_bytes
from ..records.index import RecordIndex
from .rules import Rules

PLAN, FROZEN, BEGUN, ENDED = "plan.json", "plan.sha256", "begun.json", "ended.json"
"""Files of a study's folder: the plan, its SHA-256 as ``sha256sum`` writes it, when it began and was ended."""

PAGE = "plan.html"
"""The plan as a page to print, there."""

ORDERS = ("alternating", "randomised")
TETHERS = ("gate", "always")
SUFFIX = ".trials"

MOST_TRIALS = 10_000
_MOST_BYTES = 16 << 20
_MOST_NAME = 100
_FORMAT = 1


def name_text(value: Any, where: Path) -> str:
    """A name of 1 to 100 printable characters. Raises ValueError."""
    if not isinstance(value, str) or not 0 < len(value.strip()) <= _MOST_NAME or printable(value) != value:
        raise ValueError(f"Write a name of 1 to {_MOST_NAME} printable characters in quotes.")
    return value.strip()


def sha256_text(value: Any, where: Path) -> str:
    """A SHA-256 in hexadecimal. Raises ValueError."""
    if not isinstance(value, str) or not re.fullmatch("[0-9a-f]{64}", value):
        raise ValueError("Write a SHA-256: 64 small hexadecimal digits in quotes.")
    return value


def names_of(value: Any, where: Path) -> tuple[str, ...]:
    """Different names. Raises ValueError."""
    if not isinstance(value, list) or not value or len(set(map(str, value))) < len(value):
        raise ValueError('Write a list of different names: ["office chair", "stool"].')
    return tuple(name_text(one, where) for one in value)


def corners_of(value: Any, where: Path) -> tuple[tuple[float, float], ...]:
    """Corners in metres. Raises ValueError."""
    if not isinstance(value, list) or not all(map(is_place, value)):
        raise ValueError("Write corners in metres: [[x, y], [x, y], [x, y]].")
    return tuple((float(x), float(y)) for x, y in value)


@dataclass(frozen=True)
class FloorPose:
    """Where something stands on the floor, in the world's metres, and the way it faces.

    The heading is in degrees counter-clockwise from the world's x axis; a chair faces where its sitter looks.
    """

    x_m: float = setting(doc="Along the world's x axis.", low=-1000.0, high=1000.0)
    y_m: float = setting(doc="Along the world's y axis.", low=-1000.0, high=1000.0)
    heading_deg: float = setting(doc="The way it faces.", low=-360.0, high=360.0)

    @property
    def values(self) -> tuple[float, float, float]:
        """``x_m``, ``y_m`` and ``heading_deg``, as a session tells them."""
        return self.x_m, self.y_m, self.heading_deg


@dataclass(frozen=True)
class PlannedPolicy:
    """A trained policy: its ``condition`` (what its training scene was) and the seed that pairs it with others.

    ``label`` is what the operator reads, which tells no condition where the plan is blinded.
    ``simulated_successes`` of ``simulated_episodes`` is what it did in its training simulator, if given.
    """

    condition: str = setting(doc="The visual asset it was trained with.", read=name_text)
    seed: int = setting(doc="The policy-training seed.", low=0, high=2**31)
    sha256: str = setting(doc="Its file's digest.", read=sha256_text)
    label: str = setting(doc="What the operator reads.", read=name_text)
    file: str = setting("", "Its file's name.")
    simulated_successes: int | None = setting(None, "Successes in its training simulator.", 0, 1_000_000)
    simulated_episodes: int = setting(25, "Of so many episodes.", 1, 1_000_000)


@dataclass(frozen=True)
class PlannedTrial:
    """One trial; people count from 1 (``number``), lists from 0 (``index``).

    Trials of one seed and repetition have the same poses and chair under each condition. ``tether``: "gate"
    detaches it after a successful tethered sit of the policy, "always" never.
    """

    index: int = setting(doc="Its place in the order.", low=0, high=MOST_TRIALS)
    condition: str = setting(doc="As its policy's.", read=name_text)
    label: str = setting(doc="What the operator reads of the policy.", read=name_text)
    policy_seed: int = setting(doc="As its policy's.", low=0, high=2**31)
    policy_sha256: str = setting(doc="As its policy's.", read=sha256_text)
    repetition: int = setting(doc="Which of the policy's trials, from 0.", low=0, high=MOST_TRIALS)
    tether: str = setting(doc="When it is detached.", choices=TETHERS)
    robot_pose: FloorPose = setting()
    chair_pose: FloorPose = setting()
    chair: str = setting(doc="The chair's type.", read=name_text)

    @property
    def number(self) -> int:
        """As people count."""
        return self.index + 1


@dataclass(frozen=True)
class _PlanFile:
    """What ``plan.json`` holds."""

    format: int = setting(doc="Version of the file.", low=_FORMAT, high=_FORMAT)
    name: str = setting(doc="The study's name.", read=name_text)
    order: str = setting(doc="How conditions follow another.", choices=ORDERS)
    blinded: bool = setting(doc="Whether labels and counts tell the operator no condition.")
    seed: int = setting(doc="What orders, labels and poses were drawn from.", low=0, high=2**31)
    rules: Rules = setting()
    chairs: tuple[str, ...] = setting(doc="Types of chairs.", read=names_of)
    policies: tuple[PlannedPolicy, ...] = setting()
    trials: tuple[PlannedTrial, ...] = setting()
    floor: tuple[tuple[float, float], ...] = setting((), "Outline of the floor, for the page; metres.", read=corners_of)


@dataclass(frozen=True)
class TrialPlan(_PlanFile):
    """A frozen plan; ``digest`` is the SHA-256 of its file's bytes, which every record names."""

    digest: str = ""

    @property
    def conditions(self) -> tuple[str, ...]:
        """In the order in which they were declared."""
        return tuple(dict.fromkeys(policy.condition for policy in self.policies))

    @property
    def seeds(self) -> tuple[int, ...]:
        """The policy-training seeds that pair the conditions' policies."""
        return tuple(dict.fromkeys(policy.seed for policy in self.policies))

    @staticmethod
    def load(study_folder: str | Path) -> TrialPlan:
        """The plan of a study's folder.

        Raises TrialError: none is there, or it is not the one that was frozen, or that trials began with; or a link
        leads out of the folder.
        """
        study = Path(study_folder)
        file = study / PLAN
        if not os.path.lexists(file):  # whoever points at another folder has it not walked through
            raise _no_plan(file)
        require_own_files(study)
        written = _bytes_of(file)
        digest = hashlib.sha256(written).hexdigest()
        if _bytes_of(study / FROZEN).split() != [digest.encode(), PLAN.encode()]:
            raise _changed(file, f"its SHA-256 is not the one in {FROZEN}")
        if (study / BEGUN).exists() and (begun := _begun_digest(study / BEGUN)) != digest:
            raise _changed(file, f"trials began with the plan {begun[:12]}")
        if not (study / BEGUN).exists() and RecordIndex(study).file.exists():
            raise _changed(study / BEGUN, "it is gone, and records are there")
        return parsed_plan(written, file)


def require_own_files(study: Path) -> None:
    """Raises TrialError where a link leads out of a study's folder, which may come from a stranger."""
    try:
        require_contained(study)
    except SceneError as error:
        raise TrialError(error.what.replace("bundle", "study"), where=error.where, cure=error.cure) from error


def plan_bytes(plan: TrialPlan) -> bytes:
    """The bytes of a plan's file."""
    tables = {field.name: getattr(plan, field.name) for field in dataclasses.fields(_PlanFile)}
    return (json.dumps(tables, indent=1, default=_table) + "\n").encode()


def _table(declared: Any) -> dict[str, Any]:
    """The fields of a part that are given."""
    return {name: value for name, value in vars(declared).items() if value is not None}


def parsed_plan(written: bytes, file: Path) -> TrialPlan:
    """The plan in a file's bytes. Raises TrialError, which names the file and the field."""
    reader = Reader(file, "plan of trials", TrialError)
    try:
        data = parse_json(written.decode("utf-8-sig"))
    except ValueError as error:
        raise TrialError(f"it is no plan of trials: {error}", where=file, cure=_MAKE) from error
    read = reader.table(_PlanFile, data)
    plan = TrialPlan(**vars(read), digest=hashlib.sha256(written).hexdigest())
    if problem := _problem_of(plan):
        raise TrialError(f"this plan of trials {problem}", where=file, cure=_MAKE)
    return plan


_MAKE = "Make it again: r2sego trials plan DECLARATION.toml."


def _problem_of(plan: TrialPlan) -> str:
    """What does not fit together in a plan, in words that follow "this plan"; '' where all does."""
    policies = {(one.condition, one.seed): one for one in plan.policies}
    if not 0 < len(plan.trials) <= MOST_TRIALS:
        return f"has {len(plan.trials)} trials, not 1 to {MOST_TRIALS}"
    if len(policies) != len(plan.policies):
        return "has two policies of one condition and seed"
    if any((condition, seed) not in policies for condition in plan.conditions for seed in plan.seeds):
        return "has a seed that not every condition has"
    if any((one.simulated_successes or 0) > one.simulated_episodes for one in plan.policies):
        return "has more successes in simulation than episodes"
    seen = set()
    for index, trial in enumerate(plan.trials):
        policy = policies.get((trial.condition, trial.policy_seed))
        key = (trial.condition, trial.policy_seed, trial.repetition)
        if trial.index != index or key in seen:
            return f"has trial {trial.index} out of its order or twice"
        if policy is None or (policy.sha256, policy.label) != (trial.policy_sha256, trial.label):
            return f"has trial {trial.index} of a policy that is not in it"
        if trial.chair not in plan.chairs:
            return f"has trial {trial.index} on a chair that is not in it"
        seen.add(key)
    return ""


def _bytes_of(file: Path) -> bytes:
    try:
        return read_bytes(file, _MOST_BYTES)
    except PermissionError as error:
        raise may_not_be_read(file, TrialError) from error
    except (OSError, ValueError) as error:
        raise _no_plan(file) from error


def _no_plan(file: Path) -> TrialError:
    return TrialError("there is no plan of trials here", where=file, cure=_MAKE)


def _begun_digest(file: Path) -> str:
    try:
        return str(parse_json(_bytes_of(file).decode())["plan"])
    except (ValueError, LookupError, TypeError) as error:
        raise _changed(file, "it does not say which plan began") from error


def _changed(file: Path, what: str) -> TrialError:
    cure = "Put back the plan as it was; to change it, end this study with a reason and plan a new one."
    return TrialError(f"the plan was changed after it was frozen: {what}", where=file, cure=cure)
