"""Depth maps of a sensor beside the photographs: LiDAR of a phone, an RGB-D camera, a render."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.layout import mask_stems
from ...core.arrays import arrays_of, load_array
from ...core.errors import CaptureError, NativeError
from ...core.file_names import by_stem, caseless
from ...core.image_sizes import require_sensible_size
from ...core.images import stored_values
from ...core.resources import limit_memory
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..capture import Capture

_SUFFIXES = (".png", ".tif", ".tiff", ".exr", ".npy", ".npz")
_CONFIDENCE_SUFFIXES = (".png", ".tif", ".tiff")
_FARTHEST_M = 100.0
_LEAST, _MOST = 1e-6, 1e6  # of numbers whose unit is their file's own
_LARGEST_FILE_BYTES = 256 * 1024 * 1024
_MOST_EXR_BYTES = 4 << 30
_ASPECT_TOLERANCE = 0.02
_EXR_TIMEOUT_S = 60.0
# ARKit has three levels of confidence, 0 to 2, which some apps spread over 8 bits.
_HIGHEST_CONFIDENCE = (2, 255, 65535)
_LESS_SURE = 2.0


MILLIMETRE_M = 0.001
"""The usual unit of depth maps of whole numbers."""


@dataclass(frozen=True)
class SensorDepth:
    """A folder of depth maps that are called as the photographs are, but for the suffix; those of
    photographs that share a name as ``layout.mask_stems`` calls them.

    Whole numbers are of ``unit_m`` metres (16-bit PNG or TIFF), floats metres (EXR, NPY, or NPZ with
    an array ``depth`` or a single one); depth is planar, 0 unknown, of any size with the
    photograph's shape. Where ``confidence`` has a map of the same name its zeros are not
    believed, nor is depth beyond ``range_m``. Where a file of poses names the maps, ``files`` has
    them by the captures' names, and they alone count, as do ``confidence_files``.
    """

    folder: Path
    confidence: Path | None = None
    range_m: float = _FARTHEST_M
    unit_m: float = MILLIMETRE_M
    files: Mapping[str, Path] = field(default_factory=dict)
    confidence_files: Mapping[str, Path] = field(default_factory=dict)

    @staticmethod
    def beside(folder: Path, unit_m: float = MILLIMETRE_M) -> SensorDepth:
        """The maps in ``folder``, with those of a folder ``confidence`` next to it, if any."""
        if not folder.is_dir():
            raise CaptureError("there is no such folder", where=folder, cure="Give the folder of depth maps.")
        confidence = folder.parent / "confidence"
        return SensorDepth(folder, confidence if confidence.is_dir() else None, unit_m=unit_m)

    def require_maps_of(self, names: Sequence[str]) -> None:
        """Raises CaptureError where the folder has maps of fewer than two of the photographs of these names."""
        maps = _maps_by_stem(self.folder, _SUFFIXES)
        found = sum(_one_of(maps, self.folder, stem) is not None for stem in mask_stems(names).values())
        if found < 2:
            raise CaptureError(
                f"it has depth maps of {found} of {len(names)} photographs",
                where=self.folder,
                cure=f"Call depth maps as the photographs, such as {Path(names[0]).stem}.png, and give at least two.",
            )

    def of(self, capture: Capture, stem: str) -> np.ndarray | None:
        """The map (h, w) float32 of a capture's upright photograph in metres, 0 = unknown.

        ``stem`` is what its files are called. None when there is none. Raises CaptureError
        when it is damaged or of another shape.
        """
        found = self.with_doubt(capture, stem)
        return None if found is None else found[0]

    def with_doubt(self, capture: Capture, stem: str) -> tuple[np.ndarray, np.ndarray] | None:
        """As ``of``, with how many times its usual error each depth may be off (h, w) float32.

        That is 1 at the sensor's highest confidence and twice that below.
        """
        path = self.files.get(capture.name) if self.files else _named(self.folder, stem, _SUFFIXES)
        if path is None:
            return None
        depth = _metres(path, self.unit_m)
        doubt: np.ndarray = np.ones(depth.shape, np.float32)
        sure = self.confidence_files.get(capture.name)
        if self.confidence is not None and not self.files:
            sure = _named(self.confidence, stem, _CONFIDENCE_SUFFIXES)
        if sure is not None:
            believed = _read_image(sure)
            if believed.shape != depth.shape:
                raise CaptureError(
                    f"the confidence is {believed.shape[1]}x{believed.shape[0]}, the depth "
                    f"{depth.shape[1]}x{depth.shape[0]}",
                    where=sure,
                    cure="Export both again.",
                )
            depth[believed == 0] = 0.0
            most = believed.max(initial=0)
            highest = next((level for level in _HIGHEST_CONFIDENCE if most <= level), None)
            if highest is None:  # NaN, too
                raise CaptureError(
                    f"it goes up to {most:g}, which is no confidence",
                    where=sure,
                    cure="Give levels of 0 to 2, or of 8 or 16 bits, or take the file away.",
                )
            doubt[believed < highest] = _LESS_SURE
        depth[depth > self.range_m] = 0.0
        return _upright(depth, capture, path), _upright(doubt, capture, path)


def _named(folder: Path, stem: str, suffixes: tuple[str, ...]) -> Path | None:
    """The file of this name with one of the suffixes; as ``_one_of``."""
    return _one_of(_maps_by_stem(folder, suffixes), folder, stem)


def _maps_by_stem(folder: Path, suffixes: tuple[str, ...]) -> Mapping[str, Sequence[Path]]:
    """What has one of the suffixes in a folder."""
    return by_stem(path for path in folder.iterdir() if path.suffix.lower() in suffixes)


def _one_of(files: Mapping[str, Sequence[Path]], folder: Path, stem: str) -> Path | None:
    """The file of this name, else of one that differs in case or in how Unicode composes it.

    Raises CaptureError where there are several: a model's program writes a picture to look at beside each map.
    """
    alike = sorted(path for path in files.get(caseless(stem), ()) if path.is_file())
    found = [path for path in alike if path.stem == stem] or alike
    if len(found) > 1:
        raise CaptureError(
            f"{' and '.join(path.name for path in found)} may both be the map of one photograph",
            where=folder,
            cure="Keep one of them there.",
        )
    return found[0] if found else None


def map_in_own_unit(folder: Path, stem: str, capture: Capture) -> np.ndarray | None:
    """The map (h, w) float32 of a capture's upright photograph as its file in ``folder`` has it, 0 = unknown.

    Its unit is the file's own. None when there is no file. Raises CaptureError as ``SensorDepth.of``.
    """
    path = _named(folder, stem, _SUFFIXES)
    if path is None:
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # what is no depth is none in float32 either
        values = _values(path).astype(np.float32)
    known = np.isfinite(values) & (values > _LEAST) & (values < _MOST)
    return _upright(np.where(known, values, np.float32(0.0)), capture, path)


def _metres(path: Path, unit_m: float) -> np.ndarray:
    values = _values(path)
    if values.dtype == np.uint8:
        raise _unreadable(path, "it has 8 bits, which are no millimetres")
    with np.errstate(over="ignore", invalid="ignore"):  # what is no depth is none in float32 either
        metres = values.astype(np.float32) * np.float32(1.0 if values.dtype.kind == "f" else unit_m)
    return np.where(np.isfinite(metres) & (metres > 0) & (metres < _FARTHEST_M), metres, np.float32(0.0))


def _values(path: Path) -> np.ndarray:
    """The numbers (h, w) of a map's file."""
    if path.stat().st_size > _LARGEST_FILE_BYTES:
        raise _unreadable(path, "it is too large")
    suffix = path.suffix.lower()
    if suffix in (".npy", ".npz"):
        values = _read_arrays(path)
    elif suffix == ".exr":
        values = _read_exr(path)
    else:
        values = _read_image(path)
    if values.ndim == 3 and values.shape[0] == 1:  # as networks return them
        values = values[0]
    if values.ndim == 3 and values.shape[2] and values.dtype.kind in "uif":
        values = _of_equal_channels(values, path)
    if values.ndim != 2 or 0 in values.shape or values.dtype.kind not in "uif":
        raise _unreadable(path, f"it holds {values.dtype} of shape {values.shape}")
    return values


def _read_image(path: Path) -> np.ndarray:
    image = stored_values(path)
    if image is None:
        raise _unreadable(path, "it is no image")
    return _of_equal_channels(image, path) if image.ndim == 3 else image


def _of_equal_channels(values: np.ndarray, path: Path) -> np.ndarray:
    """The one channel (h, w) that an array (h, w, c) has, or has as three colours; what else it has is not depth."""
    first = values[..., 0]
    colours = values[..., :3] if values.shape[2] >= 3 else values[..., :1]
    if not all(np.array_equal(colours[..., i], first, equal_nan=True) for i in range(colours.shape[2])):
        raise _unreadable(path, "its channels differ, as those of a coloured picture of depth")
    return first


def _read_arrays(path: Path) -> np.ndarray:
    try:
        if path.suffix.lower() == ".npy":
            return load_array(path)
        with arrays_of(path) as arrays:
            if "depth" not in arrays and len(arrays) > 1:
                raise ValueError(f"of {', '.join(arrays)} none is called depth")
            return arrays["depth" if "depth" in arrays else arrays.files[0]]
    except (OSError, EOFError, ValueError, LookupError) as error:
        raise _unreadable(path, f"it holds no array ({error})") from error
    except Exception as error:  # zipfile and zlib raise their own
        raise _unreadable(path, "it is cut short") from error


def _read_exr(path: Path) -> np.ndarray:
    """In a child process: OpenEXR has ended its process over crafted files."""
    with ScratchFolder() as folder:
        copy = Path(folder, "depth.npy")
        try:
            call_in_child(read_exr_in_child, {"path": str(path), "copy": str(copy)}, timeout_s=_EXR_TIMEOUT_S)
        except NativeError as error:
            raise _unreadable(path, "it is no EXR image") from error
        return load_array(copy)


def read_exr_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Copy an EXR's channel of depth, or of brightness, to a ``.npy``; runs in a child process."""
    import OpenEXR

    limit_memory(_MOST_EXR_BYTES)
    path = Path(request["path"])
    try:
        with OpenEXR.File(str(path), header_only=True) as image:
            for part in image.parts:
                low, high = (corner.astype(np.int64) for corner in part.header["dataWindow"])
                width, height = (int(side) for side in high - low + 1)
                require_sensible_size(path, width, height, path.stat().st_size)
        with OpenEXR.File(str(path), separate_channels=True) as image:
            channels = {
                name if "." in name else f"{part.name()}.{name}".lstrip("."): channel.pixels
                for part in image.parts
                for name, channel in part.channels.items()
            }
    except CaptureError:
        raise
    except Exception as error:  # it has no class of its own
        raise _unreadable(path, "it is no EXR image") from error
    chosen = _depth_channels(list(channels))
    if not chosen or not all(np.array_equal(channels[name], channels[chosen[0]], equal_nan=True) for name in chosen):
        raise _unreadable(path, f"none of its channels {', '.join(sorted(channels))} is called Z or depth")
    np.save(request["copy"], channels[chosen[0]])
    return {}


def _depth_channels(names: Sequence[str]) -> list[str]:
    """Those of an EXR's channels that are its depth, if they are equal: of a renderer's layers ``Depth.Z``."""
    visible = [name for name in names if name.rpartition(".")[2] != "A"]
    of_depth = [name for name in visible if "depth" in name.lower().split(".")]
    return ["Z"] if "Z" in names else of_depth or visible


def _upright(depth: np.ndarray, capture: Capture, path: Path) -> np.ndarray:
    """The map turned as the photograph is; sensors store both unturned.

    Only where its shape says so it is upright already.
    """
    width, height = capture.photograph_size
    for quarter_turns in (capture.quarter_turns, 0):
        turned = np.rot90(depth, -quarter_turns)
        aspect = turned.shape[1] / turned.shape[0]
        if abs(aspect / (width / height) - 1.0) <= _ASPECT_TOLERANCE:
            return np.ascontiguousarray(turned)
    raise CaptureError(
        f"the depth map is {depth.shape[1]}x{depth.shape[0]}, its photograph {width}x{height}",
        where=path,
        cure="Give depth maps that are aligned to the photographs: the same view at any size.",
    )


def _unreadable(path: Path, why: str) -> CaptureError:
    return CaptureError(
        f"this is no depth map: {why}", where=path, cure="Give 16-bit PNG in millimetres, or EXR, NPY or NPZ in metres."
    )
