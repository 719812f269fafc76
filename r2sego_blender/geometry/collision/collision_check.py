"""What MuJoCo makes of a collision surface: are its pieces where they were written, and do
spheres dropped all over the room come to rest on the surface?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial import cKDTree

from ...core.errors import GeometryError
from ...core.formatting import told_apart
from ...core.progress import SILENT, Progress
from ..mesh.triangles import columns, crossed, distances
from .collision_files import FLOOR, HULLS, MESH_OBJ, SCENE_XML, read_obj

SPHERE_RADIUS_M = 0.05
WITHIN_M = 0.01
"""A sphere rests on the surface when its own is at most this far from it."""
VERTEX_TOLERANCE_M = 1e-3
SHARE_ON_SURFACE = 0.99
"""Of the spheres, at least: on an edge the pieces stand out by centimetres, and some sphere meets one."""
FARTHEST_M = 0.03
"""No sphere rests farther from the surface: feet that clear a floor by 5 cm pass over that."""

_SPACING_M = 0.2
_DROP_FROM_M = 1.8  # above furniture; under what hangs lower, spheres start lower
_CLEARANCE_M = 0.05  # between a sphere at its start and the surface above it
_STEP_S = 0.004
_STEPS_BETWEEN_LOOKS = 10
_LONGEST_S = 12.0
# At rest: moved by less than this in so many looks, which is 1 cm/s for 0.2 s.
_REST_M, _LOOKS_AT_REST = 0.002, 5
_REACH_M = 0.3  # farther from the surface than this is just far
_MASS_KG = 0.1
# Sliding; turning and rolling in metres: a sphere stays on a slope of less than 21 degrees.
_FRICTION = (1.0, 0.02, 0.02)
_BATCH = 150  # spheres simulated together


@dataclass(frozen=True)
class CollisionCheck:
    """How a collision folder behaves in MuJoCo; world frame, metres.

    ``vertex_error_m``: the largest distance between a written vertex of a piece and the
    nearest compiled one, or the other way; ``starts`` and ``ends`` (N, 3): each sphere's
    centre before and after; ``at_rest`` (N,) bool; ``fell_through`` (N,) bool: its centre's
    path crossed the mesh or the floor from the free side; ``left`` (N,) bool: it rolled off the
    floor's edge, where the proxy has no wall; ``gap_m`` (N,): from the sphere to
    the nearest point of the mesh and the floor, positive where it floats, negative where it
    has sunk in, inf beyond 30 cm; ``proxy_gap_m`` (N,): the same to another mesh, the proxy,
    or nan; ``simulated_s``: until all were at rest, or the bound.
    """

    pieces: int
    vertex_error_m: float
    starts: np.ndarray
    ends: np.ndarray
    at_rest: np.ndarray
    fell_through: np.ndarray
    left: np.ndarray
    gap_m: np.ndarray
    proxy_gap_m: np.ndarray
    simulated_s: float

    @property
    def on_surface(self) -> np.ndarray:
        """(N,) bool: at rest within a centimetre of the surface."""
        return self.at_rest & ~self.fell_through & (np.abs(self.gap_m) <= WITHIN_M)

    @property
    def off_surface(self) -> np.ndarray:
        """(n,) indices of the other spheres, the worst first: what fell through, what did not
        come to rest, what rolled off, what rests farthest from the surface."""
        off = np.flatnonzero(~self.on_surface)
        return off[np.lexsort((-np.abs(self.gap_m[off]), self.at_rest[off] | self.left[off], ~self.fell_through[off]))]

    @property
    def farthest_m(self) -> float:
        """How far from the surface a sphere rests at most, inf for farther than the 30 cm looked at."""
        return float(np.abs(self.gap_m[self.at_rest]).max(initial=0.0))

    @property
    def failures(self) -> list[str]:
        """In words, what of this does not hold: pieces compiled where they were written, no sphere
        fell through, 99 % of them rest on the surface, and none farther from it than 3 cm."""
        count, found = len(self.starts), []
        if not self.vertex_error_m <= VERTEX_TOLERANCE_M:  # nor where it is no number
            found.append("pieces are not where they were written")
        if self.fell_through.any():
            found.append(f"{int(self.fell_through.sum())} of {count} spheres fell through")
        if len(self.off_surface) > (1.0 - SHARE_ON_SURFACE) * count:
            allowed = f"{1.0 - SHARE_ON_SURFACE:.0%} are allowed"
            found.append(f"{len(self.off_surface)} of {count} spheres off the surface, {allowed}")
        if not self.farthest_m <= FARTHEST_M:
            allowed = f"{100 * FARTHEST_M:.0f} cm are allowed"
            found.append(f"one rests {gap_in_words(self.farthest_m, FARTHEST_M)} off, {allowed}")
        return found

    @property
    def passed(self) -> bool:
        """Whether none of the ``failures`` is there."""
        return not self.failures


def gap_in_words(gap_m: float, limit_m: float = np.nan) -> str:
    """How far a sphere is from the surface, which is not looked at beyond 30 cm."""
    return f"{told_apart(100 * gap_m, 100 * limit_m, 1)} cm" if np.isfinite(gap_m) else "more than 30 cm"


def check_collision(
    folder: Path, proxy: tuple[np.ndarray, np.ndarray] | None = None, progress: Progress = SILENT
) -> CollisionCheck:
    """Compile ``scene.xml`` of a collision folder and drop spheres on a grid over its floor.

    A sphere is dropped where the mesh has a surface that faces it from below, from 1.8 m or
    from under what hangs lower. ``proxy``: vertices (V, 3) and faces (F, 3) the resting
    places are compared with besides. Raises GeometryError when a file is missing or damaged,
    or MuJoCo refuses the scene.
    """
    vertices, faces = read_obj(folder / MESH_OBJ)
    if not len(faces):
        raise GeometryError("the mesh has no faces", where=folder / MESH_OBJ, cure="Make the collision surface again.")
    spec, model = _compiled(folder)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pieces = sorted((folder / HULLS).glob("*.obj"))
    error_m = max((_vertex_error(model, data, path) for path in pieces), default=0.0)
    floor = _floor_triangles(model, data)
    corners = np.concatenate([vertices[faces], floor])
    starts = _starts(corners, floor if len(floor) else _bounds(corners))
    ends, through, at_rest, simulated_s = starts.copy(), *np.zeros((2, len(starts)), bool), 0.0
    batches = [slice(first, first + _BATCH) for first in range(0, len(starts), _BATCH)]
    for batch in progress.track(batches, "Dropping spheres"):
        paths, at_rest[batch], seconds = _dropped(spec, starts[batch])
        ends[batch], through[batch] = paths[:, -1], crossed(corners, paths)
        simulated_s = max(simulated_s, seconds)
    finite = np.isfinite(ends).all(1)
    proxy_gap_m = np.full(len(ends), np.nan)
    if proxy is not None:
        proxy_gap_m = distances(np.asarray(proxy[0], float)[proxy[1]], ends, _REACH_M) - SPHERE_RADIUS_M
    return CollisionCheck(
        pieces=len(pieces),
        vertex_error_m=error_m,
        starts=starts,
        ends=ends,
        at_rest=at_rest,
        fell_through=through | ~finite,
        left=~through & finite & (ends[:, 2] < corners[..., 2].min()),
        gap_m=distances(corners, ends, _REACH_M) - SPHERE_RADIUS_M,
        proxy_gap_m=proxy_gap_m,
        simulated_s=simulated_s,
    )


def _compiled(folder: Path) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    try:
        spec = mujoco.MjSpec.from_file(str(folder / SCENE_XML))
        return spec, spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        words = " ".join(str(error).split()).rstrip(".")
        raise GeometryError(
            f"MuJoCo refuses it: {words}", where=folder / SCENE_XML, cure="Make the collision surface again."
        ) from error


def _vertex_error(model: mujoco.MjModel, data: mujoco.MjData, piece: Path) -> float:
    """Between the vertices of a piece's file and those of its compiled geom, in the world."""
    try:
        geom = model.geom(piece.stem).id
    except KeyError as error:
        raise GeometryError(
            f"the scene has no piece '{piece.stem}'",
            where=piece.parent.parent / SCENE_XML,
            cure="Make the collision surface again.",
        ) from error
    mesh = model.geom_dataid[geom]
    start = model.mesh_vertadr[mesh]
    compiled = model.mesh_vert[start : start + model.mesh_vertnum[mesh]].astype(np.float64)
    compiled = compiled @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    written, _ = read_obj(piece)
    return float(max(cKDTree(compiled).query(written)[0].max(), cKDTree(written).query(compiled)[0].max()))


def _floor_triangles(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(2, 3, 3): the top of the floor's box as two triangles, (0, 3, 3) without a floor."""
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR)
    if geom < 0:
        return np.zeros((0, 3, 3))
    corners = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]) * model.geom_size[geom]
    corners = corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return corners[[[0, 1, 2], [0, 2, 3]]]


def _bounds(corners: np.ndarray) -> np.ndarray:
    """(2, 3, 3): the level rectangle that holds the triangles, where there is no floor."""
    (x, y, z), (right, ahead, _) = corners.min((0, 1)), corners.max((0, 1))
    around = np.array([[x, y, z], [right, y, z], [right, ahead, z], [x, ahead, z]])
    return around[[[0, 1, 2], [0, 2, 3]]]


def _starts(corners: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """(N, 3) centres over a grid on the floor, each in the free space above a surface.

    Free is what lies between a surface that faces up and the next above it, which faces down.
    """
    places = _grid(floor[0, 0], floor[0, 1] - floor[0, 0], floor[1, 2] - floor[0, 0])
    margin = SPHERE_RADIUS_M + _CLEARANCE_M
    found = []
    for place, (heights, upward) in zip(places, columns(corners, places), strict=True):
        above = np.append(heights[1:], np.inf)
        centre = np.minimum(_DROP_FROM_M, above - margin)
        free = upward & ~np.append(upward[1:], False) & (centre > heights + margin)
        if free.any():
            found.append((*place, centre[np.flatnonzero(free)[-1]]))
    starts = np.array(found).reshape(-1, 3)
    return starts[distances(corners, starts, margin) > margin]


def _grid(origin: np.ndarray, right: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """(N, 2) places evenly spread over a rectangle, half a spacing from its edges."""
    sides = np.stack([right, ahead])[:, :2]
    counts = np.ceil(np.linalg.norm(sides, axis=1) / _SPACING_M).astype(int)
    x, y = ((np.arange(count) + 0.5) / count for count in counts)
    return np.stack(np.meshgrid(x, y), -1).reshape(-1, 2) @ sides + origin[:2]


def _dropped(spec: mujoco.MjSpec, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Paths of the spheres' centres (N, P, 3), which are at rest at the end, and when that is."""
    spec = spec.copy()
    spec.option.timestep = _STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # with stiff friction, so that none creeps downhill
    spec.option.impratio = 10.0
    for index, start in enumerate(starts):
        body = spec.worldbody.add_body(name=f"sphere {index}", pos=start)
        body.add_freejoint()
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=(SPHERE_RADIUS_M, 0.0, 0.0),
            mass=_MASS_KG,
            friction=_FRICTION,
            condim=6,
            contype=2,
            conaffinity=1,
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    path = [starts]
    rests = np.zeros(len(starts), bool)
    while data.time < _LONGEST_S and not rests.all():
        mujoco.mj_step(model, data, _STEPS_BETWEEN_LOOKS)
        path.append(data.qpos.reshape(-1, 7)[:, :3].copy())
        rests = np.linalg.norm(path[-1] - path[-1 - _LOOKS_AT_REST :][0], axis=1) < _REST_M
        rests &= len(path) > _LOOKS_AT_REST
    return np.stack(path, axis=1), rests, float(data.time)
