"""Meshes of objects, and the true room of an evaluation."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..harness import Harness
from ..seeds import NAMES, camera, of_tests, photographs

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


def _truth(folder: Path) -> None:
    photographs(folder)
    captures = [{"file": name, **camera(number).to_json()} for number, name in enumerate(NAMES)]
    (folder / "cameras.json").write_text(json.dumps({"captures": captures}))
    _true_room(folder)
    (folder / "depth").mkdir()
    depth = np.full(camera().shape, 2.0, np.float32)
    for name in NAMES:
        np.savez(folder / "depth" / f"{Path(name).stem}.npz", z=depth, ids=np.zeros(depth.shape, np.int16))


def _read_truth(folder: Path) -> Any:
    from r2sego_blender.evaluation.ground_truth import load_ground_truth

    truth = load_ground_truth(folder)
    return truth.views, truth.visible_points(0.5)


def _textured(folder: Path) -> Any:
    """What is looked over before Blender's importer opens a bundle's textured surface."""
    from r2sego_blender.core.errors import SceneError
    from r2sego_blender.core.gltf_files import require_whole

    require_whole(folder / "a.glb", SceneError)


def _drawn(folder: Path) -> None:
    vertices, faces = of_tests("fake_proxy").crate()
    np.savez(folder / "drawn.npz", vertices=vertices, faces=faces)


def _read_drawn(folder: Path) -> Any:
    from r2sego_blender.core.arrays import opened_arrays
    from r2sego_blender.core.errors import GeometryError
    from r2sego_blender.geometry.proxy.edited_proxy import drawn_surface

    with opened_arrays(folder / "drawn.npz", GeometryError, "this is no drawn surface", "Make it anew.") as data:
        return drawn_surface(data["vertices"], data["faces"])


HARNESSES = (
    Harness("meshes/textured.glb", _mesh(".glb"), "a.glb", "header", _textured),
    Harness("meshes/drawn.npz", _drawn, "drawn.npz", "npz", _read_drawn),
    Harness("truth/depth.npz", _truth, "depth/b.npz", "npz", _read_truth),
    *(Harness(f"meshes/{s[1:]}", _mesh(s), f"a{s}", kind, _load(s), share=0.5) for s, kind in _KINDS.items()),
    Harness("truth/room.npz", _true_room, "room.npz", "npz", _read_true_room),
)
