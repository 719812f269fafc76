"""The procedures of Algorithm 1 as steps of the scene bundle.

Each method takes artifacts of the bundle and returns what it publishes; ``pipeline.refine`` calls them
in the paper's order. A step whose inputs and settings have not changed is passed over. Those of
lines 1 to 3 stand in ``capture_steps.py``.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..bundle.artifacts import Artifact, file_at
from ..bundle.figures import COUNTS
from ..captures.per_capture import PerCapture
from ..core.errors import NoFloorError
from ..generation.carried_decisions import carry_decisions
from ..generation.conditions.conditions import ZBufferRenderer
from ..generation.conditions.point_condition import PointConditions
from ..generation.conditions.renderers import make_renderer
from ..generation.ego_views import VIEWS, PseudoObservation, ego_video_reg
from ..generation.generators.registry import installation_of, open_generator
from ..generation.generators.slot import ClipInputs
from ..generation.paths.detours import ClearSpace
from ..generation.registration.frame_registration import hopeless
from ..generation.registration.landmarks import Landmarks
from ..generation.registration.registry import open_registrar, registrar_installation
from ..geometry.collision.collision import CollisionSurface, collision_surface
from ..geometry.collision.collision_files import COLLISION, REFINED_COLLISION
from ..geometry.objects.prior_files import AlignedPrior
from ..geometry.proxy.edited_proxy import edited
from ..geometry.proxy.edits import PROXY_EDITS, Edit
from ..geometry.proxy.fusion import compose_proxy
from ..geometry.proxy.proxy import PROXY, GeometryProxy
from ..geometry.room.completed_depth import CompletedDepth
from ..geometry.room.planes import RoomPlanes
from ..geometry.stereo.observed_geometry import ObservedGeometry
from ..geometry.stereo.stereo import DepthMap
from ..robot.rollouts.camera_flight import FreeSpace, camera_flights
from ..robot.rollouts.candidates import candidate_stream
from ..robot.rollouts.rollout import ROLLOUTS, Rollout
from ..robot.rollouts.rollouts import successful_rollouts
from ..splats.artifacts import ASSET, BACKDROP, REFINED_ASSET
from ..splats.asset import SplatAsset
from ..splats.asset_edits import ASSET_EDITS, AssetEdit, deleted_by
from ..splats.rendering.rasterizer import render
from ..views.allocation import allocate_views
from ..views.selection import SELECTION, SelectedViews
from .behaviour import DeclaredBehaviour
from .capture_steps import AlignedPriors, Captures, CaptureSteps, RegisteredCaptures
from .depths import completed_depths, proxy_depths, reliable_depths
from .view_effect import view_effect
from .visual_asset import PseudoView, settings_of_round, update_visual_asset

Views = Artifact[tuple[PseudoObservation, ...]]


@dataclass(frozen=True)
class Steps(CaptureSteps):
    """The procedures of Algorithm 1 on one scene, under the fixed configuration H.

    A step that has published ``until`` raises Reached; those of an ablation publish ``under`` a folder.
    """

    # ---- lines 6 to 13: every round

    def geometry_proxy(
        self,
        l: int,
        captures: RegisteredCaptures,
        observed: Artifact[ObservedGeometry],
        priors: AlignedPriors,
        asset: Artifact[SplatAsset],
    ) -> Artifact[GeometryProxy]:
        """M_scaf^l, Eq. 1: observed, prior and completed geometry fused with the asset's own.

        What a person cut away and drew comes last, so that every other face stays as it is.
        """

        def compose(
            captures: Captures,
            observed: ObservedGeometry,
            planes: RoomPlanes,
            completed: PerCapture[CompletedDepth],
            objects: Sequence[AlignedPrior],
            asset: SplatAsset,
            edits: Sequence[Edit] = (),
        ) -> GeometryProxy:
            depths = completed.of(captures)
            asset_depths = []
            for one in depths:
                rendering = render(asset, one.camera)
                asset_depths.append((one.camera, rendering.depth, rendering.alpha))
            proxy = compose_proxy(
                captures, depths, observed, planes.envelope, asset_depths, self.h.proxy, self.progress, objects
            )
            return edited(proxy, edits, depths)

        edits = [PROXY_EDITS] if self.runner.scene.read(PROXY_EDITS) else []
        return self._make(
            PROXY.of_round(l),
            compose,
            captures.photographs,
            observed,
            priors.planes,
            priors.completed,
            priors.objects,
            asset,
            *edits,
            settings=self.h.proxy,
        )

    def replace_collision_mesh(self, l: int, proxy: Artifact[GeometryProxy]) -> Artifact[Path]:
        """The simulator's collision surface, made of the current proxy."""

        def simplify(proxy: GeometryProxy) -> CollisionSurface:
            return collision_surface(proxy, self.h.collision, self.progress)

        return self._make(COLLISION.of_round(l), simplify, proxy, settings=self.h.collision)

    def successful_ego_poses(
        self,
        l: int,
        captures: RegisteredCaptures,
        priors: AlignedPriors,
        proxy: Artifact[GeometryProxy],
        collision: Artifact[Path],
        asset: Artifact[SplatAsset],
    ) -> Artifact[tuple[Rollout, ...]]:
        """V_0^l: rollouts resampled until enough succeed, every attempt kept with its reason.

        A scope that asks for the free floor gets the part of it that captures vouch for. A student sees the asset.
        Where a later round's collision surface leaves no floor, the rollouts of the round before stand for its own:
        what the robot reached there it still shows the asset.
        """
        behaviour = self._behaviour
        before = [ROLLOUTS.of_round(l - 1)] if l else []
        seats = [priors.objects] if behaviour.names_object else []
        seen = [asset] if behaviour.sees else []

        def roll_out(captures: Captures, proxy: GeometryProxy, collision: Path, *others: Any) -> tuple[Rollout, ...]:
            if self.h.selection.candidates == "flight":
                return self._flights(l, captures, proxy)
            earlier, others = others[: len(before)], others[len(before) :]
            placed = behaviour.placed(captures, proxy, others[0] if seats else ())
            sight = behaviour.sight(others[len(seats)]) if seen else None
            try:
                return successful_rollouts(
                    behaviour.model,
                    placed,
                    collision / "scene.xml",
                    self.h.rollouts,
                    self._seed_of(l),
                    self.progress,
                    sight,
                )
            except NoFloorError as error:
                if not earlier:
                    raise
                self.progress.message(f"{error} The rollouts of round {l - 1} stand for this round's.", "warning")
                return cast("tuple[Rollout, ...]", earlier[0])

        return self._make(
            ROLLOUTS.of_round(l),
            roll_out,
            captures.photographs,
            proxy,
            collision,
            *before,
            *seats,
            *seen,
            *(file_at(file) for file in behaviour.scope.files),
            settings=[
                self.h.rollouts,
                self.h.selection.candidates,
                self._seed_of(l),
                behaviour.robot,
                behaviour.scope,
                *behaviour.robot_file,
            ],
        )

    def robot_proxy(
        self,
        l: int,
        captures: RegisteredCaptures,
        priors: AlignedPriors,
        candidates: Artifact[tuple[Rollout, ...]],
        proxy: Artifact[GeometryProxy],
        asset: Artifact[SplatAsset],
    ) -> Artifact[SelectedViews]:
        """V^l, Eq. 2: deficit times availability, temporal NMS and Top-K, with every reason, and
        the targets' references i(v): line 9 is done here, for the best ranked alone.

        A candidate at which no frame could be registered to the captures, however good, is no target.
        """
        behaviour = self._behaviour

        def allocate(
            captures: Captures,
            depth: PerCapture[DepthMap],
            completed: PerCapture[CompletedDepth],
            rollouts: Sequence[Rollout],
            proxy: GeometryProxy,
            asset: SplatAsset,
        ) -> SelectedViews:
            stream = candidate_stream(rollouts, behaviour.scope.episode.max_turn_deg_s)
            eye = behaviour.ego_camera(captures)
            landmarks = Landmarks.build(
                captures,
                reliable_depths(captures, depth, self.h.stereo),
                completed_depths(captures, completed),
                self.progress,
            )
            selection = allocate_views(
                stream,
                eye,
                asset,
                proxy,
                [capture.camera for capture in captures],
                self.h.selection,
                [self._seed_of(l), 1],
                self.h.generation.max_replacements,
                self.progress,
                lambda view, reference: hopeless(view, reference, landmarks, self.h.registration),
            )
            return SelectedViews(selection, [eye.at(pose) for pose in stream.poses])

        return self._make(
            SELECTION.of_round(l),
            allocate,
            captures.photographs,
            captures.depth,
            priors.completed,
            candidates,
            proxy,
            asset,
            settings=[
                self.h.selection,
                self.h.stereo,
                self.h.registration,
                self._seed_of(l),
                self.h.generation.max_replacements,
                behaviour.robot,
                behaviour.scope.robot,
                behaviour.scope.episode,
                *behaviour.robot_file,
            ],
            fits=lambda selected, captures, *_: selected.require_captures(len(captures)),
        )

    def ego_video_reg(
        self,
        l: int,
        captures: RegisteredCaptures,
        priors: AlignedPriors,
        proxy: Artifact[GeometryProxy],
        targets: Artifact[SelectedViews],
    ) -> tuple[Views, ...]:
        """D_ego^l, Eq. 3: for each target a clip along the path from its reference i(v), whose
        last frame is kept and registered to the captures.

        What a person decided of a view holds for the one that shows the same now.
        """
        installed, registrar = installation_of(self.h), registrar_installation(self.h)

        def generate(
            folder: Path,
            captures: Captures,
            depth: PerCapture[DepthMap],
            completed: PerCapture[CompletedDepth],
            proxy: GeometryProxy,
            targets: SelectedViews,
        ) -> None:
            depths = proxy_depths(captures, proxy)
            observed = reliable_depths(captures, depth, self.h.stereo)
            renderer = make_renderer(proxy, self.h.generation)
            colours = PointConditions(captures, depths, self.h.generation)
            inputs = ClipInputs(captures, depths, observed, renderer, colours, self.h, folder)
            # Before the landmarks: a program that is not there is told at once.
            with (
                open_registrar(registrar, captures, self.h) as registering,
                open_generator(installed, inputs) as generator,
            ):
                landmarks = Landmarks.build(captures, observed, completed_depths(captures, completed), self.progress)
                ego_video_reg(
                    *targets.require_captures(len(captures)),
                    captures,
                    renderer,
                    generator,
                    landmarks,
                    self.h,
                    folder,
                    self.progress,
                    ClearSpace(proxy.vertices, proxy.faces),
                    colours,
                    registering,
                )
            for dropped in carry_decisions(self.runner.scene.path / views.name, folder):
                self.progress.message(f"round {l}, {dropped}", level="warning")

        views = VIEWS.of_round(l)
        self._make(
            views,
            generate,
            captures.photographs,
            captures.depth,
            priors.completed,
            proxy,
            targets,
            settings=[
                self.h.generation,
                self.h.registration,
                self.h.selection,
                self.h.seed,
                *([installed.identity] if installed.identity else []),
                *([{"registrar": registrar.identity}] if registrar.identity else []),
            ],
        )
        return (views,)

    def update_visual_asset(
        self,
        l: int,
        asset: Artifact[SplatAsset],
        captures: RegisteredCaptures,
        priors: AlignedPriors,
        proxy: Artifact[GeometryProxy],
        pseudo_observations: Sequence[Views],
    ) -> Artifact[SplatAsset]:
        """A^{l+1}: the asset refined on the captures and all pseudo-observations so far.

        The backdrop stands behind it in training and is kept apart: rounds look for what
        the asset itself cannot render.
        """
        training = settings_of_round(self.h.training, l)

        def update(
            asset: SplatAsset,
            backdrop: SplatAsset,
            captures: Captures,
            completed: PerCapture[CompletedDepth],
            proxy: GeometryProxy,
            *generated: Sequence[PseudoObservation],
        ) -> SplatAsset:
            renderer = ZBufferRenderer(proxy)
            # Where a ray leaves the proxy, the completed depth: every photographed pixel is of something.
            pairs = zip(proxy_depths(captures, proxy), completed_depths(captures, completed), strict=True)
            real = self._lifted(captures, (np.where(depth > 0.0, depth, whole) for depth, whole in pairs))
            synthetic = [self._pseudo_view(one, renderer) for views in generated for one in views]
            rng = np.random.default_rng([self.h.seed, 2, l])
            return update_visual_asset(asset, backdrop, real, synthetic, training, rng, self.progress)

        refined = self._make(
            ASSET.of_round(l),
            update,
            asset,
            priors.backdrop,
            captures.photographs,
            priors.completed,
            proxy,
            *pseudo_observations,
            settings=[training, self.h.seed],
        )
        if pseudo_observations:
            made_of = (ROLLOUTS.of_round(l), SELECTION.of_round(l), VIEWS.of_round(l))
            self._make(COUNTS.of_round(l), _count, asset, refined, priors.backdrop, *made_of)
        return refined

    # ---- line 14

    def publish_refined_scene(self, collision: Artifact[Path], asset: Artifact[SplatAsset]) -> None:
        """A*, before its backdrop, and the current collision surface, at the top of the bundle."""

        def copy(folder: Path, collision: Path) -> None:
            shutil.copytree(collision, folder, dirs_exist_ok=True)

        self.publish_asset(asset)
        self._make(REFINED_COLLISION, copy, collision)

    def publish_asset(self, asset: Artifact[SplatAsset]) -> None:
        """A* before its backdrop, without what a person deleted."""

        def compose(refined: SplatAsset, backdrop: SplatAsset, edits: Sequence[AssetEdit]) -> SplatAsset:
            whole = refined.concatenated(backdrop.with_degree(refined.degree))
            return whole.subset(~deleted_by(edits, whole.means))

        self._make(REFINED_ASSET, compose, asset, BACKDROP, ASSET_EDITS)

    @cached_property
    def _behaviour(self) -> DeclaredBehaviour:
        return DeclaredBehaviour.of(self.runner.scene)

    def _pseudo_view(self, observation: PseudoObservation, renderer: ZBufferRenderer) -> PseudoView:
        depth = renderer.depth(observation.camera)
        return PseudoView(self._depth_view(observation.camera, depth, observation.image), observation.confidence)

    def _flights(self, l: int, captures: Captures, proxy: GeometryProxy) -> tuple[Rollout, ...]:
        """As many free flights above the scope's region as there would be rollouts."""
        scope, outline = self._behaviour.scope, np.array(self._behaviour.outline(captures, proxy))
        places = np.array([capture.camera.centre for capture in captures])
        space = FreeSpace(proxy.vertices, proxy.faces, outline, places)
        return camera_flights(space, scope, self.h.rollouts.successes, self._seed_of(l))

    def _seed_of(self, l: int) -> int:
        """A seed of its own for each round, so that initial conditions are resampled."""
        return self.h.seed * 1000 + l


def _count(
    before: SplatAsset,
    asset: SplatAsset,
    backdrop: SplatAsset,
    rollouts: Sequence[Rollout],
    selected: SelectedViews,
    views: Sequence[PseudoObservation],
) -> dict[str, Any]:
    selection = selected.selection
    return {
        "rollouts_succeeded": sum(rollout.success for rollout in rollouts),
        "rollouts_failed": sum(not rollout.success for rollout in rollouts),
        "candidates": len(selection.score),
        "targets": len(selection.targets),
        "views_kept": len(views),
        "mean_deficit": round(float(selection.deficit.mean()), 6),
        "mean_availability": round(float(selection.availability.mean()), 6),
        "gaussians": len(asset),
        "views": [view_effect(view, before, asset, backdrop).to_json() for view in views],
    }
