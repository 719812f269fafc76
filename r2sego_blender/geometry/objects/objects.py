"""The objects a person declared: their masks, perhaps a mesh and a pose of its own.

They stand in the bundle's ``objects/<name>/``:

    masks/<stem>.png      white where the photograph shows the object; no file, not drawn.
                          ``layout.mask_stems``: the stems are the photographs'
    mesh.glb              the shape, where the person gives one (any of ``MESH_SUFFIXES``)
    placement.json        its pose by hand: ``world_from_own`` (4, 4), and ``locked``
    decision.json         ``decision``: "accept" or "reject" its prior, whatever the figures say
    backends.json         whence ``masks`` and ``mesh`` are, where no person made them
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import trimesh

from ...bundle import layout
from ...bundle.artifacts import Artifact
from ...bundle.layout import mask_stems
from ...captures.capture import Capture
from ...core.errors import GeometryError
from ...core.file_names import plain_name
from ...core.images import load_image_uint8, save_image, stored_values
from ...core.json_files import read_json, write_json
from ...core.text_files import opened_file, write_text
from ..mesh.mesh_files import LARGEST, MESH_SUFFIXES
from .shapes import load_shape

_WHITE = 128
_ASPECT_TOLERANCE = 0.02
_MOST_GLTF_BYTES = 1 << 30
_MOST_OBJECTS = 1024
"""Of images that number them: each has masks of its own, and a photograph has thousands of values."""


ACCEPT, REJECT = "accept", "reject"
"""What a person may decide of an object's prior; else its figures do."""


@dataclass(frozen=True)
class Placement:
    """A pose set by hand: ``world_from_own`` (4, 4) similarity. ``locked``, it is kept as it
    is; else the search begins there."""

    world_from_own: np.ndarray
    locked: bool


@dataclass(frozen=True)
class DeclaredObject:
    """``masks``: (H, W) bool at the capture's working size, by the capture's name.

    ``backends``: what made the "masks" and the "mesh", such as "SAM 3 0.1.0"; nothing for a person.
    ``decision``: ACCEPT, REJECT or nothing.
    """

    name: str
    masks: Mapping[str, np.ndarray]
    mesh: Path | None = None
    placement: Placement | None = None
    backends: Mapping[str, str] = field(default_factory=dict)
    decision: str = ""


def load_objects(folder: Path, captures: Sequence[Capture]) -> tuple[DeclaredObject, ...]:
    """The objects in the bundle's folder, in the order of their names; none if it is not there.

    Raises GeometryError naming the damaged file, CaptureError for a mask's image.
    """
    if not folder.is_dir():
        return ()
    for path in folder.rglob("*"):
        if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
            raise GeometryError("it is a link out of the objects", where=path, cure="Put the file itself there.")
    return tuple(_object(place, captures) for place in _folders(folder))


def save_objects(folder: Path, objects: Sequence[DeclaredObject], capture_names: Sequence[str]) -> None:
    """Write masks, placements and decisions as ``load_objects`` reads them; a mesh is copied.

    ``capture_names`` are those of all captures, drawn on or not. Raises GeometryError for a glTF
    mesh of several files that cannot be made one.
    """
    stems = mask_stems(capture_names)
    for one in objects:
        place = folder / one.name
        (place / "masks").mkdir(parents=True, exist_ok=True)
        for name, mask in one.masks.items():
            save_image(place / "masks" / f"{stems[name]}.png", mask.astype(np.uint8) * 255)
        if one.mesh is not None:
            _save_mesh(one.mesh, place)
        if one.placement is not None:
            pose = one.placement.world_from_own.tolist()
            placed = {"world_from_own": pose, "locked": one.placement.locked}
            write_json(place / "placement.json", placed)
        if one.backends:
            write_json(place / "backends.json", dict(one.backends))
        if one.decision:
            write_text(place / "decision.json", json.dumps({"decision": one.decision}) + "\n")


def read_masks(folder: Path, captures: Sequence[Capture]) -> tuple[DeclaredObject, ...]:
    """Masks from elsewhere, of the photographs' or the captures' size.

    Either a folder for each object with a black and white image for each photograph, or one
    image for each photograph whose values number the objects, 0 for none, with a
    ``names.json`` if they have names. Files are called as the photographs, see
    ``layout.mask_stems``. Raises GeometryError or CaptureError naming the file.
    """
    if not folder.is_dir():
        raise GeometryError("there is no such folder", where=folder, cure="Give the folder of the masks.")
    parts = [place for place in _folders(folder) if not place.name.startswith(".")]  # of a system, or of an editor
    for place in parts or [folder]:
        if not _mask_files(place, captures):
            raise GeometryError(
                "no mask belongs to a photograph of the scene",
                where=place,
                cure="Call the masks as the photographs, such as IMG_01.png, or take the folder away.",
            )
    if parts:
        objects = [DeclaredObject(plain_name(place.name), _masks(place, captures)) for place in parts]
    else:
        objects = _numbered(folder, captures)
    objects = [one for one in objects if any(mask.any() for mask in one.masks.values())]
    if not objects:
        raise GeometryError(
            "the masks show nothing: all of them are black, or nearly",
            where=folder,
            cure="Save what they show in white, 255, or without folders as the number of its object.",
        )
    return told_apart(objects)


def _folders(folder: Path) -> list[Path]:
    """The folders in a folder, by their names as every system sorts them."""
    return sorted((place for place in folder.iterdir() if place.is_dir()), key=lambda place: place.name)


def told_apart(objects: Sequence[DeclaredObject]) -> tuple[DeclaredObject, ...]:
    """With numbers after names that are taken: a scene may have two chairs."""
    taken: set[str] = set()
    found = []
    for one in objects:
        name, number = one.name, 2
        while name.lower() in taken:
            name, number = f"{one.name}_{number}", number + 1
        taken.add(name.lower())
        found.append(replace(one, name=name))
    return tuple(found)


def _save_mesh(mesh: Path, place: Path) -> None:
    """Copy a mesh into an object's folder; one of several files becomes one, of its shape alone."""
    suffix = mesh.suffix.lower()
    if suffix != ".gltf" or _has_its_buffers(mesh):
        with opened_file(mesh) as file:
            (place / f"mesh{suffix}").write_bytes(file.read())
        return
    shape = load_shape(mesh)
    trimesh.Trimesh(shape.vertices, shape.faces, process=False).export(place / "mesh.glb")


def _has_its_buffers(gltf: Path) -> bool:
    try:
        buffers = read_json(gltf, _MOST_GLTF_BYTES).get("buffers", [])
        return all(buffer.get("uri", "data:").startswith("data:") for buffer in buffers)
    except (OSError, AttributeError, TypeError, ValueError):
        return False  # damaged, which reading it says


def _object(place: Path, captures: Sequence[Capture]) -> DeclaredObject:
    meshes = [place / f"mesh{suffix}" for suffix in MESH_SUFFIXES]
    mesh = next((path for path in meshes if path.is_file()), None)
    masks = _masks(place / "masks", captures) if (place / "masks").is_dir() else {}
    found = DeclaredObject(
        place.name,
        masks,
        mesh,
        backends=read_backends(place / "backends.json"),
        decision=_decision(place / "decision.json"),
    )
    path = place / "placement.json"
    return replace(found, placement=read_placement(path)) if path.is_file() else found


def read_backends(path: Path) -> dict[str, str]:
    """What made an object's "masks" and "mesh" by its ``backends.json``; nothing without one.

    Raises GeometryError where it is damaged.
    """
    if not path.is_file():
        return {}
    try:
        return {str(part): str(name) for part, name in read_json(path).items()}
    except (OSError, AttributeError, ValueError) as error:
        raise GeometryError(
            "this is no record of backends", where=path, cure="Remove it; the object is then a person's."
        ) from error


def _decision(path: Path) -> str:
    if not path.is_file():
        return ""
    try:
        decision = read_json(path)["decision"]
        if decision not in (ACCEPT, REJECT):
            raise ValueError(decision)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise GeometryError("this is no decision", where=path, cure="Remove it; the figures then decide.") from error
    return decision


def read_placement(path: Path) -> Placement:
    """The placement in a JSON file: ``world_from_own`` (4, 4) and ``locked``. Raises GeometryError."""
    try:
        data = read_json(path)
        pose = np.array(data["world_from_own"], np.float64)
        if pose.shape != (4, 4) or not np.abs(pose).max() <= LARGEST:
            raise ValueError("world_from_own is no 4x4 matrix of finite numbers")
        linear = pose[:3, :3]
        scale = np.cbrt(np.linalg.det(linear))
        if not scale > 0:
            raise ValueError("world_from_own is no similarity")
        if np.abs(linear @ linear.T - scale**2 * np.eye(3)).max() > 1e-3 * scale**2:
            raise ValueError("world_from_own stretches the shape")
        return Placement(pose, bool(data.get("locked", False)))
    except (OSError, KeyError, TypeError, ValueError, IndexError) as error:
        raise GeometryError(
            f"this is no placement ({error})", where=path, cure="Remove it, or place the shape again."
        ) from error


def _masks(folder: Path, captures: Sequence[Capture]) -> dict[str, np.ndarray]:
    files = _mask_files(folder, captures)
    found = {}
    for capture in captures:
        path = files.get(capture.name)
        if path is not None:
            image = load_image_uint8(path)
            grey = image if image.ndim == 2 else image.max(axis=2)
            found[capture.name] = _at_working_size(grey >= _WHITE, capture, path)
    return found


def _numbered(folder: Path, captures: Sequence[Capture]) -> list[DeclaredObject]:
    files = _mask_files(folder, captures)
    names_file = folder / "names.json"
    try:
        names = dict(read_json(names_file)) if names_file.is_file() else {}
    except (OSError, TypeError, ValueError) as error:
        raise GeometryError("this is no JSON of names", where=names_file, cure="Correct or remove it.") from error
    masks: dict[int, dict[str, np.ndarray]] = {}
    for capture in captures:
        path = files.get(capture.name)
        if path is None:
            continue
        numbers = stored_values(path)
        if numbers is None:
            raise GeometryError("the mask cannot be read", where=path, cure="Replace or remove the file.")
        if numbers.ndim != 2:
            raise GeometryError(
                "the mask is coloured, so its values are no numbers of objects",
                where=path,
                cure="Save it with one channel, or make a folder for each object.",
            )
        for number in np.unique(numbers[numbers > 0]).tolist():
            if len(masks.setdefault(number, {})) == 0 and len(masks) > _MOST_OBJECTS:
                raise GeometryError(
                    f"the masks number more than {_MOST_OBJECTS} objects", where=path, cure="Save numbers, no picture."
                )
            masks[number][capture.name] = _at_working_size(numbers == number, capture, path)
    return [
        DeclaredObject(plain_name(str(names.get(str(number), f"object_{number:02d}"))), found)
        for number, found in sorted(masks.items())
    ]


def _at_working_size(mask: np.ndarray, capture: Capture, path: Path) -> np.ndarray:
    """A mask of the photograph, or of the undistorted capture, as the capture's camera sees it.

    Raises GeometryError for one of another shape, as of a photograph that was not turned upright.
    """
    shape = capture.camera.shape
    if mask.shape == shape:
        return mask
    (height, width), (wide, high) = mask.shape, capture.photograph_size
    if abs(width * high / (height * wide) - 1.0) > _ASPECT_TOLERANCE:
        raise GeometryError(
            f"the mask is {width}x{height}, its photograph {wide}x{high}",
            where=path,
            cure="Save it as large as the photograph, and upright as that is shown.",
        )
    image = mask.astype(np.float32)
    if capture.lens is not None:  # though the capture's own image is straight already
        lens = capture.lens.scaled_to(mask.shape[1], mask.shape[0])
        image = lens.straightened(image, 2 * max(shape))
    return cv2.resize(image, shape[::-1], interpolation=cv2.INTER_AREA) > 0.5


def _mask_files(folder: Path, captures: Sequence[Capture]) -> dict[str, Path]:
    """The masks in a folder by the captures' names. Raises GeometryError where one may be of several."""
    files = {path.stem: path for path in sorted(folder.iterdir()) if path.suffix.lower() == ".png"}
    stems = mask_stems([capture.name for capture in captures])
    for stem in sorted(files.keys() - stems.values()):
        if alike := [name for name in stems if Path(name).stem == stem]:
            raise GeometryError(
                f"the mask may be of {' or of '.join(alike)}",
                where=files[stem],
                cure=f"Call it {' or '.join(f'{stems[name]}.png' for name in alike)}.",
            )
    return {name: files[stem] for name, stem in stems.items() if stem in files}


@dataclass(frozen=True)
class ObjectsFolder:
    """The declared objects of a bundle; their masks are read against its captures."""

    folder: Path

    def of(self, captures: Sequence[Capture]) -> tuple[DeclaredObject, ...]:
        """The objects; see ``load_objects``."""
        return load_objects(self.folder, captures)


OBJECTS = Artifact(layout.OBJECTS, ObjectsFolder)
"""What a person declared for shape priors."""
