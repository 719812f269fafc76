"""What lies in a bundle, read: photographs, geometry, splats, and robot and scope in this room."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..bundle.layout import COMPLETED, DEPTH, OBSERVED, PLANES, PRIORS, SPARSE, capture_files
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.sparse import SparsePoints
from ..captures.store import load_captures
from ..config.settings import Settings
from ..core.cameras import Camera
from ..core.errors import GenerationError
from ..core.images import resize_nearest
from ..generation.conditions.conditions import ZBufferRenderer
from ..geometry.objects.priors import object_place
from ..geometry.proxy.proxy import GeometryProxy
from ..geometry.proxy.seen_floor import seen_floor
from ..geometry.room.completion import CompletedDepth
from ..geometry.room.planes import RoomPlanes
from ..geometry.stereo.observed import ObservedGeometry
from ..geometry.stereo.stereo import DepthMap
from ..robot.behaviours.sit_on import ANY_SEAT
from ..robot.model.model import RobotModel
from ..robot.model.robot_file import robot_digest
from ..robot.rollouts.candidates import ego_camera
from ..robot.scope.scope import FREE_FLOOR, BehaviourScope
from ..splats.asset import SplatAsset
from ..splats.formats.ply import load_made
from ..views.selection import Selection, load_candidates


@dataclass(frozen=True)
class Contents:
    """What the steps under ``h`` read of ``scene``; captures, robot and scope are read once.

    ``name`` is the bundle's name of a proxy or asset, such as "rounds/0/proxy".
    """

    scene: Scene
    h: Settings

    # ---- as it was registered and declared

    @cached_property
    def captures(self) -> tuple[Capture, ...]:
        """The photographs with their cameras in the world."""
        return load_captures(self.scene.captures_folder)

    @cached_property
    def cameras(self) -> tuple[Camera, ...]:
        """The captures' cameras."""
        return tuple(capture.camera for capture in self.captures)

    @cached_property
    def capture_files(self) -> list[str]:
        """What the files of each capture are called in a step's folder."""
        return capture_files([capture.name for capture in self.captures])

    def sparse(self) -> SparsePoints:
        """The triangulated points."""
        return SparsePoints.load(self.scene.path / SPARSE)

    @cached_property
    def scope(self) -> BehaviourScope:
        """The declared behaviour, as it is written."""
        return BehaviourScope.load(self.scene.declaration.scope)

    @cached_property
    def robot_file(self) -> tuple[str, ...]:
        """What a step that reads the robot depends on: its file's digest, nothing where it is embedded."""
        source, _ = self.scope.robot_for(self.scene.declaration.robot)
        digest = robot_digest(source)
        return (digest,) if digest else ()

    @cached_property
    def robot(self) -> RobotModel:
        """The declared robot with its camera's mount."""
        return RobotModel.load(*self.scope.robot_for(self.scene.declaration.robot))

    @cached_property
    def ego_camera(self) -> Camera:
        """The head camera's lens, with images of the first capture's sides: robots' lie, whichever way a
        phone was held."""
        first = self.captures[0].camera
        return ego_camera(self.robot, max(first.shape), min(first.shape))

    # ---- as the steps published it

    def depth_maps(self) -> list[DepthMap]:
        """Each capture's dense stereo."""
        return [DepthMap.load(self.scene.path / DEPTH / file) for file in self.capture_files]

    def reliable_depths(self) -> list[np.ndarray]:
        """Each capture's reliable stereo depth (H, W) at the capture's own size, 0 elsewhere."""
        return [
            resize_nearest(np.where(m.reliable(self.h.stereo), m.depth, 0.0), *capture.camera.shape)
            for capture, m in zip(self.captures, self.depth_maps(), strict=True)
        ]

    def observed(self) -> ObservedGeometry:
        """M_obs."""
        return ObservedGeometry.load(self.scene.path / OBSERVED)

    def planes(self) -> RoomPlanes:
        """The room's planes."""
        return RoomPlanes.load(self.scene.path / PLANES)

    def completed(self) -> list[CompletedDepth]:
        """Each capture's completed depth."""
        return [CompletedDepth.load(self.scene.path / COMPLETED / file) for file in self.capture_files]

    def completed_depths(self) -> list[np.ndarray]:
        """The same as (H, W) planar metres at the captures' own sizes."""
        return [
            resize_nearest(one.depth, *capture.camera.shape)
            for capture, one in zip(self.captures, self.completed(), strict=True)
        ]

    def proxy(self, name: str) -> GeometryProxy:
        """The geometry proxy of a round."""
        return GeometryProxy.load(self.scene.path / name / "proxy.npz")

    def proxy_depths(self, proxy: GeometryProxy) -> list[np.ndarray]:
        """The proxy's depth in each capture, (H, W) float32 metres."""
        renderer = ZBufferRenderer(proxy)
        return [renderer.depth(camera) for camera in self.cameras]

    def selection(self, name: str) -> tuple[Selection, list[Camera]]:
        """The target views of a round, and the candidates they are chosen from.

        Raises GenerationError where the two, or their references and the captures, do not belong together.
        """
        folder = self.scene.path / name
        selection, candidates = Selection.load(folder), load_candidates(folder)
        known = selection.overlaps.shape[1]
        if len(selection.score) != len(candidates) or known not in (0, len(self.captures)):
            raise GenerationError(
                f"it is of {len(selection.score)} candidates and {known} captures, and there are "
                f"{len(candidates)} and {len(self.captures)}",
                where=folder / "selection.npz", cure="Run `r2sego refine` again.",
            )  # fmt: skip
        return selection, candidates

    def asset(self, name: str) -> SplatAsset:
        """Splats of the bundle."""
        return load_made(self.scene.path / name)

    # ---- the behaviour in this room

    def outline(self, scope: BehaviourScope, proxy: str) -> tuple[tuple[float, float], ...]:
        """Corners of the region where ``scope`` lets the robot be; of the free floor, the part
        that captures vouch for."""
        if scope.region.within != FREE_FLOOR:
            return scope.region.within
        return tuple(map(tuple, seen_floor(self.proxy(proxy), self.cameras).tolist()))

    def placed_scope(self, scope: BehaviourScope, proxy: str) -> BehaviourScope:
        """``scope`` with its region's corners and, where the robot sits down on a named object,
        that object's place. Raises GeometryError when no such object is aligned."""
        target = scope.sit_on.target
        if names_object(scope) and scope.behaviours.sit_on > 0.0:
            target = object_place(self.scene.path / PRIORS, target)
        return replace(
            scope, region=replace(scope.region, within=self.outline(scope, proxy)),
            sit_on=replace(scope.sit_on, target=target),
        )  # fmt: skip


def names_object(scope: BehaviourScope) -> bool:
    """Whether the place to sit down is a declared object's."""
    return isinstance(scope.sit_on.target, str) and scope.sit_on.target != ANY_SEAT
