"""COLMAP models, text or binary: their cameras and poses read, and captures written as one."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.cameras import RIGID_CURE, is_rigid
from ...core.errors import CaptureError, NativeError
from ...core.progress import SILENT, Progress
from ...core.resources import limit_memory
from ...core.scratch import ScratchFolder
from ...core.text_files import write_text
from ...workers.child import call_in_child
from ..capture import Capture
from ..colmap import load_pycolmap
from ..lenses.lens import Lens
from ..sparse_points import SparsePoints
from .colmap_files import check_cameras, check_cameras_text, check_images, check_images_text, model_suffix
from .finding import find_photographs
from .photographs import Photograph, with_unique_names

_TIMEOUT_S = 60.0
_MOST_MEMORY_BYTES = 8 << 30  # a garbled count must not take the machine's
# COLMAP's camera model -> the lens's (distortion.COEFFICIENTS) and how many coefficients follow
# the focal lengths and the principal point.
_LENSES = {
    "SIMPLE_PINHOLE": ("opencv", 0),
    "PINHOLE": ("opencv", 0),
    "SIMPLE_RADIAL": ("opencv", 1),
    "RADIAL": ("opencv", 2),
    "OPENCV": ("opencv", 4),
    "FULL_OPENCV": ("opencv", 8),
    "SIMPLE_FISHEYE": ("opencv_fisheye", 0),
    "FISHEYE": ("opencv_fisheye", 0),
    "SIMPLE_RADIAL_FISHEYE": ("opencv_fisheye", 1),
    "RADIAL_FISHEYE": ("opencv_fisheye", 2),
    "OPENCV_FISHEYE": ("opencv_fisheye", 4),
    "FOV": ("fov", 1),
    "EUCM": ("eucm", 2),
    "SIMPLE_DIVISION": ("division", 1),
    "DIVISION": ("division", 1),
    "THIN_PRISM_FISHEYE": ("thin_prism_fisheye", 8),
    "RAD_TAN_THIN_PRISM_FISHEYE": ("rad_tan_thin_prism_fisheye", 12),
}


def read_colmap_model(model: Path, folder: Path, progress: Progress = SILENT) -> list[Photograph]:
    """The photographs of the COLMAP model in ``model``; the image files are in ``folder``.

    Photographs that are missing are left out with a warning. ``rigs`` and ``frames`` are not
    needed, for ``images`` has the pose of each photograph; nor are its points: a damaged
    points3D.bin takes all memory.
    """
    suffix = model_suffix(model)
    if suffix is None:
        raise CaptureError(
            "there is no cameras and images file of a COLMAP model",
            where=model,
            cure="Give the folder that holds cameras.bin and images.bin, or .txt.",
        )
    told: dict[int, str] = {}
    if suffix == ".bin":
        check_cameras(model / "cameras.bin")
        check_images(model / "images.bin")
    else:
        check_cameras_text(model / "cameras.txt")
        told = check_images_text(model / "images.txt")
    try:
        found = call_in_child(read_in_child, {"model": str(model), "suffix": suffix}, timeout_s=_TIMEOUT_S)
    except NativeError as error:
        raise CaptureError(
            "the COLMAP model cannot be read", where=model, cure="It is damaged or of another format: export it again."
        ) from error
    names = [told.get(image["id"], image["name"]) for image in found["images"]]
    paths = find_photographs(names, (folder, folder / "images"), model, progress)
    photographs = []
    for image, name, path in zip(found["images"], names, paths, strict=True):
        if path is None:
            continue
        source = f"{model / ('images' + suffix)}, image {image['id']} ({name})"
        pose = _inverse(np.vstack([image["camera_from_world"], [0.0, 0.0, 0.0, 1.0]]), source)
        lens = _lens(image["camera"], f"{model / ('cameras' + suffix)}, camera {image['camera']['id']}")
        photographs.append(Photograph(name, path, lens, pose, source, stored_pixels=True))
    return with_unique_names(photographs)


def _inverse(pose: np.ndarray, source: str) -> np.ndarray:
    if not is_rigid(pose):
        raise CaptureError("the pose is not a rotation and a translation", where=source, cure=RIGID_CURE)
    return np.linalg.inv(pose)


def _lens(camera: dict[str, Any], where: str) -> Lens:
    if camera["model"] not in _LENSES:
        raise CaptureError(
            f"the camera model {camera['model']} is not supported",
            where=where,
            cure="Give perspective photographs: cut panoramas with COLMAP's panorama_sfm.py first.",
        )
    model, count = _LENSES[camera["model"]]
    fx, fy, cx, cy = camera["focal"]
    distortion = tuple(camera["extra"][:count])
    numbers = np.array([fx, fy, cx, cy, *distortion])
    if not np.isfinite(numbers).all() or min(fx, fy, camera["width"], camera["height"]) <= 0:
        raise CaptureError(
            "the camera's numbers make no sense", where=where, cure="The model is damaged: export or copy it again."
        )
    return Lens(camera["width"], camera["height"], fx, fy, cx, cy, distortion, model)


def read_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Read cameras and poses with pycolmap; runs in a child process."""
    pycolmap = load_pycolmap()
    limit_memory(_MOST_MEMORY_BYTES)
    model, suffix = Path(request["model"]), request["suffix"]
    with ScratchFolder() as folder:
        for name in ("cameras", "images"):
            shutil.copyfile(model / f"{name}{suffix}", Path(folder, f"{name}{suffix}"))
        Path(folder, f"points3D{suffix}").write_bytes(struct.pack("<Q", 0) if suffix == ".bin" else b"")
        solved = pycolmap.Reconstruction(folder)
    if suffix == ".bin":
        # Half a file of cameras, and some with flipped bytes, are read without a word.
        told = 8 + sum(24 + 8 * len(camera.params) for camera in solved.cameras.values())
        if told != (model / "cameras.bin").stat().st_size:
            raise CaptureError(
                f"the file has not the {told} bytes of its {len(solved.cameras)} cameras",
                where=model / "cameras.bin",
                cure="Export or copy the COLMAP model again.",
            )
    images = []
    for image_id in sorted(solved.images):
        image = solved.images[image_id]
        images.append(
            {
                "id": image_id,
                "name": image.name,
                "camera": camera_to_json(image.camera),
                "camera_from_world": image.cam_from_world().matrix().tolist(),
            }
        )
    return {"images": images}


def camera_to_json(camera: Any) -> dict[str, Any]:
    """A pycolmap camera as a JSON-ready dict."""
    data = {"id": camera.camera_id, "model": camera.model.name, "width": camera.width, "height": camera.height}
    if camera.model.name not in _LENSES:
        return data
    used = {*camera.focal_length_idxs(), *camera.principal_point_idxs()}
    return data | {
        "focal": [camera.focal_length_x, camera.focal_length_y, camera.principal_point_x, camera.principal_point_y],
        "extra": [float(value) for i, value in enumerate(camera.params) if i not in used],
    }


def lens_from_json(camera: dict[str, Any], where: str) -> Lens:
    """The lens of ``camera_to_json``. Raises CaptureError for models that are not supported."""
    return _lens(camera, where)


def save_colmap_model(folder: Path, captures: Sequence[Capture], sparse: SparsePoints | None) -> None:
    """Write captures and sparse points as a COLMAP text model, readable by its tools.

    Image names are the names of the captures' image files; points are in the world frame.
    """
    folder.mkdir(parents=True, exist_ok=True)
    cameras, images = ["# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy"], ["# IMAGE_ID QW QX QY QZ TX TY TZ"]
    cameras[0] += " (PINHOLE)"
    images[0] += " CAMERA_ID NAME, then X Y POINT3D_ID of each measurement"
    for index, capture in enumerate(captures):
        c, identity = capture.camera, index + 1
        cameras.append(f"{identity} PINHOLE {c.width} {c.height} {c.fx!r} {c.fy!r} {c.cx!r} {c.cy!r}")
        numbers = " ".join(
            repr(float(v)) for v in (*_quaternion(c.camera_from_world[:3, :3]), *c.camera_from_world[:3, 3])
        )
        images.append(f"{identity} {numbers} {identity} {capture.image_path.name}")
        measured = (
            []
            if sparse is None
            else [(*sparse.pixels[row, index], row) for row in np.flatnonzero(sparse.visibility[:, index])]
        )
        images.append(" ".join(f"{float(x)!r} {float(y)!r} {row + 1}" for x, y, row in measured))
    points = ["# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of each measurement"]
    if sparse is not None:
        column = np.cumsum(sparse.visibility, axis=0) - 1
        for row, (point, colour) in enumerate(zip(sparse.points, sparse.colours, strict=True)):
            track = " ".join(f"{i + 1} {column[row, i]}" for i in np.flatnonzero(sparse.visibility[row]))
            xyz = " ".join(repr(float(v)) for v in point)
            rgb = " ".join(str(int(v)) for v in colour)
            points.append(f"{row + 1} {xyz} {rgb} {float(sparse.error_px[row])!r} {track}")
    for name, lines in (("cameras", cameras), ("images", images), ("points3D", points)):
        write_text(folder / f"{name}.txt", "\n".join(lines) + "\n")


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """(4,) w, x, y, z with w >= 0 of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z]) * (-1.0 if w < 0 else 1.0)
