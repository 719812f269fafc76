"""The procedures of Algorithm 1 as steps of the scene bundle.

Each method reads named files of the bundle and publishes one, whose name it returns;
``pipeline.refine`` calls them in the paper's order. A step whose inputs and settings have
not changed is passed over. Those of lines 1 to 3 stand in ``capture_steps.py``.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..bundle.layout import (
    BACKDROP,
    CAPTURES,
    COLLISION,
    COMPLETED,
    DEPTH,
    PLANES,
    PRIORS,
    REFINED_ASSET,
    of_round,
)
from ..core.text_files import write_json
from ..generation.carried_decisions import carry_decisions
from ..generation.conditions.conditions import ZBufferRenderer
from ..generation.conditions.point_condition import PointConditions
from ..generation.conditions.renderers import make_renderer
from ..generation.ego_views import (
    PseudoObservation,
    check_views,
    ego_video_reg,
    load_pseudo_observations,
)
from ..generation.generators.registry import installation_of, open_generator
from ..generation.generators.slot import ClipInputs
from ..generation.paths.detours import ClearSpace
from ..generation.registration.frame_registration import Landmarks
from ..geometry.collision.collision import collision_surface
from ..geometry.collision.collision_files import write_collision
from ..geometry.objects.priors import load_priors
from ..geometry.proxy.edited_proxy import edited
from ..geometry.proxy.edits import PROXY_EDITS, load_proxy_edits
from ..geometry.proxy.fusion import compose_proxy
from ..robot.rollouts.attempts import Rollout
from ..robot.rollouts.camera_flight import FreeSpace, camera_flights
from ..robot.rollouts.candidates import candidate_stream
from ..robot.rollouts.rollouts import load_rollouts, save_rollouts, successful_rollouts
from ..splats.asset_edits import EDITS, deleted_by, load_edits
from ..splats.formats.ply import save_ply
from ..splats.rendering.rasterizer import render
from ..views.allocation import allocate_views
from ..views.selection import Selection, save_candidates
from .capture_steps import CaptureSteps
from .contents import names_object
from .visual_asset import PseudoView, settings_of_round, update_visual_asset


@dataclass(frozen=True)
class Steps(CaptureSteps):
    """The procedures of Algorithm 1 on one scene, under the fixed configuration H.

    A step that has published ``until`` raises Reached.
    """

    # ---- lines 6 to 13: every round

    def geometry_proxy(self, l: int, captures: str, observed: str, aligned_priors: str, asset: str) -> str:
        """M_scaf^l, Eq. 1: observed, prior and completed geometry fused with the asset's own.

        What a person cut away and drew comes last, so that every other face stays as it is.
        """
        edits = load_proxy_edits(self.scene.path / PROXY_EDITS)

        def compute(folder: Path) -> None:
            current = self._read.asset(asset)
            completed = self._read.completed()
            asset_depths = []
            for one in completed:
                rendering = render(current, one.camera)
                asset_depths.append((one.camera, rendering.depth, rendering.alpha))
            envelope = self._read.planes().envelope
            proxy = compose_proxy(
                self._read.captures, completed, self._read.observed(), envelope, asset_depths,
                self.h.proxy, self.progress, load_priors(self.scene.path / PRIORS),
            )  # fmt: skip
            proxy = edited(proxy, edits, completed)
            proxy.save(folder / "proxy.npz")
            proxy.save_ply(folder / "proxy.ply")

        return self._step(
            of_round(l, "proxy"), compute,
            inputs=[
                captures, observed, PLANES, aligned_priors, PRIORS, asset, *([PROXY_EDITS] if edits else []),
            ],
            parameters=self.h.proxy, read=lambda: self._read.proxy(of_round(l, "proxy")),
        )  # fmt: skip

    def replace_collision_mesh(self, l: int, proxy: str) -> str:
        """The simulator's collision surface, made of the current proxy."""

        def compute(folder: Path) -> None:
            surface = collision_surface(self._read.proxy(proxy), self.h.collision, self.progress)
            write_collision(surface, folder)

        return self._step(of_round(l, "collision"), compute, inputs=[proxy], parameters=self.h.collision)

    def successful_ego_poses(self, l: int, proxy: str, collision: str) -> str:
        """V_0^l: rollouts resampled until enough succeed, every attempt kept with its reason.

        A scope that asks for the free floor gets the part of it that captures vouch for.
        """
        scope, declared = self._read.scope, self.scene.declaration.robot

        def compute(folder: Path) -> None:
            if self.h.selection.candidates == "flight":
                save_rollouts(folder, self._flights(l, proxy))
                return
            placed, surface = self._read.placed_scope(scope, proxy), self.scene.path / collision / "scene.xml"
            rollouts = successful_rollouts(
                self._read.robot, placed, surface, self.h.rollouts, self._seed_of(l), self.progress
            )
            save_rollouts(folder, rollouts)

        objects = [PRIORS] if names_object(scope) else []
        return self._step(
            of_round(l, "rollouts"), compute,
            inputs=[CAPTURES, proxy, collision, *objects, *scope.files],
            parameters=[
                self.h.rollouts, self.h.selection.candidates, self._seed_of(l), declared, scope,
                *self._read.robot_file,
            ],
            read=lambda: load_rollouts(self.scene.path / of_round(l, "rollouts")),
        )  # fmt: skip

    def robot_proxy(self, l: int, candidates: str, proxy: str, asset: str) -> str:
        """V^l, Eq. 2: deficit times availability, temporal NMS and Top-K, with every reason, and
        the targets' references i(v): line 9 is done here, for the best ranked alone."""

        def compute(folder: Path) -> None:
            stream = candidate_stream(
                load_rollouts(self.scene.path / candidates), self._read.scope.episode.max_turn_deg_s
            )
            selection = allocate_views(
                stream, self._read.ego_camera, self._read.asset(asset), self._read.proxy(proxy),
                self._read.cameras, self.h.selection, [self._seed_of(l), 1],
                self.h.generation.max_replacements, self.progress,
            )  # fmt: skip
            selection.save(folder)
            save_candidates(folder, [self._read.ego_camera.at(pose) for pose in stream.poses])

        return self._step(
            of_round(l, "selection"), compute, inputs=[CAPTURES, candidates, proxy, asset],
            parameters=[
                self.h.selection, self._seed_of(l), self.h.generation.max_replacements,
                self.scene.declaration.robot, self._read.scope.robot, self._read.scope.episode,
                *self._read.robot_file,
            ],
            read=lambda: self._read.selection(of_round(l, "selection")),
        )  # fmt: skip

    def ego_video_reg(self, l: int, captures: str, proxy: str, targets: str) -> tuple[str, ...]:
        """D_ego^l, Eq. 3: for each target a clip along the path from its reference i(v), whose
        last frame is kept and registered to the captures.

        What a person decided of a view holds for the one that shows the same now.
        """

        def compute(folder: Path) -> None:
            current = self._read.proxy(proxy)
            depths = self._read.proxy_depths(current)
            observed = self._read.reliable_depths()
            completed = self._read.completed_depths()
            renderer = make_renderer(current, self.h.generation)
            colours = PointConditions(self._read.captures, depths, self.h.generation)
            inputs = ClipInputs(self._read.captures, depths, observed, renderer, colours, self.h, folder)
            with open_generator(
                installation_of(self.h), inputs
            ) as generator:  # before the landmarks: a program that is not there is told at once
                landmarks = Landmarks.build(self._read.captures, observed, completed, self.progress)
                ego_video_reg(
                    *self._read.selection(targets), self._read.captures, renderer, generator, landmarks,
                    self.h, folder, self.progress, ClearSpace(current.vertices, current.faces), colours,
                )  # fmt: skip
            for dropped in carry_decisions(self.scene.path / of_round(l, "views"), folder):
                self.progress.message(f"round {l}, {dropped}", level="warning")

        views = self._step(
            of_round(l, "views"), compute, inputs=[captures, DEPTH, COMPLETED, proxy, targets],
            parameters=[self.h.generation, self.h.registration, self.h.selection, self.h.seed],
            read=lambda: check_views(self.scene.path / of_round(l, "views")),
        )  # fmt: skip
        return (views,)

    def update_visual_asset(
        self, l: int, asset: str, captures: str, proxy: str, pseudo_observations: Sequence[str]
    ) -> str:
        """A^{l+1}: the asset refined on the captures and all pseudo-observations so far.

        The backdrop stands behind it in training and is kept apart: rounds look for what
        the asset itself cannot render.
        """
        training = settings_of_round(self.h.training, l)

        def compute(file: Path) -> None:
            surface = self._read.proxy(proxy)
            renderer = ZBufferRenderer(surface)
            # Where a ray leaves the proxy, the completed depth: every photographed pixel is of something.
            real = self._lifted(
                np.where(depth > 0.0, depth, completed)
                for depth, completed in zip(
                    self._read.proxy_depths(surface), self._read.completed_depths(), strict=True
                )
            )
            observations = [
                observation
                for views in pseudo_observations
                for observation in load_pseudo_observations(self.scene.path / views)
            ]
            synthetic = [self._pseudo_view(observation, renderer) for observation in observations]
            rng = np.random.default_rng([self.h.seed, 2, l])
            save_ply(
                file,
                update_visual_asset(
                    self._read.asset(asset), self._read.asset(BACKDROP), real, synthetic,
                    training, rng, self.progress,
                ),
            )  # fmt: skip

        refined = self._step(
            of_round(l, "asset.ply"), compute,
            inputs=[asset, BACKDROP, captures, COMPLETED, proxy, *pseudo_observations],
            parameters=[training, self.h.seed], read=lambda: self._read.asset(of_round(l, "asset.ply")),
        )  # fmt: skip
        self._step(
            of_round(l, "metrics.json"), lambda file: self._count(l, file),
            inputs=[refined, *(of_round(l, part) for part in ("rollouts", "selection", "views"))],
        )  # fmt: skip
        return refined

    # ---- line 14

    def publish_refined_scene(self, collision: str, asset: str) -> None:
        """A*, before its backdrop, and the current collision surface, at the top of the bundle."""

        def copy(folder: Path) -> None:
            shutil.copytree(self.scene.path / collision, folder, dirs_exist_ok=True)

        self.publish_asset(asset)
        self._step(COLLISION, copy, inputs=[collision])

    def publish_asset(self, asset: str) -> None:
        """A* before its backdrop, without what a person deleted."""

        def compose(file: Path) -> None:
            refined = self._read.asset(asset)
            whole = refined.concatenated(self._read.asset(BACKDROP).with_degree(refined.degree))
            save_ply(file, whole.subset(~deleted_by(load_edits(self.scene.path), whole.means)))

        self._step(REFINED_ASSET, compose, inputs=[asset, BACKDROP, EDITS])

    def _pseudo_view(self, observation: PseudoObservation, renderer: ZBufferRenderer) -> PseudoView:
        depth = renderer.depth(observation.camera)
        return PseudoView(
            self._depth_view(observation.camera, depth, observation.image), observation.confidence
        )

    def _flights(self, l: int, proxy: str) -> tuple[Rollout, ...]:
        """As many free flights above the scope's region as there would be rollouts."""
        scope, surface = self._read.scope, self._read.proxy(proxy)
        outline = np.array(self._read.outline(scope, proxy))
        places = np.array([capture.camera.centre for capture in self._read.captures])
        space = FreeSpace(surface.vertices, surface.faces, outline, places)
        return camera_flights(space, scope, self.h.rollouts.successes, self._seed_of(l))

    def _seed_of(self, l: int) -> int:
        """A seed of its own for each round, so that initial conditions are resampled."""
        return self.h.seed * 1000 + l

    def _count(self, l: int, file: Path) -> None:
        rollouts = load_rollouts(self.scene.path / of_round(l, "rollouts"))
        selection = Selection.load(self.scene.path / of_round(l, "selection"))
        views = load_pseudo_observations(self.scene.path / of_round(l, "views"))
        counts = {
            "rollouts_succeeded": sum(rollout.success for rollout in rollouts),
            "rollouts_failed": sum(not rollout.success for rollout in rollouts),
            "candidates": len(selection.score),
            "targets": len(selection.targets),
            "views_kept": len(views),
            "mean_deficit": round(float(selection.deficit.mean()), 6),
            "mean_availability": round(float(selection.availability.mean()), 6),
            "gaussians": len(self._read.asset(of_round(l, "asset.ply"))),
        }
        write_json(file, counts)
