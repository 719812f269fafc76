"""The declared behaviour: robot and scope of a bundle, and where they stand in its room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..core.cameras import Camera
from ..geometry.objects.prior_files import PRIORS, AlignedPrior, object_place
from ..geometry.proxy.proxy import PROXY, GeometryProxy
from ..geometry.proxy.seen_floor import seen_floor
from ..robot.behaviours.sit_on import ANY_SEAT
from ..robot.controllers.policy_trust import require_trusted
from ..robot.model.model import RobotModel
from ..robot.model.robot_file import robot_digest
from ..robot.rollouts.candidates import ego_camera
from ..robot.scope.scope import BehaviourScope
from ..splats.asset import SplatAsset
from .head_sight import HeadSight


@dataclass(frozen=True)
class DeclaredBehaviour:
    """``scope`` as it is written, for the declared ``robot``: a file, or the name of an embedded one."""

    scope: BehaviourScope
    robot: str

    @staticmethod
    def of(scene: Scene) -> DeclaredBehaviour:
        """What a scene declares. Raises RobotError where its scope cannot be read."""
        declared = scene.declaration
        return DeclaredBehaviour(BehaviourScope.load(declared.scope), declared.robot)

    @cached_property
    def robot_file(self) -> tuple[str, ...]:
        """What a step that reads the robot depends on: its file's digest, nothing where it is embedded."""
        source, _ = self.scope.robot_for(self.robot)
        digest = robot_digest(source)
        return (digest,) if digest else ()

    @cached_property
    def model(self) -> RobotModel:
        """The robot with its camera's mount."""
        return RobotModel.load(*self.scope.robot_for(self.robot))

    def sight(self, asset: SplatAsset) -> HeadSight:
        """What the robot's head sees of ``asset``."""
        return HeadSight(asset, self.model.source, self.model.mount)

    @property
    def sees(self) -> bool:
        """Whether the visual asset changes what is done in rollouts."""
        return self.scope.controller.kind == "student"

    def require_trusted(self) -> None:
        """Raises RobotError where the scope's policy is a program that nobody has trusted on this machine."""
        if self.scope.controller.kind == "policy":
            require_trusted(self.scope.controller.file)

    def ego_camera(self, captures: Sequence[Capture]) -> Camera:
        """The head camera's lens, with images of the first capture's sides: robots' lie, whichever way a
        phone was held."""
        first = captures[0].camera
        return ego_camera(self.model, max(first.shape), min(first.shape))

    @property
    def names_object(self) -> bool:
        """Whether the place to sit down is a declared object's."""
        return isinstance(self.scope.sit_on.target, str) and self.scope.sit_on.target != ANY_SEAT

    def outline(self, captures: Sequence[Capture], proxy: GeometryProxy) -> tuple[tuple[float, float], ...]:
        """Corners of the region where the robot may be; of the free floor, what captures vouch for."""
        within = self.scope.region.within
        if not isinstance(within, str):
            return within
        return tuple(map(tuple, seen_floor(proxy, [capture.camera for capture in captures]).tolist()))

    def placed_in(self, scene: Scene, round_index: int) -> BehaviourScope:
        """``placed`` in the room as the scene's round has it."""
        priors = scene.read(PRIORS) if self.names_object else ()
        return self.placed(scene.read(CAPTURES), scene.read(PROXY.of_round(round_index)), priors)

    def placed(
        self, captures: Sequence[Capture], proxy: GeometryProxy, priors: Sequence[AlignedPrior]
    ) -> BehaviourScope:
        """The scope with its region's corners and, where the robot sits down on a named object, that
        object's place. Raises GeometryError when no such object is aligned."""
        scope = self.scope
        target = scope.sit_on.target
        if isinstance(target, str) and self.names_object and scope.behaviours.sit_on > 0.0:
            target = object_place(priors, target)
        return replace(  # type: ignore[call-arg]  # of a behaviour
            scope,
            region=replace(scope.region, within=self.outline(captures, proxy)),
            sit_on=replace(scope.sit_on, target=target),
        )
