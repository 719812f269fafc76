"""How a scene's collision surface does in MuJoCo: spheres rest on it, the robot stands on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bundle.damage import require_as_made
from ..bundle.layout import COLLISION, of_round
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..core.errors import SceneError
from ..core.progress import SILENT, Progress
from ..geometry.collision.collision_check import WITHIN_M, CollisionCheck, check_collision, gap_in_words
from ..geometry.proxy.proxy import PROXY
from ..refine.behaviour import DeclaredBehaviour
from ..robot.model.mujoco_warnings import described, mujoco_warnings
from ..robot.rollouts.standing import Standing, stand

_MOST_LINES = 10  # of places off the surface; all are in the JSON
_SAME_PLACE_M = 0.005
_OF_SEVERAL = {"floats": "float", "is sunk in": "are sunk in"}


@dataclass(frozen=True)
class CollisionReport:
    """What spheres and the scene's robot make of its current collision surface."""

    surface: CollisionCheck
    standing: Standing

    @property
    def passed(self) -> bool:
        """The surface holds the spheres, but for what is allowed on edges, and the robot stands."""
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
            "rest_within_1_cm_of_proxy": int((surface.at_rest & (abs(surface.proxy_gap_m) <= WITHIN_M)).sum()),
            "largest_gap_m": _largest(surface.gap_m[surface.at_rest]),
            "off_surface": _places_off_surface(surface),
            "simulated_s": round(surface.simulated_s, 3),
            "robot_stands": standing.stands,
            "robot_place_m": list(standing.place_m),
            "robot_held_s": round(standing.held_s, 3),
            "robot_pelvis_offset_m": standing.offset_m,
            "robot_failure": ": ".join(filter(None, (standing.reason, standing.detail))),
        }


def check_scene(scene: Scene, progress: Progress = SILENT) -> CollisionReport:
    """Check the current collision surface of ``scene`` with its declared robot and scope.

    Raises SceneError when there is none yet, or it is not as it was made or of an earlier world
    frame, and while another process or thread writes to the scene; GeometryError or RobotError when
    it is damaged.
    """
    with scene.held_still():
        return _checked(scene, progress)


def _checked(scene: Scene, progress: Progress) -> CollisionReport:
    rounds = scene.rounds_of_result()
    if not scene.collision_folder.is_dir() or not rounds:
        raise SceneError(
            "there is no collision surface yet", where=scene.path, cure=f"Run `r2sego refine {scene.path}` first."
        )
    require_present_frame(scene, [COLLISION, of_round(rounds - 1, "proxy")], "checked")
    require_as_made(scene, COLLISION)
    proxy = scene.read(PROXY.of_round(rounds - 1))
    behaviour = DeclaredBehaviour.of(scene)
    with mujoco_warnings() as heard:
        surface = check_collision(scene.collision_folder, (proxy.vertices, proxy.faces), progress)
        standing = stand(
            behaviour.model, behaviour.scope, scene.collision_folder / "scene.xml", scene.declaration.settings.rollouts
        )
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
    off = facts["off_surface"]
    text += [f"  {_in_words(place)}" for place in off[:_MOST_LINES]]
    text += [f"  and {len(off) - _MOST_LINES} more"] if len(off) > _MOST_LINES else []
    x, y = facts["robot_place_m"]
    if facts["robot_stands"]:
        text.append(
            f"the robot stands at ({x:.2f}, {y:.2f}): its pelvis stays within "
            f"{100 * facts['robot_pelvis_offset_m']:.1f} cm for {facts['robot_held_s']:.0f} s"
        )
    else:
        why = facts["robot_failure"] or f"its pelvis moved by {100 * facts['robot_pelvis_offset_m']:.1f} cm"
        text.append(f"the robot does not stand at ({x:.2f}, {y:.2f}): {why}")
    return [*text, _verdict(report)]


def _verdict(report: CollisionReport) -> str:
    surface = report.surface
    off = len(surface.off_surface)
    if report.passed:
        return f"passed, with {off} of {len(surface.starts)} spheres off the surface" if off else "passed"
    robot = [] if report.standing.stands else ["the robot does not stand"]
    return f"not passed: {'; '.join([*surface.failures, *robot])}"


def _places_off_surface(surface: CollisionCheck) -> list[dict[str, Any]]:
    """What became of the spheres that do not rest on the surface, the worst first, JSON-ready.

    Those that rest at one place, as where they rolled together, are told once, as so many ``spheres``.
    """
    told: list[dict[str, Any]] = []
    for index in surface.off_surface:
        one = _off_surface(surface, int(index))
        same = (
            other
            for other in told
            if other["what"] == one["what"] and math.dist(other["place_m"], one["place_m"]) < _SAME_PLACE_M
        )
        if (before := next(same, None)) is None:
            told.append({**one, "spheres": 1})
        else:
            before["spheres"] += 1
    return told


def _off_surface(surface: CollisionCheck, index: int) -> dict[str, Any]:
    """What became of a sphere that does not rest on the surface.

    ``place_m`` (3,): its centre where it rests, or where it was dropped if it went elsewhere;
    ``gap_m``: how far it floats, negative where it is sunk in, None where it does not rest near.
    """
    gap_m = float(surface.gap_m[index])
    if surface.fell_through[index]:
        what = "fell through"
    elif surface.left[index]:
        what = "rolled off the floor"
    elif not surface.at_rest[index]:
        what = "did not come to rest"
    else:
        what = "floats" if gap_m > 0.0 else "is sunk in"
    rests = what in _OF_SEVERAL
    place = (surface.ends if rests else surface.starts)[index]
    near = rests and np.isfinite(gap_m)
    return {"what": what, "place_m": place.tolist(), "gap_m": gap_m if near else None}


def _in_words(off: dict[str, Any]) -> str:
    place = ", ".join(f"{x:.2f}" for x in off["place_m"])
    what, count = off["what"], off["spheres"]
    if what not in _OF_SEVERAL:
        return f"one dropped at ({place}) {what}"
    how_many, what = ("one", what) if count == 1 else (count, _OF_SEVERAL[what])
    gap_m = np.inf if off["gap_m"] is None else abs(off["gap_m"])
    return f"{how_many} at ({place}) {what} by {gap_in_words(gap_m)}"


def _largest(gaps_m: np.ndarray) -> float | None:
    finite = gaps_m[np.isfinite(gaps_m)]
    return float(finite.max()) if len(finite) else None
