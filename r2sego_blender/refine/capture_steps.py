"""Lines 1 to 3 of Algorithm 1 as steps of the scene bundle: what is made of the captures, once.

With what all its steps have in common.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..bundle.artifacts import Artifact, Held, file_at
from ..bundle.runner import Runner
from ..captures.capture import Capture
from ..captures.per_capture import PerCapture, by_file
from ..captures.sensors.sensor_maps import SENSOR_DEPTH, SensorMap
from ..captures.sparse import depth_ranges
from ..captures.sparse_points import SPARSE, SparsePoints
from ..captures.store import CAPTURES
from ..config.settings import Settings
from ..core.cameras import Camera
from ..core.errors import R2SEgoError
from ..core.progress import Progress
from ..geometry.estimators.aligned_depth import ESTIMATED, AlignedDepth
from ..geometry.estimators.aligning import CARRIED, align_estimates
from ..geometry.estimators.estimated_depth import ESTIMATES, EstimatedDepth
from ..geometry.estimators.estimated_points import spread_m, with_estimates
from ..geometry.layout.layout_depth import with_layout
from ..geometry.objects.objects import OBJECTS, ObjectsFolder
from ..geometry.objects.prior_files import PRIORS, AlignedPrior, ObjectPrior
from ..geometry.objects.priors import align_objects, load_library
from ..geometry.objects.shapes import require_library
from ..geometry.room.bounds import with_missing_bounds
from ..geometry.room.completed_depth import COMPLETED, CompletedDepth
from ..geometry.room.completion import complete_depth, trusted_depth
from ..geometry.room.planes import PLANES, RoomPlanes, find_planes
from ..geometry.stereo.measured_depth import with_sensor
from ..geometry.stereo.observed import observe, require_observed
from ..geometry.stereo.observed_geometry import OBSERVED, ObservedGeometry
from ..geometry.stereo.stereo import DEPTH, DepthMap, dense_stereo
from ..splats.artifacts import BACKDROP, INITIAL_ASSET
from ..splats.asset import SplatAsset
from ..splats.training.backdrop import backdrop
from ..splats.training.initialization import DepthView, merge_views
from .depths import carried_depths, completed_depths, reliable_depths
from .visual_asset import disc_stride_px

Captures = Sequence[Capture]


class Reached(Exception):  # noqa: N818  (the end of the way, no error)
    """What the steps were to go on to is published."""


class RegisteredCaptures(NamedTuple):
    """C: photographs with their cameras in the world frame, their sparse points, their dense stereo."""

    photographs: Artifact[tuple[Capture, ...]] = CAPTURES
    sparse: Artifact[SparsePoints] = SPARSE
    depth: Artifact[PerCapture[DepthMap]] = DEPTH


class AlignedPriors(NamedTuple):
    """What is prior to the rounds: the room's planes, the captures' depth completed by them, the backdrop
    that this leaves behind everything, and the shapes of declared objects."""

    planes: Artifact[RoomPlanes] = PLANES
    completed: Artifact[PerCapture[CompletedDepth]] = COMPLETED
    backdrop: Artifact[SplatAsset] = BACKDROP
    objects: Artifact[tuple[AlignedPrior, ...]] = PRIORS


@dataclass(frozen=True)
class CaptureSteps:
    """The procedures before the rounds on one scene, under the fixed configuration H.

    A step that has published ``until`` raises Reached. Steps publish at the bundle's top, those of an
    ablation ``under`` a folder of it.
    """

    runner: Runner
    h: Settings
    progress: Progress
    until: str = ""
    under: str = ""

    def register_inputs(self) -> tuple[RegisteredCaptures, Artifact[SplatAsset]]:
        """The captures in the world frame, and A_0: their dense stereo, and what a depth sensor
        measured, lifted to splats.

        Where several captures see a surface, the one that sees it finest gives the splat.
        """

        def stereo(captures: Captures, sparse: SparsePoints, *sensor: PerCapture[SensorMap]) -> dict[str, DepthMap]:
            maps = dense_stereo(
                captures,
                depth_ranges(captures, sparse),
                sparse.points,
                self.h.stereo,
                self.h.seed,
                self.progress,
                visibility=sparse.visibility,
            )
            for measured in sensor:
                found = [measured.found(captures, index) for index in range(len(captures))]
                maps = with_sensor(maps, captures, found, self.h.stereo)
            return by_file(captures, maps)

        def lift(captures: Captures, depth: PerCapture[DepthMap], *estimated: PerCapture[AlignedDepth]) -> SplatAsset:
            depths = reliable_depths(captures, depth, self.h.stereo)
            for maps in estimated:
                depths = carried_depths(captures, depths, maps, self._carried(captures, depth))
            return merge_views(self._lifted(captures, depths))

        sensor = [SENSOR_DEPTH] if (self.runner.scene.path / SENSOR_DEPTH.name).is_dir() else []
        depth = self._make(
            DEPTH,
            stereo,
            CAPTURES,
            SPARSE,
            *sensor,
            settings=[self.h.stereo, self.h.seed],
            fits=lambda maps, captures, *_: maps.of(captures),
        )
        asset = self._make(
            INITIAL_ASSET,
            lift,
            CAPTURES,
            depth,
            *self._carrying,
            settings=[self.h.stereo, self._stride_px, self.h.training.detailed_share],
        )
        return RegisteredCaptures(CAPTURES, SPARSE, depth), asset

    def observed_and_prior_geometry(
        self, captures: RegisteredCaptures
    ) -> tuple[Artifact[ObservedGeometry], Artifact[RoomPlanes]]:
        """M_obs with its support record, and the embedded shape prior: the room's own planes."""

        def fuse(
            captures: Captures, sparse: SparsePoints, depth: PerCapture[DepthMap], *estimated: PerCapture[AlignedDepth]
        ) -> ObservedGeometry:
            observed = observe(captures, depth.of(captures), sparse, self.h.stereo)
            for maps in estimated:
                by = self._carried(captures, depth)
                observed = with_estimates(observed, captures, maps.of(captures), by, self.h.stereo.point_spacing_m)
            require_observed(observed)
            return observed

        def find(
            captures: Captures,
            depth: PerCapture[DepthMap],
            observed: ObservedGeometry,
            *estimated: PerCapture[AlignedDepth],
        ) -> RoomPlanes:
            rng = np.random.default_rng([self.h.seed, 0])
            cameras = [capture.camera for capture in captures]
            off_m = [spread_m(observed, maps.of(captures), self._carried(captures, depth)) for maps in estimated]
            found = find_planes(observed, cameras, self.h.proxy, rng, *off_m)
            return with_missing_bounds(found, captures, depth.of(captures), observed, self.h)

        estimated = self._carrying
        observed = self._make(OBSERVED, fuse, *captures, *estimated, settings=self.h.stereo)
        planes = self._make(
            PLANES,
            find,
            captures.photographs,
            captures.depth,
            observed,
            *estimated,
            settings=[self.h.stereo, self.h.proxy, self.h.seed],
        )
        return observed, planes

    def align_priors(
        self, captures: RegisteredCaptures, observed: Artifact[ObservedGeometry], planes: Artifact[RoomPlanes]
    ) -> AlignedPriors:
        """Priors placed in the world and carried into the captures.

        Room planes are born in the world frame, so their T_m* is the identity; what is
        solved for them, once, is which pixels of the captures each plane completes, and with
        them the backdrop: what stands behind the asset where no photograph shows anything.
        The declared objects' shapes are retrieved and aligned beside them.
        """

        def complete(
            captures: Captures,
            sparse: SparsePoints,
            depth: PerCapture[DepthMap],
            planes: RoomPlanes,
            *estimated: PerCapture[AlignedDepth],
        ) -> dict[str, CompletedDepth]:
            estimates = [one for each in estimated for one in each.of(captures)]
            found = complete_depth(captures, depth.of(captures), planes, self.h, self.progress, estimates, sparse)
            return by_file(captures, found)

        def behind(captures: Captures, completed: PerCapture[CompletedDepth]) -> SplatAsset:
            views = self._lifted(captures, completed_depths(captures, completed))
            return backdrop(views, self.h.training.backdrop_gaussians)

        photographs, points, depth = captures
        completed = self._make(
            COMPLETED,
            complete,
            photographs,
            points,
            depth,
            planes,
            *self._estimated,
            settings=[self.h.stereo, self.h.proxy],
            fits=lambda maps, captures, *_: maps.of(captures),
            also=[observed.key],
        )
        background = self._make(BACKDROP, behind, photographs, completed, settings=self.h.training.backdrop_gaussians)
        declared = (self.runner.scene.path / OBJECTS.name).is_dir()  # else nobody looks for a shape
        library = [file_at(folder) for folder in [self.runner.scene.declaration.mesh_library] if folder and declared]
        for folder in library:
            require_library(Path(folder.name))
        objects = self._make(
            PRIORS,
            self._aligned,
            photographs,
            depth,
            observed,
            planes,
            completed,
            OBJECTS,
            *library,
            settings=[self.h.priors, self.h.stereo],
        )
        return AlignedPriors(planes, completed, background, objects)

    def _aligned(
        self,
        captures: Captures,
        depth: PerCapture[DepthMap],
        observed: ObservedGeometry,
        planes: RoomPlanes,
        completed: PerCapture[CompletedDepth],
        declared: ObjectsFolder,
        *library: Path,
    ) -> tuple[ObjectPrior, ...]:
        objects = declared.of(captures)
        if not objects:  # depth maps and meshes need not be read
            return ()
        shapes = [shape for folder in library for shape in load_library(folder, self.progress)]
        aligned = align_objects(
            objects,
            shapes,
            captures,
            observed,
            reliable_depths(captures, depth, self.h.stereo),
            completed_depths(captures, completed),
            planes.envelope,
            self.h.priors,
            self.progress,
        )
        for one in aligned:
            if one.refusal:
                self.progress.message(f"{one.name}: no prior, {one.refusal}", "warning")
        return aligned

    @cached_property
    def _estimated(self) -> list[Artifact[PerCapture[AlignedDepth]]]:
        """The depth in the world's metres that the bundle's estimator gives, and the room's layout where hardly
        anything is known; nothing where there is neither."""
        recorded = [ESTIMATES] if (self.runner.scene.path / ESTIMATES.name).is_dir() else []

        def align(
            captures: Captures,
            sparse: SparsePoints,
            depth: PerCapture[DepthMap],
            *estimates: PerCapture[EstimatedDepth],
        ) -> dict[str, AlignedDepth]:
            trusted = trusted_depth(depth.of(captures), self.h.stereo)
            found = [[maps.found(captures, index) for index in range(len(captures))] for maps in estimates]
            aligned = align_estimates(
                captures, sparse, trusted, found[0] if found else [None] * len(captures), self.progress
            )
            if self._needs_layout(self._known_of(depth.of(captures))):
                aligned = with_layout(aligned, self._carried(captures, depth), captures, trusted, self.progress)
            return by_file(captures, aligned)

        if not recorded and not self._needs_layout(self._known):
            return []
        estimated = self._make(
            ESTIMATED,
            align,
            *RegisteredCaptures(),
            *recorded,
            settings=self.h.stereo if self.h.proxy.layout == "auto" else [self.h.stereo, self.h.proxy.layout],
            fits=lambda maps, captures, *_: maps.of(captures),
        )
        return [estimated]

    @property
    def _carrying(self) -> list[Artifact[PerCapture[AlignedDepth]]]:
        """The estimated depth where it carries a capture, else nothing."""
        return self._estimated if (self._known < CARRIED).any() else []

    def _needs_layout(self, known: np.ndarray) -> bool:
        """Whether so little is ``known`` (N,) of all captures that the room's layout has to say something."""
        return self.h.proxy.layout == "auto" and len(known) > 0 and float(known.mean()) < CARRIED

    @cached_property
    def _known(self) -> np.ndarray:
        """(N,) the share of each capture's pixels that stereo and sensors know; of none while they are not made, and
        where it is only looked at what would be and nothing was estimated."""
        scene = self.runner.scene
        needed = [DEPTH.name] if self.runner.makes else [DEPTH.name, ESTIMATED.name]
        if not all((scene.path / name).is_dir() for name in needed):
            return np.zeros(0)
        try:
            return self._known_of(scene.read(DEPTH).of(scene.read(CAPTURES)))
        except R2SEgoError:
            if self.runner.makes:
                raise
            return np.zeros(0)  # what is damaged is made anew, and told as that

    def _carried(self, captures: Captures, depth: PerCapture[DepthMap]) -> np.ndarray:
        return self._known_of(depth.of(captures)) < CARRIED

    def _known_of(self, maps: Sequence[DepthMap]) -> np.ndarray:
        return np.array([one.reliable(self.h.stereo).mean() for one in maps])

    # ---- what all steps have in common

    @cached_property
    def _stride_px(self) -> int:
        cameras = [capture.camera for capture in self.runner.scene.read(CAPTURES)]
        return disc_stride_px(cameras, self.h.training)

    def _lifted(self, captures: Captures, depths: Iterable[np.ndarray]) -> list[DepthView]:
        """The captures with a depth (H, W) in metres each, to be lifted to splats."""
        return [
            self._depth_view(capture.camera, depth, capture.image(), capture.weight)
            for capture, depth in zip(captures, depths, strict=True)
        ]

    def _depth_view(self, camera: Camera, depth: np.ndarray, image: np.ndarray, weight: float = 1.0) -> DepthView:
        share = self.h.training.detailed_share
        return DepthView(camera, depth, image, self._stride_px, detailed_share=share, weight=weight)

    def _make(
        self, made: Artifact[Held], compute: Callable[..., Any], *takes: Artifact[Any], **known: Any
    ) -> Artifact[Held]:
        made = replace(made, name=self.under + made.name)
        self.runner.make(made, compute, *takes, **known)
        if made.name == self.until:
            raise Reached
        return made
