"""What became of a round's generated views, as ``pose.json`` and ``decision.json`` tell it.

Needs the standard library alone, so Blender's Python reads it.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import index
from pathlib import Path
from typing import Any

from ..core.cameras import Camera
from ..core.errors import GenerationError
from ..core.json_files import finite_number, opened_json, read_json
from ..core.printable import printable
from .decisions import decision_of, save_decision

_LONGEST = 2000
_MOST = 2**31 - 1
_WORDS = {True: "accepted by hand", False: "rejected by hand"}


@dataclass(frozen=True)
class ViewRecord:
    """One generated view.

    ``rank`` names it; ``candidate``, ``rollout`` and ``frame`` say which candidate it is,
    ``reference`` and ``overlap`` (0 to 1) its capture i(v). ``by_gate`` is the gate's word,
    ``by_hand`` the person's or None, ``reason`` the gate's in words. ``figures`` are the
    registration's: ``expected``, ``matches``, ``inliers``, ``spread``, and where a pose was
    estimated (``has_estimate``) ``offset_m``, ``turn_deg``, ``focal_px``, ``sigma_m`` and
    ``sigma_deg``. ``replaces`` is the rank of the rejected view it stood in for, ``replaced_by``
    of the one that stood in for it, -1 for none. ``note`` is the camera path's.
    """

    folder: Path
    rank: int
    candidate: int
    rollout: int
    frame: int
    reference: str
    overlap: float
    generator: str
    by_gate: bool
    by_hand: bool | None
    reason: str
    has_estimate: bool
    figures: dict[str, float]
    replaces: int
    replaced_by: int
    note: str

    @property
    def accepted(self) -> bool:
        """Whether the asset is trained on it."""
        return self.by_gate if self.by_hand is None else self.by_hand

    @property
    def fate(self) -> str:
        """What became of it, in words."""
        if self.by_hand is None:
            return self.reason
        return f"{_WORDS[self.by_hand]} (by its figures: {self.reason})"

    def to_json(self) -> dict[str, Any]:
        """Everything but the folder."""
        said = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "folder"}
        return said | {"accepted": self.accepted, "fate": self.fate}


def read_views(folder: Path, budget: int) -> list[ViewRecord]:
    """The views in ``rounds/<l>/views``, by rank; an empty list when none was generated.

    ``budget`` is the number of target views: those of a rank beyond it stand in for rejected
    ones, in order. Raises GenerationError when a view's files are damaged.
    """
    told = [_read(file.parent) for file in sorted(folder.glob("[0-9][0-9][0-9]/pose.json"))]
    ranks = [record["rank"] for _, record, *_ in told]
    rejected = [record["rank"] for _, record, *_ in told if not record["accepted"]]
    spares = sorted(rank for rank in ranks if rank >= budget)
    stand_in = dict(zip(rejected, spares, strict=False))
    stood_for = {spare: rank for rank, spare in stand_in.items()}
    return [_record(*parts, stand_in, stood_for) for parts in told]


def decide(folder: Path, decisions: dict[int, bool | None]) -> None:
    """Accept, reject or leave to the gate (None) views in ``rounds/<l>/views``, named by rank.

    All are checked before any is changed. Raises GenerationError when there is no such view,
    or an accepted one has no pose.
    """
    for rank, accepted in decisions.items():
        view = folder / f"{rank:03d}"
        if not (view / "pose.json").is_file():
            raise GenerationError(
                f"there is no generated view {rank}", where=folder, cure="Choose a view that `r2sego views` lists."
            )
        _, record, *_ = _read(view)
        if accepted and record["estimate"] is None:
            raise GenerationError(
                f"view {rank} has no estimated pose, so nothing can be trained on it",
                where=view,
                cure="Leave it rejected, or run the round again.",
            )
    for rank, accepted in decisions.items():
        save_decision(folder / f"{rank:03d}", accepted)


def _read(view: Path) -> tuple[Path, dict[str, Any], bool | None, str]:
    file = view / "pose.json"
    try:
        record = read_json(file)
        checked = (record["rank"], record["estimate"], record["accepted"])
        if not isinstance(checked[0], int) or not 0 <= checked[0] <= _MOST or not isinstance(checked[2], bool):
            raise TypeError("'rank' or 'accepted' is of another kind")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise _damaged(file, error) from error
    return view, record, decision_of(view), _note(view / "path.json")


def _note(file: Path) -> str:
    """What the camera path says of its way; '' where there is none."""
    try:
        return printable(str(read_json(file).get("note", "")), _LONGEST)
    except FileNotFoundError:
        return ""
    except (OSError, ValueError, AttributeError) as error:
        raise _damaged(file, error) from error


def _record(
    view: Path,
    record: dict[str, Any],
    by_hand: bool | None,
    note: str,
    stand_in: dict[int, int],
    stood_for: dict[int, int],
) -> ViewRecord:
    figures = ("expected", "matches", "inliers", "spread", "offset_m", "turn_deg", "focal_px", "sigma_m", "sigma_deg")
    try:
        rank = record["rank"]
        return ViewRecord(
            view,
            rank,
            _index(record["candidate"]),
            _index(record["rollout"]),
            _index(record["frame"]),
            printable(str(record["reference_name"]), _LONGEST),
            finite_number(record["overlap"]),
            printable(str(record["generator"]), _LONGEST),
            record["accepted"],
            by_hand,
            printable(str(record["reason"]), _LONGEST),
            record["estimate"] is not None,
            {name: finite_number(record[name]) for name in figures if name in record},
            stood_for.get(rank, -1),
            stand_in.get(rank, -1),
            note,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged(view / "pose.json", error) from error


def _index(value: Any) -> int:
    found = index(value)
    if not 0 <= found <= _MOST:
        raise ValueError(f"{value} counts nothing")
    return found


def _damaged(file: Path, error: Exception) -> GenerationError:
    return GenerationError(
        f"this generated view cannot be read: {error!r:.200}", where=file, cure="Run `r2sego refine` again."
    )


def read_camera_path(file: Path) -> list[Camera]:
    """The cameras of a clip in its ``path.json``, reference first, all with the target's lens.

    Raises GenerationError for a damaged file.
    """
    with opened_json(file, GenerationError, "this is no camera path") as told:
        path = [Camera.from_json(camera) for camera in told["cameras"]]
        return [path[-1].at(camera.world_from_camera) for camera in path]
