"""A textured mesh as OBJ, for simulators: beside it its material, its texture and MuJoCo's scene of it."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree

import numpy as np

from .textured_mesh import TexturedMesh

_HALF, _NONE = "0.5 0.5 0.5", "0 0 0"


BESIDE = (".png", ".mtl", ".xml")
"""Suffixes of the files that ``obj_files`` has beside its .obj."""


def obj_files(mesh: TexturedMesh, stem: str) -> dict[str, bytes]:
    """The files by name, each after those that it names: ``stem``.png, .mtl, .xml and .obj.

    The mesh is in the world frame, metres and Z up. The .xml is MJCF of a mesh that collides with
    nothing and weighs nothing, in group 2, as visual geometry is by custom.
    """
    return {
        f"{stem}.png": mesh.png(),
        f"{stem}.mtl": f"newmtl baked\nKd 1 1 1\nKs 0 0 0\nmap_Kd {stem}.png\n".encode(),
        f"{stem}.xml": _mjcf(stem),
        f"{stem}.obj": _obj(mesh, stem),
    }


def _obj(mesh: TexturedMesh, stem: str) -> bytes:
    text = io.StringIO()
    text.write(f"mtllib {stem}.mtl\nusemtl baked\n")
    np.savetxt(text, mesh.vertices, "v %.7g %.7g %.7g")
    np.savetxt(text, mesh.uvs * [1, -1] + [0, 1], "vt %.7g %.7g")  # OBJ counts v upwards
    np.savetxt(text, np.repeat(mesh.faces + 1, 2, axis=1), "f %d/%d %d/%d %d/%d")
    return text.getvalue().encode()


def _mjcf(stem: str) -> bytes:
    """The light is in the texture: half of it glows, half is lit, the same from all sides here. So a
    robot that this is put beside has its own light, and the room is neither dark nor glaring in it."""
    root = ElementTree.Element("mujoco", model=stem)
    visual = ElementTree.SubElement(root, "visual")
    ElementTree.SubElement(visual, "headlight", ambient=_HALF, diffuse=_NONE, specular=_NONE)
    assets = ElementTree.SubElement(root, "asset")
    ElementTree.SubElement(assets, "texture", name="baked", type="2d", file=f"{stem}.png")
    ElementTree.SubElement(
        assets, "material", name="baked", texture="baked", emission="0.5", specular="0", shininess="0"
    )
    ElementTree.SubElement(assets, "mesh", name="baked", file=f"{stem}.obj", inertia="shell")
    world = ElementTree.SubElement(root, "worldbody")
    ElementTree.SubElement(
        world,
        "geom",
        name="baked",
        type="mesh",
        mesh="baked",
        material="baked",
        group="2",
        contype="0",
        conaffinity="0",
        mass="0",
    )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8") + b"\n"
