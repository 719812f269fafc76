"""Objects' masks and meshes by learned backends, each in an environment of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..captures.capture import Capture
from ..core.errors import GeometryError
from ..core.file_names import plain_name
from ..geometry.objects.objects import DeclaredObject, told_apart
from ..geometry.objects.shapes import load_shape
from ..geometry.objects.shared_masks import joined_masks
from ..geometry.stereo.observed_geometry import ObservedGeometry
from ..workers.sam3 import segment_externally
from ..workers.sam3d import generate_shapes_externally


def segmented_objects(
    vocabulary: Sequence[str], captures: Sequence[Capture], observed: ObservedGeometry
) -> tuple[DeclaredObject, ...]:
    """What the words of ``vocabulary`` name in two captures at least, masked by SAM 3.

    Masks of one word are joined by the ``observed`` points they share. Raises GeometryError
    when nothing is found, MachineError and NativeError as ``segment_externally``.
    """
    backend, found = segment_externally({one.name: one.image() for one in captures}, vocabulary)
    names = [capture.name for capture in captures]
    views = [names.index(one.photograph) for one in found]
    masks, words = [one.mask for one in found], [one.word for one in found]
    groups = joined_masks(masks, views, words, [one.camera for one in captures], observed)
    objects = [
        DeclaredObject(
            plain_name(words[group[0]]), {names[views[m]]: masks[m] for m in group}, backends={"masks": backend}
        )
        for group in groups
        if len(group) >= 2
    ]
    if not objects:
        raise GeometryError(
            f"{backend} found nothing in two photographs",
            where=", ".join(vocabulary),
            cure="Use other words, or draw masks and give them with --masks.",
        )
    return told_apart(objects)


def generated_meshes(
    objects: Sequence[DeclaredObject], captures: Sequence[Capture], folder: Path
) -> tuple[DeclaredObject, ...]:
    """The objects with meshes that SAM 3D made, files in ``folder``, from the photograph that shows
    most of each.

    Raises GeometryError for an object without a mask or a mesh, MachineError and NativeError
    as ``generate_shapes_externally``.
    """
    if not objects:
        return ()
    pictures = {}
    for one in objects:
        shown = [capture for capture in captures if one.masks.get(capture.name, np.zeros(1)).any()]
        if not shown:
            raise GeometryError("no mask shows the object", where=one.name, cure="Draw it in a photograph.")
        best = max(shown, key=lambda capture: int(one.masks[capture.name].sum()))
        pictures[one.name] = (best.image(), one.masks[best.name])
    backend, meshes = generate_shapes_externally(pictures, folder)
    found = []
    for one in objects:
        if one.name not in meshes:
            raise GeometryError(f"{backend} made no mesh of it", where=one.name, cure=cure_without_mesh(one.name))
        load_shape(meshes[one.name])  # what cannot be read is refused now, not in the next run
        backends = {**one.backends, "mesh": backend}
        found.append(replace(one, mesh=meshes[one.name], placement=None, backends=backends))
    return tuple(found)


def cure_without_mesh(name: str) -> str:
    """What helps an object that needs a mesh and has none."""
    return f"Give it one (--mesh {name}=FILE, in Blender Use Active Mesh)."
