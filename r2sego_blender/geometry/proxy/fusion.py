"""Composition of the geometry proxy M_scaf (the paper's Eq. 1).

Completed depth of the captures and the current asset's depth, weighted by the evidence for
them, become a surface (``surfaces``: a truncated distance field by default, in NKSR's
place). It is carved by what the captures saw to be free, freed of loose crumbs, replaced by
aligned priors in their object regions and closed by the room's envelope where nothing else
is. With completed depth the mesher hardly matters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ...captures.capture import Capture
from ...config.settings import ProxySettings
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.progress import SILENT, Progress
from ..mesh.meshes import compacted, component_areas, merged, normals_and_areas, places
from ..objects.prior_files import AlignedPrior
from ..room.completed_depth import CompletedDepth, DepthSource
from ..room.envelope import envelope_polygons, tessellated
from ..room.planes import RoomPlanes
from ..stereo.evidence import FREE_MARGIN, KnownDepth, collect_votes
from ..stereo.observed_geometry import ObservedGeometry
from ..surfaces.backends import surface_backend
from ..surfaces.oriented_points import WeightedDepth
from ..surfaces.tsdf import DistanceField
from ..visibility.rasterizer import MeshRasterizer
from .proxy import GeometryProxy, Provenance

_PLANE_SHARE = 3.0  # a chosen plane weighs this many times what is merely filled in
_SAME_SURFACE = 0.03  # relative depth within which a capture sees a face
_SAME_ESTIMATE = 0.08  # relative depth within which a capture's estimate is of a face
_LEAST_COSINE = 0.1  # a capture that sees a face more edge-on than this says nothing for it
_CELL_VOXELS = 2  # side of the cells that close the envelope
_SAME_PLANE = 0.8  # cosine from which a face covers the envelope
_LARGEST_FIELD = 40_000_000  # voxels; 320 MB
_OUTLIERS = 0.002  # share of the points at each end that the field need not cover
_MARGIN_M = 0.5  # the field's reach beyond the captures' centres
_SENSOR_NOISE = 0.045  # three standard deviations of a sensor's depth on a slanted surface, relative
_ASSET_ALPHA = 0.5  # below this the asset's depth says nothing


def compose_proxy(
    captures: Sequence[Capture],
    completed: Sequence[CompletedDepth],
    observed: ObservedGeometry,
    envelope: RoomPlanes,
    asset_depths: Sequence[tuple[Camera, np.ndarray, np.ndarray]],
    settings: ProxySettings,
    progress: Progress = SILENT,
    priors: Sequence[AlignedPrior] = (),
) -> GeometryProxy:
    """The proxy of a round; ``asset_depths`` are (camera, depth (H, W), alpha (H, W)) of A^l.

    ``completed`` belongs to ``captures`` one by one. A face is OBSERVED where a capture's
    trusted stereo lies on it, MEASURED where a sensor's depth does in more of them, PRIOR on an aligned
    prior, ESTIMATED where an estimator's depth lies on it in as many as other completed depth, else
    COMPLETED. Raises GeometryError when no surface comes out.
    """
    if len(completed) != len(captures):
        raise GeometryError("every capture needs one completed depth map", cure="Run stereo again.")
    trusted = _trusted(completed)
    with progress.task("Composing the geometry proxy", 5) as task:
        field = _empty_field(completed, observed, envelope, settings)
        task.advance()
        views = _without_priors(_weighted(completed, asset_depths, settings), priors)
        vertices, faces = surface_backend(settings.surface).surface(views, field)
        vertices, faces = _carved(vertices, faces, trusted, settings)
        task.advance()
        faces = _outside_priors(vertices, faces, priors, envelope, trusted, settings)
        instance = np.zeros(len(faces), np.int32)
        for number, prior in enumerate(priors, 1):
            faces = np.concatenate([faces, np.asarray(prior.faces, np.int32) + len(vertices)])
            vertices = np.concatenate([vertices, np.asarray(prior.vertices, np.float64)])
            instance = np.append(instance, np.full(len(prior.faces), number, np.int32))
        task.advance()
        vertices, faces = _closed(vertices, faces, field, envelope, trusted)
        if not len(faces):
            raise GeometryError(
                "no surface was found",
                where="geometry proxy",
                cure="Take more photographs that overlap, or check their poses.",
            )
        task.advance()
        instance = np.pad(instance, (0, len(faces) - len(instance)))  # the envelope is the room's
        names = tuple(prior.name for prior in priors)
        proxy = _with_evidence(vertices, faces, instance, names, completed)
        task.advance()
    return proxy


def _empty_field(
    completed: Sequence[CompletedDepth], observed: ObservedGeometry, envelope: RoomPlanes, settings: ProxySettings
) -> DistanceField:
    """A field that covers what was seen, less outliers, and what the envelope lets through.

    Pixels of the envelope, or to which other depth went on, count where they are no farther off than what is sure:
    on an open side of the room they may lie anywhere.
    """
    seen = [np.asarray(observed.points, np.float64).reshape(-1, 3)]
    sure = [
        (view.seen | (view.source == DepthSource.PLANE) | (view.source == DepthSource.ESTIMATED)) & (view.depth > 0)
        for view in completed
    ]
    depths = [view.depth[is_sure] for view, is_sure in zip(completed, sure, strict=True)]
    farthest_m = max((np.quantile(depth, 1 - _OUTLIERS) for depth in depths if len(depth)), default=0.0)
    for view, is_sure in zip(completed, sure, strict=True):
        guessed = np.isin(view.source, (DepthSource.ENVELOPE, DepthSource.FILLED))
        bound = guessed & (view.depth > 0) & (view.depth <= farthest_m)
        seen.append(view.camera.unproject(view.depth)[is_sure | bound][::7])
    points = np.concatenate(seen)
    centres = np.array([view.camera.centre for view in completed])
    low, high = centres.min(0) - _MARGIN_M, centres.max(0) + _MARGIN_M
    if len(points):
        reach = settings.truncation_m
        low = np.minimum(low, np.quantile(points, _OUTLIERS, axis=0) - reach)
        high = np.maximum(high, np.quantile(points, 1 - _OUTLIERS, axis=0) + reach)
    for normal, offset in zip(envelope.normals, envelope.offsets, strict=True):
        axis = int(np.argmax(np.abs(normal)))
        if abs(normal[axis]) > 0.999:  # beyond an axis-parallel bound there is nothing to fuse
            bound = offset / normal[axis]
            if normal[axis] > 0:
                low[axis] = max(low[axis], bound - 2 * settings.truncation_m)
            else:
                high[axis] = min(high[axis], bound + 2 * settings.truncation_m)
    needed = float(np.prod((high - low) / settings.voxel_m + 1))
    voxel_m = settings.voxel_m * max(1.0, np.cbrt(needed / _LARGEST_FIELD))
    return DistanceField.covering(low, high, voxel_m, max(settings.truncation_m, 2 * voxel_m, _noise_m(completed)))


def _noise_m(completed: Sequence[CompletedDepth]) -> float:
    """How far apart captures have a surface that a sensor measured: a field cut off nearer is torn."""
    measured = [view.depth[view.source == DepthSource.MEASURED] for view in completed]
    usual_m = float(np.median(np.concatenate(measured))) if any(map(len, measured)) else 0.0
    return _SENSOR_NOISE * usual_m


def _weighted(
    completed: Sequence[CompletedDepth],
    asset_depths: Sequence[tuple[Camera, np.ndarray, np.ndarray]],
    settings: ProxySettings,
) -> list[WeightedDepth]:
    """The captures' completed depth and the asset's, with the evidence for every pixel."""
    filled = settings.completed_weight
    of_source = np.zeros(len(DepthSource), np.float32)
    of_source[DepthSource.OBSERVED] = of_source[DepthSource.MEASURED] = 1.0
    of_source[DepthSource.PLANE] = min(1.0, _PLANE_SHARE * filled)
    of_source[DepthSource.ESTIMATED] = of_source[DepthSource.PLANE]
    of_source[DepthSource.ENVELOPE] = of_source[DepthSource.FILLED] = filled
    views = []
    for view in completed:
        weight = of_source[view.source]
        if view.certainty is not None:
            weight = np.where(view.source == DepthSource.ESTIMATED, weight * view.certainty, weight)
        views.append(WeightedDepth(view.camera, view.depth, weight))
    for camera, depth, alpha in asset_depths:
        weight = np.where(alpha > _ASSET_ALPHA, alpha * settings.asset_weight, 0)
        views.append(WeightedDepth(camera, np.where(weight > 0, depth, 0), weight))
    return views


def _without_priors(views: list[WeightedDepth], priors: Sequence[AlignedPrior]) -> list[WeightedDepth]:
    """The depth of what is no prior: the complement's input (the paper's Eq. 1).

    A pixel that shows a prior says nothing of other surfaces, unless they are nearer.
    """
    if not priors:
        return views
    counts = np.cumsum([0] + [len(prior.vertices) for prior in priors])
    rasterizer = MeshRasterizer(
        np.concatenate([prior.vertices for prior in priors]),
        np.concatenate([prior.faces + start for prior, start in zip(priors, counts[:-1], strict=True)]),
    )
    left = []
    for view in views:
        prior = rasterizer.render(view.camera).depth
        hidden = (view.depth > 0) & (view.depth < prior * (1 - FREE_MARGIN))
        shown = (prior > 0) & ~hidden
        left.append(WeightedDepth(view.camera, np.where(shown, 0, view.depth), np.where(shown, 0, view.weight)))
    return left


def _carved(
    vertices: np.ndarray, faces: np.ndarray, trusted: Sequence[KnownDepth], settings: ProxySettings
) -> tuple[np.ndarray, np.ndarray]:
    """Without the faces that captures saw through, and without loose crumbs.

    A face counts as seen through only where a capture's trusted depth is farther all around
    its pixel, so that the silhouettes of things are not eaten away.
    """
    if len(faces):
        free = [KnownDepth(v.camera, ndimage.minimum_filter(v.depth, size=3)) for v in trusted]
        centroids, normals = vertices[faces].mean(1), normals_and_areas(vertices, faces)[0]
        through = collect_votes(centroids, free, FREE_MARGIN).through
        agree = collect_votes(centroids, trusted, FREE_MARGIN, normals, _LEAST_COSINE).agree
        faces = faces[through <= agree]
    if len(faces):
        faces = faces[component_areas(vertices, faces) >= settings.min_component_m2]
    return compacted(vertices, faces)


def _outside_priors(
    vertices: np.ndarray,
    faces: np.ndarray,
    priors: Sequence[AlignedPrior],
    envelope: RoomPlanes,
    trusted: Sequence[KnownDepth],
    settings: ProxySettings,
) -> np.ndarray:
    """The faces left once the priors take their object regions.

    A region is the prior's surface within half the truncation; within all of it and in its
    convex hull, what no two captures saw there: a book on a table and a chair pushed under
    it stay, and so do the room's bounds.
    """
    if not len(faces) or not priors:
        return faces
    reach = settings.truncation_m
    centroids = vertices[faces].mean(1)
    free = np.abs(envelope.signed_distance(centroids)) >= reach / 2
    seen = collect_votes(centroids, trusted, _SAME_SURFACE).agree >= 2
    kept = np.ones(len(faces), bool)
    for prior in priors:
        low, high = prior.vertices.min(0) - reach, prior.vertices.max(0) + reach
        asked = np.flatnonzero(kept & free & ((centroids > low) & (centroids < high)).all(1))
        samples, _ = trimesh.remesh.subdivide_to_size(prior.vertices, prior.faces, reach / 2)
        away = cKDTree(samples).query(centroids[asked], distance_upper_bound=reach, workers=-1)[0]
        inside = _in_hull(centroids[asked], prior.vertices)
        taken = (np.isfinite(away) | inside) & ~seen[asked]
        kept[asked[taken | (away < reach / 2)]] = False
    return faces[kept]


def _in_hull(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(P,) bool: which points lie in the vertices' convex hull; none where those are flat, as a rug's."""
    try:
        hull = ConvexHull(vertices).equations
    except QhullError:
        return np.zeros(len(points), bool)
    return (points @ hull[:, :3].T + hull[:, 3] < 0).all(1)


def _closed(
    vertices: np.ndarray, faces: np.ndarray, field: DistanceField, envelope: RoomPlanes, trusted: Sequence[KnownDepth]
) -> tuple[np.ndarray, np.ndarray]:
    """With the envelope added where it is not covered yet and no capture saw an opening."""
    high = field.origin + (np.array(field.distance.shape) - 1) * field.voxel_m
    centroids, normals = vertices[faces].mean(1), normals_and_areas(vertices, faces)[0]
    added = []
    polygons = envelope_polygons(envelope, field.origin, high)
    for polygon, normal, offset in zip(polygons, envelope.normals, envelope.offsets, strict=True):
        cells = tessellated(polygon, normal, _CELL_VOXELS * field.voxel_m)
        samples = np.concatenate([cells, cells.mean(1, keepdims=True)], axis=1)
        votes = collect_votes(samples[:, -1], trusted, FREE_MARGIN)
        on_plane = np.abs(centroids @ normal - offset) < field.truncation_m / 2
        on_plane &= normals @ normal > _SAME_PLANE
        covered = np.zeros(samples.shape[:2], bool)
        if on_plane.any():
            near = cKDTree(centroids[on_plane]).query(samples, distance_upper_bound=field.voxel_m)[0]
            covered = np.isfinite(near)
        added.append(cells[(votes.through <= votes.agree) & ~covered.all(1)])
    corners = np.concatenate([np.zeros((0, 3)), *(cells.reshape(-1, 3) for cells in added)])
    welded, corner = merged(corners, places(corners))  # neighbouring cells share their corners
    corner = (len(vertices) + corner.reshape(-1, 4)).astype(np.int32)
    new = np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    return np.concatenate([vertices, welded]), np.concatenate([faces, new])


def face_evidence(
    vertices: np.ndarray, faces: np.ndarray, rasterizer: MeshRasterizer, completed: Sequence[CompletedDepth]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the captures say of ``faces`` (F, 3): the number that see each in the mesh of ``rasterizer``
    (F,) uint16, the number whose trusted stereo lies on it (F,) uint16, and its confidence (F,) float32.
    """
    seen = [KnownDepth(view.camera, rasterizer.render(view.camera).depth) for view in completed]
    chosen = _of_source(completed, DepthSource.PLANE)
    centroids, normals = vertices[faces].mean(1), normals_and_areas(vertices, faces)[0]
    support, observed, planar = (
        collect_votes(centroids, views, _SAME_SURFACE, normals, _LEAST_COSINE).agree
        for views in (seen, _trusted(completed), chosen)
    )
    # Each capture whose stereo lies on a face halves the doubt, each chosen plane takes a fifth.
    confidence = 1.0 - 0.9 * 0.5 ** observed.astype(float) * 0.8 ** planar.astype(float)
    by_estimate, certainty = _estimates_on(centroids, normals, completed)
    confidence = np.where(by_estimate > 0, np.maximum(confidence, certainty), confidence)
    return support, observed, confidence.astype(np.float32)


def _estimates_on(
    centroids: np.ndarray, normals: np.ndarray, completed: Sequence[CompletedDepth]
) -> tuple[np.ndarray, np.ndarray]:
    """The number of captures (F,) uint16 whose estimated depth lies on each face, and the mean of its certainty
    where it does (F,) float64, 0 elsewhere."""
    count, total = np.zeros(len(centroids), np.uint16), np.zeros(len(centroids))
    for view in completed:
        if view.certainty is not None:
            depth = np.where(view.source == DepthSource.ESTIMATED, view.depth, 0)
            votes = collect_votes(centroids, [KnownDepth(view.camera, depth)], _SAME_ESTIMATE, normals, _LEAST_COSINE)
            on = votes.agree > 0
            u, v = view.camera.project(centroids[on])[0].astype(np.int64).T
            u, v = u.clip(0, view.camera.width - 1), v.clip(0, view.camera.height - 1)
            count[on] += 1
            total[on] += view.certainty[v, u]
    return count, total / np.maximum(count, 1)


def _of_source(completed: Sequence[CompletedDepth], source: DepthSource) -> list[KnownDepth]:
    """The depth that comes from there."""
    return [KnownDepth(c.camera, np.where(c.source == source, c.depth, 0)) for c in completed]


def _trusted(completed: Sequence[CompletedDepth]) -> list[KnownDepth]:
    """The depth that stereo or a sensor itself measured."""
    return [KnownDepth(c.camera, np.where(c.seen, c.depth, 0)) for c in completed]


def _with_evidence(
    vertices: np.ndarray,
    faces: np.ndarray,
    instance: np.ndarray,
    names: tuple[str, ...],
    completed: Sequence[CompletedDepth],
) -> GeometryProxy:
    support, observed, confidence = face_evidence(vertices, faces, MeshRasterizer(vertices, faces), completed)
    provenance = np.where(observed > 0, Provenance.OBSERVED, Provenance.COMPLETED).astype(np.uint8)
    measured = _of_source(completed, DepthSource.MEASURED)
    if any(view.depth.any() for view in measured) or any(view.certainty is not None for view in completed):
        centroids, normals = vertices[faces].mean(1), normals_and_areas(vertices, faces)[0]
        by_sensor = collect_votes(centroids, measured, _SAME_SURFACE, normals, _LEAST_COSINE).agree
        provenance[(observed > 0) & (2 * by_sensor > observed)] = Provenance.MEASURED
        estimated, _ = _estimates_on(centroids, normals, completed)
        others = [
            KnownDepth(c.camera, np.where(c.seen | (c.source == DepthSource.ESTIMATED), 0, c.depth)) for c in completed
        ]
        completing = collect_votes(centroids, others, _SAME_ESTIMATE, normals, _LEAST_COSINE).agree
        provenance[(observed == 0) & (estimated > 0) & (estimated >= completing)] = Provenance.ESTIMATED
    provenance[instance > 0] = Provenance.PRIOR
    return GeometryProxy(
        vertices.astype(np.float32), faces.astype(np.int32), provenance, support, confidence, instance, names
    )
