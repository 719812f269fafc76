"""The proxy with a person's edits: cut faces gone, drawn surfaces in, everything else as it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from ...core.errors import GeometryError
from ..mesh.meshes import normals_and_areas
from ..room.completed_depth import CompletedDepth
from ..visibility.rasterizer import MeshRasterizer
from .edits import Cut, Drawn, Edit
from .fusion import face_evidence
from .proxy import GeometryProxy, Provenance

_NORMAL_M = 0.03
"""A normal counts like a place: opposite sides of a thin board are twice this far apart."""

_REACH_EDGES = 3.0  # how far a cut reaches where a later proxy has no face at a sample, in edges
_MOST_DRAWN_FACES = 2_000_000
_LARGEST_EDGE_M = 0.1  # of a drawn surface: its faces are asked for their evidence one by one


def cut_of(proxy: GeometryProxy, corners: np.ndarray, earlier: Sequence[Edit] = ()) -> Cut:
    """The cut of the faces with these ``corners`` (K, 3, 3), metres, exactly as ``proxy`` has them.

    What ``earlier`` edits removed is not this cut's: it comes back when they are taken back.
    Raises GeometryError when the proxy has no such faces.
    """
    corners = np.ascontiguousarray(corners, np.float32).reshape(-1, 3, 3)
    chosen = _same(proxy.vertices[proxy.faces], corners)
    if not len(corners) or chosen.sum() < len(np.unique(corners.reshape(-1, 9), axis=0)):
        raise GeometryError(
            "the faces to cut are not the proxy's", where="edit", cure="Show the proxy again and choose anew."
        )
    samples, areas = _samples(proxy.vertices, proxy.faces)
    removed, kept = samples[chosen], samples[~chosen]
    edge = float(np.sqrt(np.median(areas[chosen]) * 4 / np.sqrt(3)))
    reach = _REACH_EDGES * edge
    others = [edit.change.removed for edit in earlier if isinstance(edit.change, Cut)]
    kept = np.concatenate([kept, *others])
    near = np.isfinite(_tree(removed).query(_placed(kept), distance_upper_bound=2 * reach)[0])
    return Cut(removed, kept[near], reach, float(areas[chosen].sum()))


def drawn_surface(vertices: np.ndarray, faces: np.ndarray) -> Drawn:
    """A drawn surface of a mesh in the world, its large faces divided. Raises GeometryError for none."""
    vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    cure = "Draw a mesh with faces, in metres."
    if not np.isfinite(vertices).all():
        raise GeometryError("the drawn surface has vertices that are not finite", where="edit", cure=cure)
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise GeometryError("the drawn surface has faces without vertices", where="edit", cure=cure)
    faces = faces[normals_and_areas(vertices, faces)[1] > 0] if len(faces) else faces
    if not len(faces):
        raise GeometryError("the drawn surface has no faces", where="edit", cure=cure)
    halvings = np.ceil(np.log2(np.maximum(_longest_edges(vertices, faces) / _LARGEST_EDGE_M, 1.0)))
    if (4.0**halvings).sum() > _MOST_DRAWN_FACES:
        raise GeometryError(
            f"the drawn surface takes more than {_MOST_DRAWN_FACES} faces of {_LARGEST_EDGE_M:g} m",
            where="edit",
            cure=cure,
        )
    vertices, faces = trimesh.remesh.subdivide_to_size(vertices, faces, _LARGEST_EDGE_M, max_iter=20)
    area = float(normals_and_areas(vertices, faces)[1].sum())
    return Drawn(vertices, faces.astype(np.int32), area)


def _longest_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) metres, of each face."""
    corners = vertices[faces]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def edited(proxy: GeometryProxy, edits: Sequence[Edit], completed: Sequence[CompletedDepth]) -> GeometryProxy:
    """``proxy`` after the edits, one by one; ``completed`` are the captures' depths.

    Faces that no edit takes keep their place in the order and every number. Drawn faces come
    after them, of provenance PRIOR, of the room, with the captures' evidence for them.
    """
    for edit in edits:
        if isinstance(edit.change, Cut):
            proxy = _without(proxy, edit.change)
        else:
            proxy = _with(proxy, edit.change, completed)
    return proxy


def _without(proxy: GeometryProxy, cut: Cut) -> GeometryProxy:
    samples, _ = _samples(proxy.vertices, proxy.faces)
    near = np.flatnonzero(_in_box(samples, cut))
    to_removed = _tree(cut.removed).query(_placed(samples[near]), distance_upper_bound=cut.reach_m)[0]
    gone = np.isfinite(to_removed)
    if len(cut.kept):
        # At the same place both are 0: what stayed on the proxy of the cut stays.
        gone &= to_removed < _tree(cut.kept).query(_placed(samples[near]))[0]
    stays = np.ones(len(samples), bool)
    stays[near[gone]] = False
    return replace(
        proxy,
        faces=proxy.faces[stays],
        provenance=proxy.provenance[stays],
        support=proxy.support[stays],
        confidence=proxy.confidence[stays],
        instance=proxy.instance[stays],
    )


def _with(proxy: GeometryProxy, drawn: Drawn, completed: Sequence[CompletedDepth]) -> GeometryProxy:
    vertices = np.concatenate([proxy.vertices, drawn.vertices.astype(np.float32)])
    new = (drawn.faces + len(proxy.vertices)).astype(np.int32)
    faces = np.concatenate([proxy.faces, new])
    support, _, confidence = face_evidence(vertices, new, MeshRasterizer(vertices, faces), completed)
    count = len(new)
    return replace(
        proxy,
        vertices=vertices,
        faces=faces,
        provenance=np.append(proxy.provenance, np.full(count, Provenance.PRIOR, np.uint8)),
        support=np.append(proxy.support, support),
        confidence=np.append(proxy.confidence, confidence),
        instance=np.append(proxy.instance, np.zeros(count, np.int32)),
    )


def _samples(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F, 6) middles and normals of faces, and their areas (F,)."""
    normals, areas = normals_and_areas(vertices, faces)
    return np.concatenate([np.asarray(vertices, np.float64)[faces].mean(1), normals], axis=1), areas


def _placed(samples: np.ndarray) -> np.ndarray:
    return samples * np.repeat([1.0, _NORMAL_M], 3)


def _tree(samples: np.ndarray) -> cKDTree:
    return cKDTree(_placed(samples))


def _in_box(samples: np.ndarray, cut: Cut) -> np.ndarray:
    places, removed = samples[:, :3], cut.removed[:, :3]
    low, high = removed.min(0) - cut.reach_m, removed.max(0) + cut.reach_m
    return ((places >= low) & (places <= high)).all(1)


def _same(corners: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(F,) bool: the triangles (F, 3, 3) that are, bit by bit, among the ``wanted`` (K, 3, 3)."""
    row = np.dtype((np.void, 9 * 4))
    of_faces, of_wanted = (
        np.ascontiguousarray(part, np.float32).reshape(-1, 9).view(row).ravel() for part in (corners, wanted)
    )
    return np.isin(of_faces, of_wanted)
