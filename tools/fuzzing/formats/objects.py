"""Meshes of objects, and the true room of an evaluation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..harness import Harness
from ..seeds import of_tests

_KINDS = {".obj": "text", ".off": "text", ".gltf": "json", ".stl": "bytes", ".ply": "header", ".glb": "header"}


def _mesh(suffix: str) -> Callable[[Path], None]:
    def build(folder: Path) -> None:
        import trimesh

        vertices, faces = of_tests("fake_proxy").crate()
        made = trimesh.Trimesh(vertices, faces, process=False)
        if suffix == ".gltf":
            scene: Any = trimesh.Scene(made)
            for name, data in scene.export(file_type="gltf").items():
                (folder / name.replace("model.gltf", "a.gltf")).write_bytes(data)
        else:
            made.export(folder / f"a{suffix}")

    return build


def _load(suffix: str) -> Callable[[Path], Any]:
    def load(folder: Path) -> Any:
        from r2sego_blender.geometry.objects.shapes import load_shape

        return load_shape(folder / f"a{suffix}")

    return load


def _true_room(folder: Path) -> None:
    vertices, faces = of_tests("fake_proxy").crate()
    instances = np.zeros(len(faces), np.int64)
    np.savez(folder / "room.npz", V=vertices, F=faces, I=instances, names=np.array(["crate"]))


def _read_true_room(folder: Path) -> Any:
    from r2sego_blender.evaluation.ground_truth import load_true_mesh
    from r2sego_blender.geometry.objects.prior_files import AlignedPrior

    return AlignedPrior("room", *load_true_mesh(folder / "room.npz"))


HARNESSES = (
    *(Harness(f"meshes/{s[1:]}", _mesh(s), f"a{s}", kind, _load(s), share=0.5) for s, kind in _KINDS.items()),
    Harness("truth/room.npz", _true_room, "room.npz", "npz", _read_true_room),
)
