"""The files of a collision surface: meshes, convex pieces, and the scenes of simulators.

MJCF, URDF and SDF name the pieces by paths relative to their own file, so the folder can be moved.
Everything is in metres, Z up, in the world frame; glTF alone is Y up, as that format demands.
"""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import trimesh

from ...bundle import layout
from ...bundle.artifacts import Artifact
from ...core.errors import GeometryError
from ...core.text_files import read_text, write_text
from ...splats.formats.values import Y_UP_FROM_WORLD
from .collision import CollisionSurface
from .floor_box import FloorBox

_MOST_BYTES = 256 << 20
MESH_OBJ, MESH_STL, MESH_GLB = "mesh.obj", "mesh.stl", "mesh.glb"
HULLS = "hulls"
SCENE_XML, SCENE_URDF, SCENE_SDF, SCENE_USD = "scene.xml", "scene.urdf", "scene.sdf", "scene.usd"
FLOOR = "floor"
"""The name of the floor's box in every scene."""

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_FLOOR_RGBA, _PIECE_RGBA = "0.6 0.6 0.6 1", "0.7 0.75 0.8 1"


def write_collision(surface: CollisionSurface, folder: Path) -> None:
    """Write the surface in all its forms.

    ``mesh.obj``, ``mesh.stl``, ``mesh.glb``: the simplified surface; ``hulls/*.obj``: the
    convex pieces; ``scene.xml`` (MJCF), ``scene.urdf`` (one fixed link), ``scene.sdf`` (one static
    model) and ``scene.usd`` (UsdPhysics): the pieces and the floor's box as static colliders.
    """
    from .collision_usd import write_usd

    folder.mkdir(parents=True, exist_ok=True)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    write_text(folder / MESH_OBJ, obj_text(surface.vertices, surface.faces))
    for name, one in ((MESH_STL, mesh), (MESH_GLB, mesh.copy().apply_transform(Y_UP_FROM_WORLD))):
        written = one.export(file_type=Path(name).suffix[1:])
        assert isinstance(written, bytes)
        (folder / name).write_bytes(written)
    hulls = folder / HULLS
    if hulls.exists():
        shutil.rmtree(hulls)
    hulls.mkdir()
    names = [f"piece_{index:04d}" for index in range(len(surface.pieces))]
    for name, (vertices, faces) in zip(names, surface.pieces, strict=True):
        write_text(hulls / f"{name}.obj", obj_text(vertices, faces))
    floor = FloorBox.of(surface.floor) if len(surface.floor) else None
    write_text(folder / SCENE_XML, _mjcf(names, floor))
    write_text(folder / SCENE_URDF, _urdf(names, floor))
    write_text(folder / SCENE_SDF, _sdf(names, floor))
    write_usd(folder / SCENE_USD, surface, names, floor)


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 and faces (F, 3) int32 of an OBJ file that ``write_collision``
    wrote. Raises GeometryError when it is missing, or is no such file."""
    try:
        lines = read_text(path, _MOST_BYTES).split("\n")
        vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], np.float64)
        faces = np.array([line.split()[1:] for line in lines if line.startswith("f ")], np.int32) - 1
        vertices, faces = vertices.reshape(-1, 3), faces.reshape(-1, 3)
        if not np.isfinite(vertices).all() or (faces < 0).any() or (faces >= len(vertices)).any():
            raise ValueError("a vertex is not finite, or a face names a vertex that is not there")
    except (OSError, ValueError, OverflowError) as error:
        raise GeometryError(
            f"this mesh cannot be read: {error}", where=path, cure="Make the collision surface again."
        ) from error
    return vertices, faces


def obj_text(vertices: np.ndarray, faces: np.ndarray) -> str:
    """A mesh of ``vertices`` (V, 3) and ``faces`` (F, 3) int as OBJ."""
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    return "\n".join(lines) + "\n"


def _mjcf(names: list[str], floor: FloorBox | None) -> str:
    """A static MuJoCo scene: the floor's box and one mesh geom for each piece.

    It sets neither a unit of angles nor a folder of meshes, which would become those of a robot that it
    is included beside.
    """
    root = ElementTree.Element("mujoco", model="room")
    assets = ElementTree.SubElement(root, "asset")
    world = ElementTree.SubElement(root, "worldbody")
    if floor is not None:
        ElementTree.SubElement(
            world,
            "geom",
            name=FLOOR,
            type="box",
            size=_numbers(floor.half),
            pos=_numbers(floor.centre),
            quat=_numbers((np.cos(floor.yaw_rad / 2), 0, 0, np.sin(floor.yaw_rad / 2))),
            rgba=_FLOOR_RGBA,
        )
    for name in names:
        # Static pieces need no inertia; "convex" never fails on a thin one.
        ElementTree.SubElement(assets, "mesh", name=name, file=f"{HULLS}/{name}.obj", inertia="convex")
        ElementTree.SubElement(world, "geom", name=name, type="mesh", mesh=name, rgba=_PIECE_RGBA)
    return _text(root)


def _urdf(names: list[str], floor: FloorBox | None) -> str:
    """A robot of one link, ``room``. It weighs nothing, which PyBullet reads as fixed: a link that
    says nothing of its mass weighs a kilogram there, and the room falls.

    Its visual is the whole mesh, its collision geometry the floor's box and the pieces.
    """
    root = ElementTree.Element("robot", name="room")
    # For MuJoCo alone, which drops the folder of a URDF's mesh files unless told otherwise.
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", strippath="false")
    link = ElementTree.SubElement(root, "link", name="room")
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value="0")
    ElementTree.SubElement(inertial, "inertia", dict.fromkeys(_INERTIA, "0"))
    visual = ElementTree.SubElement(link, "visual", name="mesh")
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "mesh", filename=MESH_OBJ)
    if floor is not None:
        collision = ElementTree.SubElement(link, "collision", name=FLOOR)
        ElementTree.SubElement(collision, "origin", xyz=_numbers(floor.centre), rpy=_numbers((0, 0, floor.yaw_rad)))
        geometry = ElementTree.SubElement(collision, "geometry")
        ElementTree.SubElement(geometry, "box", size=_numbers(2.0 * floor.half))
    for name in names:
        collision = ElementTree.SubElement(link, "collision", name=name)
        geometry = ElementTree.SubElement(collision, "geometry")
        ElementTree.SubElement(geometry, "mesh", filename=f"{HULLS}/{name}.obj")
    return '<?xml version="1.0"?>\n' + _text(root)


def _sdf(names: list[str], floor: FloorBox | None) -> str:
    """A static model ``room`` for Gazebo and Drake: SDFormat 1.7, which all their versions in use read."""
    root = ElementTree.Element("sdf", version="1.7")
    model = ElementTree.SubElement(root, "model", name="room")
    ElementTree.SubElement(model, "static").text = "true"
    link = ElementTree.SubElement(model, "link", name="room")
    _sdf_mesh(ElementTree.SubElement(link, "visual", name="mesh"), MESH_OBJ)
    if floor is not None:
        collision = ElementTree.SubElement(link, "collision", name=FLOOR)
        ElementTree.SubElement(collision, "pose").text = _numbers((*floor.centre, 0, 0, floor.yaw_rad))
        box = ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), "box")
        ElementTree.SubElement(box, "size").text = _numbers(2.0 * floor.half)
    for name in names:
        _sdf_mesh(ElementTree.SubElement(link, "collision", name=name), f"{HULLS}/{name}.obj")
    return '<?xml version="1.0"?>\n' + _text(root)


def _sdf_mesh(parent: ElementTree.Element, file: str) -> None:
    mesh = ElementTree.SubElement(ElementTree.SubElement(parent, "geometry"), "mesh")
    ElementTree.SubElement(mesh, "uri").text = file


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _save(surface: CollisionSurface, folder: Path) -> None:
    write_collision(surface, folder)


def _opened_by_others(folder: Path) -> Path:
    """Simulators open the files by themselves."""
    return folder


COLLISION = Artifact("collision", _opened_by_others, _save, editable=False)
"""A round's collision surface: ``COLLISION.of_round(l)``."""

REFINED_COLLISION = Artifact(layout.COLLISION, _opened_by_others, editable=False)
"""The current one, at the top of the bundle."""
