"""Lines 1 to 3 of Algorithm 1 as steps of the scene bundle: what is made of the captures, once.

With what all its steps have in common.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle.layout import (
    BACKDROP,
    CAPTURES,
    COMPLETED,
    DEPTH,
    INITIAL_ASSET,
    OBJECTS,
    OBSERVED,
    PLANES,
    PRIORS,
)
from ..bundle.scene import Scene
from ..captures.sparse import depth_ranges
from ..config.settings import Settings
from ..core.cameras import Camera
from ..core.progress import Progress
from ..geometry.objects.objects import load_objects
from ..geometry.objects.priors import align_objects, load_library, load_priors, read_record, save_priors
from ..geometry.room.bounds import with_missing_bounds
from ..geometry.room.completion import complete_depth
from ..geometry.room.planes import find_planes
from ..geometry.stereo.observed import observe
from ..geometry.stereo.stereo import dense_stereo
from ..splats.formats.ply import save_ply
from ..splats.training.backdrop import backdrop
from ..splats.training.initialization import DepthView, merge_views
from .contents import Contents
from .visual_asset import disc_stride_px


class Reached(Exception):  # noqa: N818  (the end of the way, no error)
    """What the steps were to go on to is published."""


@dataclass(frozen=True)
class CaptureSteps:
    """The procedures before the rounds on one scene, under the fixed configuration H.

    A step that has published ``until`` raises Reached.
    """

    scene: Scene
    h: Settings
    progress: Progress
    until: str = ""

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

    def _read_priors(self) -> None:
        accepted = {prior.name for prior in load_priors(self.scene.path / PRIORS)}
        for record in read_record(self.scene.path / PRIORS):
            if not record["refusal"] and record["name"] not in accepted:
                raise FileNotFoundError(record["name"])

    # ---- what all steps have in common

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

    def _depth_view(self, camera: Camera, depth: np.ndarray, image: np.ndarray) -> DepthView:
        share = self.h.training.detailed_share
        return DepthView(camera, depth, image, self._stride_px, detailed_share=share)

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
