"""Reading a robot's file: an MJCF or URDF whose files MuJoCo never opens itself.

The XML is read here, its includes are put in, and every file that it names is looked for inside
the robot's folder alone and read into memory; MuJoCo gets the text and those files. So
nothing outside the folder is read, and what was checked is what is used. What a robot has no
need of (textures, sensors, the simulation's options, the world's own floor and lights) is
left out; what could run code, or make something huge of a short text, is refused.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import mujoco
import numpy as np

from ...core.errors import RobotError
from .humanoid import humanoid_mjcf
from .robot_folder import RobotFolder, check_relative
from .safe_xml import Element, parse_xml
from .wheeled_base import wheeled_base_mjcf

EMBEDDED_HUMANOID = "embedded:humanoid"
EMBEDDED_WHEELED = "embedded:wheeled"

EMBEDDED = {EMBEDDED_HUMANOID: humanoid_mjcf, EMBEDDED_WHEELED: wheeled_base_mjcf}
"""The robots that come with the library, by name: what writes their MJCF."""

_MOST_INCLUDES = 50
_MOST_COPIES, _DEEPEST = 20_000, 150
_MESH_FILES = {".stl", ".obj", ".msh"}
# URDF has no word for the inertia of gears and rotors, without which light links jitter.
_URDF_ARMATURE_KG_M2 = 0.01
# Frames of a URDF (sensors, grips) are often written as links without a mass or with an inertia that no
# body has, which MuJoCo refuses. Least values of a link's are those that its documentation names.
_LEAST_MASS_KG, _LEAST_INERTIA_KG_M2 = 1e-3, 1e-5
_ABOUT_INERTIAS = re.compile(r"balanceinertia|positive eigenvalues|mass and inertia of moving bodies")
_BOUNDS = (
    f'Correct the file, or put <compiler balanceinertia="true" boundmass="{_LEAST_MASS_KG:g}" '
    f'boundinertia="{_LEAST_INERTIA_KG_M2:g}"/> below <mujoco>.'
)

# What a robot is made of, by the root's tag; the rest is left out.
_KEPT = {
    "mujoco": {"compiler", "default", "asset", "worldbody", "equality", "tendon", "actuator", "keyframe"},
    "robot": {"link", "joint", "material", "mujoco"},
}
_LEFT_OUT_ASSETS = {"texture", "hfield", "skin"}
_WORLD_FRAMES = {"worldbody", "frame", "replicate"}
_OF_THE_WORLD = {"geom", "light", "camera"}
_REFUSED = {
    "extension": "plugins",
    "plugin": "plugins",
    "composite": "composite objects",
    "flexcomp": "deformable objects",
    "flex": "deformable objects",
    "attach": "other models",
    "model": "other models",
}
# Attributes whose mere value makes much of little.
_REFUSED_ATTRIBUTES = {
    "plugin": "plugins",
    "builtin": "built-in meshes",
    "octree_maxdepth": "distance fields",
    "nsample": "delays",
}
_REFUSED_SHAPES = {"hfield": "height fields", "sdf": "distance fields"}


def robot_spec(source: str, bounded: bool = False) -> mujoco.MjSpec:
    """The robot alone, editable: without the floor, lights and cameras of its file's world.

    Every body, joint and camera has a name; a URDF gets a free base, and joints with some armature.
    ``source`` is an embedded robot's name or a path; ``bounded`` balances inertias that no body has,
    and lifts masses to 1 g and inertias to 1e-5 kg m2. Raises RobotError, before MuJoCo sees
    anything, where the file is missing, unreadable or not to be trusted; and with MuJoCo's
    words where it is no robot.
    """
    if source in EMBEDDED:
        return mujoco.MjSpec.from_string(EMBEDDED[source]())
    path = Path(source)
    if not path.is_file():
        raise RobotError(
            "this is a folder, no robot file" if path.is_dir() else "there is no such robot file",
            where=source,
            cure=f"Give an MJCF, a URDF or one of: {', '.join(EMBEDDED)}.",
        )
    root, files = gather_robot(path)
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"), assets=files)
    except (ValueError, mujoco.FatalError) as error:
        raise does_not_compile(source, error) from error
    if root.tag == "robot" and spec.worldbody.bodies:
        spec.compiler.fusestatic = False
        for joint in spec.joints:
            if joint.type != mujoco.mjtJoint.mjJNT_FREE:
                joint.armature = _URDF_ARMATURE_KG_M2
        if not any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints):
            spec.worldbody.bodies[0].add_freejoint()
    if bounded:
        compiler = spec.compiler
        compiler.balanceinertia = True
        compiler.boundmass = max(compiler.boundmass, _LEAST_MASS_KG)
        compiler.boundinertia = max(compiler.boundinertia, _LEAST_INERTIA_KG_M2)
    for kind, elements in (("body", spec.bodies[1:]), ("joint", spec.joints), ("camera", spec.cameras)):
        for index, element in enumerate(elements):
            element.name = element.name or f"unnamed {kind} {index}"
    return spec


def compiled_robot(source: str) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    """The robot of ``robot_spec``, compiled, and the links whose inertias were bounded for it.

    Those of a URDF are where MuJoCo refuses the file's own: its format has no other way to
    write a frame. Raises RobotError as ``robot_spec`` does.
    """
    spec = robot_spec(source)
    try:
        return spec.compile(), ()
    except (ValueError, mujoco.FatalError) as error:
        if not _ABOUT_INERTIAS.search(str(error)) or gather_robot(Path(source))[0].tag != "robot":
            raise does_not_compile(source, error, _BOUNDS) from error
    spec = robot_spec(source, bounded=True)
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise does_not_compile(source, error) from error
    return model, tuple(body.name for body in spec.bodies[1:] if _is_bounded(body, model))


def _is_bounded(body: mujoco.MjsBody, model: mujoco.MjModel) -> bool:
    """Whether a link's mass or inertia is another in ``model`` than in its file, or was none."""
    if not body.explicitinertial:
        return bool(model.body(body.name).mass[0] <= _LEAST_MASS_KG)
    xx, yy, zz, xy, xz, yz = body.fullinertia
    own = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    found = np.sort(model.body(body.name).inertia)
    return bool(model.body(body.name).mass[0] != body.mass or not np.allclose(own, found, rtol=1e-6, atol=0.0))


def does_not_compile(source: str, error: Exception, about_inertia: str = "") -> RobotError:
    """MuJoCo's words as an error; its line numbers count another text and are left out."""
    words = re.sub(r",? line -?\d+", "", " ".join(str(error).split())).rstrip(".")
    cure = (
        about_inertia if about_inertia and _ABOUT_INERTIAS.search(words) else "Correct the file or give another robot."
    )
    return RobotError(f"the robot does not compile: {words}", where=source, cure=cure)


def gather_robot(path: Path) -> tuple[Element, dict[str, bytes]]:
    """The robot's tree, which names no file but those returned with it, by their new names.

    Raises RobotError as ``robot_spec`` does.
    """
    folder = RobotFolder.of(path)
    root = _tree(folder, folder.main, str(path))
    if root.tag not in _KEPT:
        raise RobotError(f"<{root.tag}> is no robot", where=root.at(), cure="Give an MJCF or a URDF.")
    _put_includes_in(folder, root, {folder.main})
    if root.tag == "mujoco":
        for element in root.iter():
            if element.tag in _REFUSED:
                raise _refused(element, "", _REFUSED[element.tag])
    root[:] = [child for child in root if child.tag in _KEPT[root.tag]]
    if root.tag == "robot":
        _reduce_urdf(root)
    _check_names(folder, root)
    _leave_out(root)
    _check_size(root)
    _check_masses(root)
    for element in root.iter():
        for attribute in element.keys() & _REFUSED_ATTRIBUTES.keys():
            raise _refused(element, attribute, _REFUSED_ATTRIBUTES[attribute])
        if element.tag == "geom" and (shape := element.get("type", "")) in _REFUSED_SHAPES:
            raise _refused(element, "type", _REFUSED_SHAPES[shape])
    return root, _take_meshes(folder, root)


def robot_digest(source: str) -> str:
    """SHA-256 of all that a robot's file is made of, its includes and meshes too.

    '' for an embedded robot, and where the file cannot be read.
    """
    if source in EMBEDDED:
        return ""
    try:
        root, files = gather_robot(Path(source))
    except RobotError:
        return ""
    digest = hashlib.sha256(ElementTree.tostring(root))
    for name in sorted(files):
        digest.update(name.encode() + hashlib.sha256(files[name]).digest())
    return digest.hexdigest()


def _tree(folder: RobotFolder, path: Path, at: str) -> Element:
    return parse_xml(folder.read(path, at), path)


def _put_includes_in(folder: RobotFolder, root: Element, seen: set[Path]) -> None:
    """Replace every <include> by the children of its file's root, as MuJoCo would."""
    parents = [root]
    while parents:
        parent = parents.pop()
        while (include := parent.find("include")) is not None:
            at, name = include.at("file"), include.get("file", "")
            path = folder.find(name, _beside(folder, include), at)
            if path in seen or len(seen) > _MOST_INCLUDES:
                raise RobotError(
                    f"'{name}' is included again, or as one of too many", where=at, cure="Include it once."
                )
            seen.add(path)
            place = list(parent).index(include)
            parent[place : place + 1] = list(_tree(folder, path, at))
        parents.extend(parent)


def _reduce_urdf(root: Element) -> None:
    """Leave MuJoCo its compiler settings only, and no pictures of links unless it asks for them."""
    for extension in root.findall("mujoco"):
        extension[:] = extension.findall("compiler")
    settings = [element.get("discardvisual") for element in root.iter("compiler")]
    if "false" not in settings:
        for link in root.findall("link"):
            link[:] = [child for child in link if child.tag != "visual"]


def _check_names(folder: RobotFolder, root: Element) -> None:
    """Refuse names of files where a robot has none, and folders and pictures outside the robot's."""
    folders = _folders(folder, root)
    for element in root.iter():
        for attribute in (name for name in element.attrib if name.startswith("file")):
            if element.tag not in {"mesh", *_LEFT_OUT_ASSETS}:
                raise _refused(element, attribute, "files here")
            if element.tag in _LEFT_OUT_ASSETS:
                kind = "texturedir" if element.tag == "texture" else "meshdir"
                bases = folders.get(kind) or _beside(folder, element)
                folder.places(element.attrib[attribute], bases, element.at(attribute))


def _beside(folder: RobotFolder, element: Element) -> list[Path]:
    """Where a name of ``element`` begins: the robot's file, or the included one that it stands in."""
    return [folder.main.parent, element.source.parent]


def _folders(folder: RobotFolder, root: Element) -> dict[str, list[Path]]:
    """Where meshes and textures may be; as in MuJoCo the last word counts, and a kind's own before both's."""
    found = {}
    for compiler in root.iter("compiler"):
        for attribute in ("assetdir", "meshdir", "texturedir"):
            if attribute in compiler.attrib:
                bases = _beside(folder, compiler)
                found[attribute] = folder.places(compiler.attrib[attribute], bases, compiler.at(attribute))
    both = found.pop("assetdir", None)
    return ({"meshdir": both, "texturedir": both} if both else {}) | found


def _leave_out(root: Element) -> None:
    """Drop pictures, the world's own shapes and fixed bodies, and what only a simulation needs."""
    for asset in root.findall("asset"):
        asset[:] = [child for child in asset if child.tag not in _LEFT_OUT_ASSETS]
    for material in root.iter("material"):
        material.attrib.pop("texture", None)
        material[:] = [child for child in material if child.tag not in {"texture", "layer"}]
    for compiler in root.iter("compiler"):
        compiler[:] = []
    has_robot = any(_moves(body) for body in root.iter("body"))
    frames = root.findall("worldbody")
    while frames:
        frame = frames.pop()
        frame[:] = [
            child
            for child in frame
            if child.tag not in _OF_THE_WORLD and (child.tag != "body" or _moves(child) or not has_robot)
        ]
        frames.extend(child for child in frame if child.tag in _WORLD_FRAMES)
    for key in root.iter("key"):  # poses of bodies left out
        for attribute in ("mpos", "mquat"):
            key.attrib.pop(attribute, None)


def _moves(body: ElementTree.Element) -> bool:
    """Whether a body of the world, or one below it, has a joint."""
    return any(element.tag in {"joint", "freejoint"} for element in body.iter())


def _check_size(root: Element) -> None:
    """Refuse what <replicate> makes too many of, and too deep a tree of includes."""
    copies, waiting = 0, [(root, 1, 0)]
    while waiting:
        element, factor, depth = waiting.pop()
        if element.tag == "replicate":
            count = element.get("count", "1").strip()
            factor *= int(count) if count.isascii() and count.isdecimal() and len(count) < 10 else _MOST_COPIES
        copies += factor
        if copies > _MOST_COPIES or depth > _DEEPEST:
            raise RobotError(
                f"the file makes more than {_MOST_COPIES} elements, or more than {_DEEPEST} levels",
                where=element.at(),
                cure="Write fewer copies.",
            )
        waiting.extend((child, factor, depth + 1) for child in element)


def _check_masses(root: Element) -> None:
    """Refuse negative masses, which MuJoCo lets take away from a link that is fixed to another."""
    for element in root.iter():
        attribute = {"mass": "value", "inertial": "mass"}.get(element.tag, "")
        with contextlib.suppress(ValueError):  # what is no number is for MuJoCo to tell
            if float(element.get(attribute, "0")) < 0.0:
                raise RobotError("the mass is negative", where=element.at(attribute), cure="Give kilograms.")


def _take_meshes(folder: RobotFolder, root: Element) -> dict[str, bytes]:
    """The content of every mesh file by a new name, without folders, which the tree then has."""
    is_urdf = root.tag == "robot"
    attribute = "filename" if is_urdf else "file"
    strip = [value for e in root.iter("compiler") if (value := e.get("strippath"))]
    folders = _folders(folder, root).get("meshdir")
    files: dict[str, bytes] = {}
    names: dict[Path, str] = {}
    for element in root.iter("mesh"):
        name = element.get(attribute)
        if name is None:
            continue
        at = element.at(attribute)
        bases = folders or _beside(folder, element)
        if (strip[-1] == "true") if strip else is_urdf:
            path = _find_stripped(folder, name, bases, at)
        else:
            path = folder.find(name, bases, at)
        if path.suffix.lower() not in _MESH_FILES:
            raise RobotError(f"'{name}' is no STL, OBJ or MSH mesh", where=at, cure="Convert it to one of them.")
        if path not in names:
            names[path] = path.name if path.name not in files else f"{len(files)}-{path.name}"
            files[names[path]] = folder.read(path, at)
        element.set(attribute, names[path])
        if not is_urdf and element.get("name") is None:
            element.set("name", path.stem)
    for compiler in root.iter("compiler"):
        for setting in ("assetdir", "meshdir", "texturedir", "strippath"):
            compiler.attrib.pop(setting, None)
    return files


def _find_stripped(folder: RobotFolder, name: str, bases: list[Path], at: str) -> Path:
    """The last part of ``name`` in ``bases``, where MuJoCo looks for a URDF's; else as it is written."""
    if not name.startswith("package://"):
        check_relative(name, at)
        last = PurePosixPath(name).name
        if any((base / last).exists() for base in bases):
            return folder.find(last, bases, at)
    return folder.find(name, [folder.main.parent], at)


def _refused(element: Element, attribute: str, what: str) -> RobotError:
    return RobotError(f"a robot may have no {what}", where=element.at(attribute), cure="Remove it.")
