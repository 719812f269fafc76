"""A library of meshes and masks for a scene with ground truth, as an artist would bring them.

The objects that stand on the true floor lose their pose and size: each becomes a mesh in a
frame of its own, turned, scaled and shifted at random. Meshes of another scene stand among
them, wrong for every object. Masks are the true outlines, each grown or shrunk by a pixel,
as drawn ones are. The pipeline gets these files and never the truth behind them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from r2sego_blender.bundle.layout import OBJECTS
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.evaluation.ground_truth import GroundTruth
from r2sego_blender.geometry.mesh.meshes import compacted
from r2sego_blender.geometry.objects.objects import DeclaredObject, save_objects
from r2sego_blender.geometry.objects.shapes import Shape

from .geometry_scores import AlignmentScore, alignment_score

_LARGEST_M, _LEAST_THICK_M = 3.0, 0.1
_ON_FLOOR_M = 0.05
_LEAST_SIZE_M = 0.25
_FLATTEST = 0.02  # thickness over size; flatter is a picture or a carpet
_SYMMETRIC = 0.004  # of the size: mean distance of a shape to itself when turned
_TWIN_M = 1e-3
_SCALES = (0.3, 3.0)
_WRONG_MESHES = 22


@dataclass(frozen=True)
class TrueObject:
    """``vertices`` (V, 3) and ``faces`` (F, 3) in a frame of its own, and where it truly stands."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    world_from_own: np.ndarray

    def score(self, world_from_own: np.ndarray, rng: np.random.Generator) -> AlignmentScore:
        """How far a pose is from the truth, up to the shape's own symmetries."""
        return alignment_score(
            world_from_own,
            self.world_from_own,
            self.vertices,
            self.faces,
            rng,
            symmetries=symmetries(Shape.of(self.name, self.vertices, self.faces)),
        )

    def pose_of(self, other: TrueObject) -> np.ndarray | None:
        """Where the mesh of ``other`` would stand in this one's place; None if it is no twin."""
        if len(other.vertices) != len(self.vertices):
            return None
        world = self.vertices @ self.world_from_own[:3, :3].T + self.world_from_own[:3, 3]
        pose, moved, _ = trimesh.registration.procrustes(other.vertices, world, reflection=False)
        return pose if np.abs(moved - world).max() < _TWIN_M else None


def true_objects(truth: GroundTruth, rng: np.random.Generator) -> tuple[TrueObject, ...]:
    """The instances that stand on the floor and are no part of the room, in random frames."""
    found = []
    for index, name in enumerate(truth.names):
        world, faces = compacted(truth.vertices, truth.faces[truth.instances == index])
        extent = np.ptp(world, axis=0)
        stands = abs(world[:, 2].min()) < _ON_FLOOR_M
        if not stands or extent.max() > _LARGEST_M or extent.min() < _LEAST_THICK_M:
            continue
        own_from_world = _random_similarity(rng)
        vertices = world @ own_from_world[:3, :3].T + own_from_world[:3, 3]
        found.append(TrueObject(name, vertices, faces, np.linalg.inv(own_from_world)))
    return tuple(found)


def write_library(
    folder: Path, objects: tuple[TrueObject, ...], other_scene: Path, count: int, rng: np.random.Generator
) -> list[str]:
    """One mesh file for each object and ``count`` of the meshes in ``other_scene``.

    Returns the names of the latter, all wrong.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for one in objects:
        trimesh.Trimesh(one.vertices, one.faces, process=False).export(folder / f"{one.name}.ply")
    wrong = []
    for name, mesh in _meshes(other_scene, count, rng).items():
        mesh.apply_transform(_random_similarity(rng))
        mesh.export(folder / f"other_{name}.ply")
        wrong.append(f"other_{name}")
    return wrong


def declare_true_objects(
    bundle: Scene, truth: GroundTruth, other_scene: Path, folder: Path, rng: np.random.Generator
) -> tuple[tuple[TrueObject, ...], list[str]]:
    """Declare the true objects in a bundle and fill ``folder`` with its library of meshes.

    ``truth`` is in the bundle's world; ``_WRONG_MESHES`` of ``other_scene`` stand in the
    library too. Returns the objects and the names of the wrong meshes. Which folder the
    library is remains to be declared.
    """
    objects = true_objects(truth, rng)
    wrong = write_library(folder, objects, other_scene, _WRONG_MESHES, rng)
    masks = rough_masks(truth, objects, rng)
    save_objects(bundle.path / OBJECTS, masks, [view.name for view in truth.views])
    return objects, wrong


def rough_masks(
    truth: GroundTruth, objects: tuple[TrueObject, ...], rng: np.random.Generator
) -> tuple[DeclaredObject, ...]:
    """Every object's outline in every capture, grown or shrunk by a pixel."""
    square = np.ones((3, 3), np.uint8)
    found = []
    for one in objects:
        masks = {}
        for view in truth.views:
            outline = (view.ids == truth.names.index(one.name)).astype(np.uint8)
            grow = cv2.dilate if rng.random() < 0.5 else cv2.erode
            masks[view.name] = grow(outline, square) > 0
        found.append(DeclaredObject(one.name, masks))
    return tuple(found)


def symmetries(shape: Shape) -> list[np.ndarray]:
    """(4, 4) rigid maps, in the shape's own frame, that leave it as it is."""
    own_from_canonical = np.linalg.inv(shape.canonical_from_own)
    found = []
    for turn in Rotation.create_group("O").as_matrix():
        if shape.surface.distances(shape.surface.samples[::20] @ turn.T).mean() < _SYMMETRIC:
            linear = np.eye(4)
            linear[:3, :3] = turn
            found.append(own_from_canonical @ linear @ shape.canonical_from_own)
    return found


def _random_similarity(rng: np.random.Generator) -> np.ndarray:
    similarity = np.eye(4)
    scale = np.exp(rng.uniform(*np.log(_SCALES)))
    similarity[:3, :3] = scale * Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    similarity[:3, 3] = rng.normal(size=3)
    return similarity


def _meshes(scene: Path, count: int, rng: np.random.Generator) -> Mapping[str, trimesh.Trimesh]:
    """Up to ``count`` different solid meshes of a scene's file."""
    loaded: Any = trimesh.load(scene, skip_materials=True)
    different: dict[tuple[float, ...], tuple[str, trimesh.Trimesh]] = {}
    for node in sorted(loaded.graph.nodes_geometry):
        _, name = loaded.graph[node]
        mesh = loaded.geometry[name]
        extent = np.sort(mesh.extents)
        if extent[2] >= _LEAST_SIZE_M and extent[0] >= _FLATTEST * extent[2]:
            different.setdefault((len(mesh.faces), *np.round(extent, 2)), (node, mesh))
    chosen = sorted(different.values(), key=lambda pair: pair[0])
    chosen = [chosen[k] for k in sorted(rng.permutation(len(chosen))[:count])]
    return {node: trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for node, mesh in chosen}
