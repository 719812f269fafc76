"""How a scene's collision surface does in MuJoCo: spheres rest on it, the robot stands on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import SceneError
from .geometry.collision_check import VERTEX_TOLERANCE_M, WITHIN_M, CollisionCheck, check_collision
from .geometry.proxy import GeometryProxy
from .progress import SILENT, Progress
from .robot.model import RobotModel
from .robot.mujoco_warnings import described, mujoco_warnings
from .robot.scope import BehaviourScope
from .robot.standing import Standing, stand
from .scene import Scene


@dataclass(frozen=True)
class CollisionReport:
    """What spheres and the scene's robot make of its current collision surface."""

    surface: CollisionCheck
    standing: Standing

    @property
    def passed(self) -> bool:
        """Compiled as written, every sphere rests within 1 cm of it, and the robot stands."""
        return self.surface.passed and self.standing.stands

    def to_json(self) -> dict[str, Any]:
        """Counts and lengths in metres, JSON-ready."""
        surface, standing = self.surface, self.standing
        return {
            "passed": self.passed,
            "pieces": surface.pieces,
            "vertex_error_m": surface.vertex_error_m,
            "spheres": len(surface.starts),
            "at_rest": int(surface.at_rest.sum()),
            "fell_through": int(surface.fell_through.sum()),
            "left_the_floor": int(surface.left.sum()),
            "rest_within_1_cm": int(surface.on_surface.sum()),
            "rest_within_1_cm_of_proxy": int(
                (surface.at_rest & (abs(surface.proxy_gap_m) <= WITHIN_M)).sum()
            ),
            "largest_gap_m": _largest(surface.gap_m[surface.at_rest]),
            "simulated_s": round(surface.simulated_s, 3),
            "robot_stands": standing.stands,
            "robot_place_m": list(standing.place_m),
            "robot_held_s": round(standing.held_s, 3),
            "robot_pelvis_offset_m": standing.offset_m,
            "robot_failure": ": ".join(filter(None, (standing.reason, standing.detail))),
        }


def check_scene(scene: Scene, progress: Progress = SILENT) -> CollisionReport:
    """Check the current collision surface of ``scene`` with its declared robot and scope.

    Raises SceneError when there is none yet, GeometryError or RobotError when it is damaged.
    """
    rounds = scene.rounds_done()
    if not scene.collision_folder.is_dir() or not rounds:
        raise SceneError(
            "there is no collision surface yet", where=scene.path,
            cure=f"Run `r2sego refine {scene.path}` first.",
        )  # fmt: skip
    proxy = GeometryProxy.load(scene.round_folder(rounds - 1) / "proxy" / "proxy.npz")
    declared = scene.declaration
    scope = BehaviourScope.load(declared.scope)
    with mujoco_warnings() as heard:
        surface = check_collision(scene.collision_folder, (proxy.vertices, proxy.faces), progress)
        standing = stand(
            RobotModel.load(*scope.robot_for(declared.robot)), scope,
            scene.collision_folder / "scene.xml", declared.settings.rollouts,
        )  # fmt: skip
    if heard:
        progress.message(f"MuJoCo warned: {described(heard)}", "warning")
    return CollisionReport(surface, standing)


def lines(report: CollisionReport) -> list[str]:
    """The report as lines for a person."""
    facts = report.to_json()
    count = facts["spheres"]
    rest = (
        f"{facts['at_rest']} of {count} spheres came to rest in {facts['simulated_s']:.1f} s, "
        f"{facts['fell_through']} fell through, {facts['left_the_floor']} rolled off the floor"
    )
    near = (
        f"{facts['rest_within_1_cm']} of {count} rest within 1 cm of the surface "
        f"({facts['rest_within_1_cm_of_proxy']} of the proxy before it was simplified)"
    )
    compiled = f"{facts['pieces']} convex pieces, compiled to {1e3 * facts['vertex_error_m']:.3g} mm"
    text = [compiled, rest, near]
    x, y = facts["robot_place_m"]
    if facts["robot_stands"]:
        text.append(
            f"the robot stands at ({x:.2f}, {y:.2f}): its pelvis stays within "
            f"{100 * facts['robot_pelvis_offset_m']:.1f} cm for {facts['robot_held_s']:.0f} s"
        )
    else:
        why = facts["robot_failure"] or f"its pelvis moved by {100 * facts['robot_pelvis_offset_m']:.1f} cm"
        text.append(f"the robot does not stand at ({x:.2f}, {y:.2f}): {why}")
    text.append("passed" if report.passed else f"not passed: {'; '.join(_failures(report))}")
    return text


def _failures(report: CollisionReport) -> list[str]:
    """What did not pass, and where it is worst."""
    surface, found = report.surface, []
    if surface.vertex_error_m > VERTEX_TOLERANCE_M:
        found.append("pieces are not where they were written")
    off = np.flatnonzero(~surface.on_surface)
    if len(off):
        worst = off[np.argmax(np.abs(surface.gap_m[off]))]
        place = ", ".join(f"{x:.2f}" for x in surface.ends[worst])
        gap_cm, count = 100.0 * surface.gap_m[worst], len(surface.starts)
        side = "above" if gap_cm > 0.0 else "below"
        how = f"{abs(gap_cm):.1f} cm {side}" if np.isfinite(gap_cm) else "far from"
        found.append(f"{len(off)} of {count} spheres; the worst ends at ({place}), {how} the surface")
    if not report.standing.stands:
        found.append("the robot")
    return found


def _largest(gaps_m: np.ndarray) -> float | None:
    finite = gaps_m[np.isfinite(gaps_m)]
    return float(finite.max()) if len(finite) else None
