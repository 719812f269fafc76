"""The folder of a study, NAME.trials: its plan is frozen there, begun once, and ended with a reason."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.atomic_files import write_whole
from ...core.errors import TrialError
from ...core.json_files import opened_json
from ...core.printable import printable
from ...core.text_files import read_text
from ..records.index import RecordIndex
from .declaration import Declaration
from .drawing import drawn_plan
from .trial_plan import BEGUN, ENDED, FROZEN, PAGE, PLAN, SUFFIX, TrialPlan, plan_bytes, require_own_files

DECLARATION = "declaration.toml"
_MOST_REASON = 2000


@dataclass(frozen=True)
class StudyState:
    """When the first trial began and when a person ended the study, UTC, "" before that, and why."""

    begun: str = ""
    ended: str = ""
    reason: str = ""


def freeze_plan(declaration: str | Path, study_folder: str | Path | None = None) -> tuple[TrialPlan, Path]:
    """Draw the plan of a declaration and freeze it in a study's folder, by default beside it with its name.

    A plan that has not begun is replaced, and its printed page goes. Raises TrialError: the declaration is
    none, its plan has begun, or a link leads out of the folder.
    """
    file = Path(declaration)
    declared = Declaration.load(file)
    study = Path(study_folder) if study_folder else file.with_suffix(SUFFIX)
    require_own_files(study)
    if (study / BEGUN).exists() or RecordIndex(study).file.exists():
        cure = "End it with a reason (r2sego trials end) and plan a new study in another folder."
        raise TrialError("the plan of this study has begun", where=study, cure=cure)
    if (study / ENDED).exists():
        raise TrialError("this study was ended", where=study, cure="Plan a new one in another folder.")
    plan = drawn_plan(declared, file)
    try:
        study.mkdir(parents=True, exist_ok=True)
        (study / FROZEN).unlink(missing_ok=True)  # killed from here on, there is no plan
        (study / PAGE).unlink(missing_ok=True)
        write_whole(study / DECLARATION, read_text(file, 1 << 20))
        write_whole(study / PLAN, plan_bytes(plan).decode())
        write_whole(study / FROZEN, f"{plan.digest}  {PLAN}\n")
    except OSError as error:
        raise TrialError(
            f"the plan cannot be written: {error.strerror}", where=study, cure="Name a folder that you may write in."
        ) from error
    return TrialPlan.load(study), study


def begin_study(study_folder: str | Path, plan: TrialPlan) -> None:
    """Say that the first trial of a plan begins: from then on it cannot be changed. Says it once.

    Raises TrialError: the study was ended, or it began with another plan.
    """
    study = Path(study_folder)
    if TrialPlan.load(study).digest != plan.digest:
        raise TrialError("another plan lies here", where=study, cure="Load the plan of this study.")
    if state_of(study).ended:
        raise TrialError("this study was ended", where=study, cure="Plan a new one.")
    if not (study / BEGUN).exists():
        write_whole(study / BEGUN, _said(plan=plan.digest, utc=_now()))


def end_study(study_folder: str | Path, reason: str) -> None:
    """End a study for good: no trial of it is run again. Raises TrialError: no reason, or ended before."""
    study = Path(study_folder)
    plan = TrialPlan.load(study)
    if not reason.strip() or len(reason) > _MOST_REASON:
        raise TrialError("an end has its reason", where=study, cure=f"Give one, in up to {_MOST_REASON} characters.")
    if state_of(study).ended:
        raise TrialError("this study was ended before", where=study, cure="Nothing is to be done.")
    write_whole(study / ENDED, _said(plan=plan.digest, utc=_now(), reason=reason.strip()))


def state_of(study_folder: str | Path) -> StudyState:
    """Whether a study has begun and was ended. Raises TrialError where its files are damaged."""
    study = Path(study_folder)
    begun, ended = _told(study / BEGUN), _told(study / ENDED)
    return StudyState(begun.get("utc", ""), ended.get("utc", ""), ended.get("reason", ""))


def _told(file: Path) -> dict[str, str]:
    if not file.exists():
        return {}
    with opened_json(file, TrialError, "it does not say what it should", "Put it back as it was.") as data:
        if not isinstance(data["utc"], str) or not data["utc"]:
            raise ValueError("no time")
        return {name: printable(str(value), _MOST_REASON) for name, value in data.items()}


def _said(**told: Any) -> str:
    return json.dumps(told, indent=1) + "\n"


def _now() -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
