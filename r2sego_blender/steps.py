"""The procedures of Algorithm 1 as steps of the scene bundle.

Each method reads named files of the bundle and publishes one, whose name it returns;
``pipeline.refine`` calls them in the paper's order. A step whose inputs and settings have
not changed is passed over.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .allocation import allocate_views
from .asset_edits import EDITS, deleted_by, load_edits
from .cameras import Camera
from .captures.sparse import depth_ranges
from .contents import Contents, names_object
from .generation.carried_decisions import carry_decisions
from .generation.conditions import ZBufferRenderer
from .generation.detours import ClearSpace
from .generation.ego_views import (
    PseudoObservation,
    check_views,
    ego_video_reg,
    load_pseudo_observations,
)
from .generation.generators import open_generator
from .generation.point_condition import PointConditions
from .generation.registration import Landmarks
from .generation.renderers import make_renderer
from .geometry.bounds import with_missing_bounds
from .geometry.collision import collision_surface
from .geometry.collision_files import write_collision
from .geometry.completion import complete_depth
from .geometry.edited_proxy import edited
from .geometry.edits import PROXY_EDITS, load_proxy_edits
from .geometry.fusion import compose_proxy
from .geometry.objects import load_objects
from .geometry.observed import observe
from .geometry.planes import find_planes
from .geometry.priors import align_objects, load_library, load_priors, read_record, save_priors
from .geometry.stereo import dense_stereo
from .layout import (
    BACKDROP,
    CAPTURES,
    COLLISION,
    COMPLETED,
    DEPTH,
    INITIAL_ASSET,
    OBJECTS,
    OBSERVED,
    PLANES,
    PRIORS,
    REFINED_ASSET,
    of_round,
)
from .progress import Progress
from .robot.attempts import Rollout
from .robot.camera_flight import FreeSpace, camera_flights
from .robot.candidates import candidate_stream
from .robot.rollouts import load_rollouts, save_rollouts, successful_rollouts
from .scene import Scene
from .selection import Selection, save_candidates
from .settings import Settings
from .splats.backdrop import backdrop
from .splats.initialization import DepthView, merge_views
from .splats.ply import save_ply
from .splats.rasterizer import render
from .text_files import write_json
from .visual_asset import PseudoView, disc_stride_px, settings_of_round, update_visual_asset


class Reached(Exception):  # noqa: N818  (the end of the way, no error)
    """What the steps were to go on to is published."""


@dataclass(frozen=True)
class Steps:
    """The procedures of Algorithm 1 on one scene, under the fixed configuration H.

    A step that has published ``until`` raises Reached.
    """

    scene: Scene
    h: Settings
    progress: Progress
    until: str = ""

    # ---- lines 1 to 3: once

    def register_inputs(self) -> tuple[str, str]:
        """The captures in the world frame, and A_0: their dense stereo lifted to splats.

        Where several captures see a surface, the one that sees it finest gives the splat.
        """

        def compute_depth(folder: Path) -> None:
            sparse = self._read.sparse()
            maps = dense_stereo(
                self._read.captures, depth_ranges(self._read.captures, sparse), sparse.points, self.h.stereo,
                self.h.seed, self.progress, visibility=sparse.visibility,
            )  # fmt: skip
            for file, depth_map in zip(self._read.capture_files, maps, strict=True):
                depth_map.save(folder / file)

        def compute_asset(file: Path) -> None:
            save_ply(file, merge_views(self._lifted(self._read.reliable_depths())))

        self._step(
            DEPTH, compute_depth, inputs=[CAPTURES], parameters=[self.h.stereo, self.h.seed],
            read=self._read.depth_maps,
        )  # fmt: skip
        asset = self._step(
            INITIAL_ASSET, compute_asset, inputs=[CAPTURES, DEPTH],
            parameters=[self.h.stereo, self._stride_px, self.h.training.detailed_share],
            read=lambda: self._read.asset(INITIAL_ASSET),
        )  # fmt: skip
        return CAPTURES, asset

    def observed_and_prior_geometry(self, captures: str) -> tuple[str, str]:
        """M_obs with its support record, and the embedded shape prior: the room's own planes."""

        def compute_observed(file: Path) -> None:
            sparse = self._read.sparse()
            observe(self._read.captures, self._read.depth_maps(), sparse, self.h.stereo).save(file)

        def compute_planes(file: Path) -> None:
            rng = np.random.default_rng([self.h.seed, 0])
            observed = self._read.observed()
            found = find_planes(observed, self._read.cameras, self.h.proxy, rng)
            maps = self._read.depth_maps()
            with_missing_bounds(found, self._read.captures, maps, observed, self.h).save(file)

        observed = self._step(
            OBSERVED, compute_observed, inputs=[captures, DEPTH], parameters=self.h.stereo,
            read=self._read.observed,
        )  # fmt: skip
        planes = self._step(
            PLANES, compute_planes, inputs=[captures, DEPTH, observed],
            parameters=[self.h.stereo, self.h.proxy, self.h.seed], read=self._read.planes,
        )  # fmt: skip
        return observed, planes

    def align_priors(self, observed: str, priors: str) -> str:
        """Priors placed in the world and carried into the captures.

        Room planes are born in the world frame, so their T_m* is the identity; what is
        solved for them, once, is which pixels of the captures each plane completes, and with
        them the backdrop: what stands behind the asset where no photograph shows anything.
        The declared objects' shapes are retrieved and aligned beside them.
        """

        def compute(folder: Path) -> None:
            maps, planes = self._read.depth_maps(), self._read.planes()
            completed = complete_depth(self._read.captures, maps, planes, self.h, self.progress)
            for file, one in zip(self._read.capture_files, completed, strict=True):
                one.save(folder / file)

        def compute_backdrop(file: Path) -> None:
            views = self._lifted(self._read.completed_depths())
            save_ply(file, backdrop(views, self.h.training.backdrop_gaussians))

        library = [Path(folder) for folder in [self.scene.declaration.mesh_library] if folder]

        def compute_objects(folder: Path) -> None:
            objects = load_objects(self.scene.path / OBJECTS, self._read.captures)
            if not objects:  # depth maps and meshes need not be read
                save_priors(folder, ())
                return
            shapes = [shape for place in library for shape in load_library(place, self.progress)]
            aligned = align_objects(
                objects, shapes, self._read.captures, self._read.observed(), self._read.reliable_depths(),
                self._read.completed_depths(), self._read.planes().envelope, self.h.priors, self.progress,
            )  # fmt: skip
            for one in aligned:
                if one.refusal:
                    self.progress.message(f"{one.name}: no prior, {one.refusal}", "warning")
            save_priors(folder, aligned)

        completed = self._step(
            COMPLETED, compute, inputs=[CAPTURES, DEPTH, observed, priors],
            parameters=[self.h.stereo, self.h.proxy], read=self._read.completed,
        )  # fmt: skip
        self._step(
            BACKDROP, compute_backdrop, inputs=[CAPTURES, completed],
            parameters=self.h.training.backdrop_gaussians, read=lambda: self._read.asset(BACKDROP),
        )  # fmt: skip
        self._step(
            PRIORS, compute_objects,
            inputs=[CAPTURES, DEPTH, observed, priors, completed, OBJECTS, *library],
            parameters=[self.h.priors, self.h.stereo], read=self._read_priors,
        )  # fmt: skip
        return completed

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
            with open_generator(
                self._read.captures, depths, observed, renderer, colours, self.h, folder
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

    # ---- what several steps have in common

    @cached_property
    def _read(self) -> Contents:
        return Contents(self.scene, self.h)

    @cached_property
    def _stride_px(self) -> int:
        return disc_stride_px(self._read.cameras, self.h.training)

    def _lifted(self, depths: Iterable[np.ndarray]) -> list[DepthView]:
        """The captures with a depth (H, W) in metres each, to be lifted to splats."""
        return [
            self._depth_view(capture.camera, depth, capture.image())
            for capture, depth in zip(self._read.captures, depths, strict=True)
        ]

    def _pseudo_view(self, observation: PseudoObservation, renderer: ZBufferRenderer) -> PseudoView:
        depth = renderer.depth(observation.camera)
        return PseudoView(
            self._depth_view(observation.camera, depth, observation.image), observation.confidence
        )

    def _depth_view(self, camera: Camera, depth: np.ndarray, image: np.ndarray) -> DepthView:
        share = self.h.training.detailed_share
        return DepthView(camera, depth, image, self._stride_px, detailed_share=share)

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

    def _read_priors(self) -> None:
        accepted = {prior.name for prior in load_priors(self.scene.path / PRIORS)}
        for record in read_record(self.scene.path / PRIORS):
            if not record["refusal"] and record["name"] not in accepted:
                raise FileNotFoundError(record["name"])

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

    def _step(
        self,
        target: str,
        compute: Callable[[Path], None],
        *,
        inputs: Sequence[str | Path],
        parameters: Any = None,
        read: Callable[[], object] | None = None,
    ) -> str:
        self.scene.step(target, compute, inputs=inputs, parameters=parameters, read=read)
        if target == self.until:
            raise Reached
        return target
