"""Where a robot can begin: places that are free, where it stands, and from which a target can be reached."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from ...config.settings import RolloutSettings
from ...core.json_files import write_json
from ...core.progress import SILENT, Progress
from ..behaviours.trajectory import Seat
from ..model.composition import compose
from ..model.model import RobotModel
from ..planning.free_floor import CELL_M, FreeFloor, free_floor
from ..planning.navigation import ways_to_seats
from ..planning.seats import find_seats
from ..scope.scope import BehaviourScope
from .standing import stand_at

SPAWN_POSES = "spawn_poses.json"
_ABOUT = (
    "Places where the robot's base may begin, world frame, metres and radians about z. Each is free, was stood on in "
    "MuJoCo for held_s with the embedded reference motions, and has a way over the free floor of way_m to the place "
    "before its seat, a number of seats; without seats, to all the free floor. What was tried and refused has a reason."
)
# Candidates lie so far apart at least, so many are stood on, each for so long.
_SPACING_M, _MOST, _HELD_S = 0.25, 64, 1.0


class Refusal(StrEnum):
    """Why a robot cannot begin somewhere."""

    NOT_FREE = "not_free"
    OUT_OF_REACH = "out_of_reach"
    DOES_NOT_STAND = "does_not_stand"


@dataclass(frozen=True)
class SpawnPose:
    """The robot's base at ``xy_m`` (2,), world x and y, facing ``yaw_rad``.

    ``seat`` is the nearest one's index in ``SpawnPoses.seats``, None without any, and ``way_m`` the way to
    the place before it. A refused one has its ``refusal`` and what happened in ``detail``.
    """

    xy_m: tuple[float, float]
    yaw_rad: float
    seat: int | None = None
    way_m: float = 0.0
    refusal: Refusal | None = None
    detail: str = ""


@dataclass(frozen=True)
class SpawnPoses:
    """What was found in one scene for one robot and scope; ``proven`` and ``refused`` in the order of the draw.

    ``base_height_m`` is the standing base's above the floor, whose world z is ``floor_z_m``.
    """

    robot: str
    scope: str
    floor_z_m: float
    base_height_m: float
    seats: tuple[Seat, ...]
    proven: tuple[SpawnPose, ...]
    refused: tuple[SpawnPose, ...]

    def save(self, file: Path) -> None:
        """Write them as JSON for any program; seats by the names of ``Seat``'s fields."""
        told: dict[str, Any] = {"about": _ABOUT, "robot": self.robot, "scope": self.scope, "held_s": _HELD_S}
        told |= {"floor_z_m": self.floor_z_m, "base_height_m": self.base_height_m}
        told["seats"] = [dataclasses.asdict(seat) for seat in self.seats]
        told["poses"] = [_told(pose, "seat", "way_m") for pose in self.proven]
        told["refused"] = [_told(pose, "refusal", "detail") for pose in self.refused]
        write_json(file, told)


def find_spawn_poses(
    robot: RobotModel,
    scope: BehaviourScope,
    collision_mjcf: Path,
    settings: RolloutSettings,
    seed: int,
    progress: Progress = SILENT,
) -> SpawnPoses:
    """Try places all over the region, no two nearer than a quarter of a metre, and until 64 are proven.

    The same arguments give the same bits. Raises RobotError where the scene has no free floor, or no seat
    where the scope has the robot sit down.
    """
    floor = free_floor(robot, scope, collision_mjcf)
    sits = scope.behaviours.sit_on > 0.0
    seats = find_seats(robot.half_width_m, floor, scope.sit_on, collision_mjcf) if sits else ()
    nearest, way_m = _ways(floor, seats)
    composition = compose(robot, collision_mjcf, settings)
    rng = np.random.default_rng(seed)
    proven: list[SpawnPose] = []
    refused: list[SpawnPose] = []
    cells = _candidates(floor, rng)
    with progress.task("Spawn poses", len(cells)) as task:
        for row, column in cells:
            task.advance()
            x, y = map(float, floor.points(row, column))
            if not floor.free[row, column]:
                refused.append(SpawnPose((x, y), 0.0, refusal=Refusal.NOT_FREE))
            elif not np.isfinite(way_m[row, column]):
                refused.append(SpawnPose((x, y), 0.0, refusal=Refusal.OUT_OF_REACH))
            elif len(proven) < _MOST:
                held = stand_at(robot, composition, floor, scope, np.array([row, column]), rng, _HELD_S)
                if held.stands:
                    seat = int(nearest[row, column]) if seats else None
                    proven.append(SpawnPose((x, y), held.yaw_rad, seat, float(way_m[row, column])))
                else:
                    why = f"{held.reason}: {held.detail}" if held.reason else f"the base moved {held.offset_m:.3f} m"
                    refused.append(SpawnPose((x, y), held.yaw_rad, refusal=Refusal.DOES_NOT_STAND, detail=why))
    return SpawnPoses(
        robot.source, scope.name, floor.floor_z_m, robot.rest_height_m, seats, tuple(proven), tuple(refused)
    )


def _ways(floor: FreeFloor, seats: Sequence[Seat]) -> tuple[np.ndarray, np.ndarray]:
    """The nearest seat's index and the way to it (ny, nx), metres; inf where there is none."""
    if not seats:
        return np.full(floor.free.shape, -1), np.where(floor.free, 0.0, np.inf)
    return ways_to_seats(floor, seats)


def _candidates(floor: FreeFloor, rng: np.random.Generator) -> np.ndarray:
    """Cells (n, 2) of the region in a drawn order, no two nearer than ``_SPACING_M`` and all others nearer to one.

    Free ones come before others that they would have to make room for.
    """
    reach = round(_SPACING_M / CELL_M)
    across = np.arange(-reach, reach + 1)
    apart = across[:, None] ** 2 + across**2 >= reach**2
    waiting = np.pad(floor.region | floor.free, reach)
    cells = []
    for row, column in (*np.argwhere(floor.free), *np.argwhere(floor.region & ~floor.free)):
        if waiting[row + reach, column + reach]:
            cells.append((row, column))
            waiting[row : row + len(across), column : column + len(across)] &= apart
    return rng.permutation(np.array(cells))


def _told(pose: SpawnPose, *fields: str) -> dict[str, Any]:
    return {"xy_m": pose.xy_m, "yaw_rad": math.remainder(pose.yaw_rad, math.tau)} | {
        field: getattr(pose, field) for field in fields
    }
