"""Assets as glTF with ``KHR_gaussian_splatting``: ``.glb``, or ``.gltf`` with its buffer inside."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...core.colours import linear_from_srgb
from ...core.errors import AssetError
from ...core.gltf_files import (
    BINARY_CHUNK,
    DAMAGE,
    GLB_CHUNK,
    GLB_HEADER,
    GLB_MAGIC,
    GLB_VERSION,
    JSON_CHUNK,
    cut_short,
    gltf_buffers,
    gltf_document,
    gltf_tree,
)
from ..asset import SplatAsset
from ..quaternions import to_rotation, unit_quaternions
from .files import content, publishing, require_room
from .record import SplatFormat
from .values import WORLD_FROM_Y_UP, Y_UP_FROM_WORLD, in_world, linear_scales, log_scales, logits

_EXTENSION = "KHR_gaussian_splatting"
_COLOUR_SPACE = "srgb_rec709_display"
"""Of the photographs, and so of what was trained on them."""
_POINTS, _ARRAY_BUFFER = 0, 34962
_FLOAT, _UNSIGNED_SHORT = 5126, 5123
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_HIGHEST_DEGREE = 3
_INLINE_BUFFER = "data:application/octet-stream;base64,"
_ENCODED_AT_ONCE = 3 << 18  # bytes, whole groups of three

_LARGEST_GLB = 2**32 - 1
_MOST_PRIMITIVES = 4096
"""With splats; each takes a millisecond, whatever it holds."""


def save_gltf(path: Path, asset: SplatAsset) -> None:
    """Write ``asset`` with Y up; viewers that do not know splats show coloured points.

    The axes are in the data and not in a node's rotation, which many viewers do not apply to
    the harmonics. Raises AssetError when a ``.glb`` would exceed 4 GiB.
    """
    asset = asset.finite()
    attributes = _attributes(asset.transformed(Y_UP_FROM_WORLD)) if len(asset) else {}
    size = sum(values.nbytes for values in attributes.values())
    document = _document(attributes, size)
    with publishing(path) as staging, staging.open("wb") as file:
        if path.suffix.lower() == ".glb":
            text = json.dumps(document).encode()
            text += b" " * (-len(text) % 4)
            whole = GLB_HEADER.size + 2 * GLB_CHUNK.size + len(text) + size
            if whole > _LARGEST_GLB:
                raise AssetError(
                    "the asset is too large for a .glb, which ends at 4 GiB", where=path, cure="Use .ply or .usdc."
                )
            file.write(GLB_HEADER.pack(GLB_MAGIC, GLB_VERSION, whole))
            file.write(GLB_CHUNK.pack(len(text), JSON_CHUNK) + text)
            file.write(GLB_CHUNK.pack(size, BINARY_CHUNK))
            for values in attributes.values():
                file.write(values.tobytes())
        elif attributes:
            document["buffers"][0]["uri"] = _INLINE_BUFFER
            head, mark, rest = json.dumps(document).encode().partition(_INLINE_BUFFER.encode())
            file.write(head + mark)
            buffer = b"".join(values.tobytes() for values in attributes.values())
            for start in range(0, len(buffer), _ENCODED_AT_ONCE):
                file.write(base64.b64encode(buffer[start : start + _ENCODED_AT_ONCE]))
            file.write(rest)
        else:
            file.write(json.dumps(document).encode())


def load_gltf(path: Path) -> SplatAsset:
    """Read all Gaussian splats of the file's scene, where its nodes put them.

    Buffers may be inside or in files beside it. Raises AssetError when the file is damaged,
    compressed by a further extension or holds no Gaussian splats.
    """
    data = content(path)
    try:
        document, binary = gltf_document(data, path, AssetError)
        scene = _Scene(document, gltf_buffers(document, binary, path, AssetError), path)
        assets = [in_world(asset, WORLD_FROM_Y_UP @ scene_from_node, path) for scene_from_node, asset in scene.splats()]
        empty = "meshes" not in document and _EXTENSION in document.get("extensionsUsed", [])
    except DAMAGE as error:
        raise AssetError("the structure of the glTF is damaged", where=path, cure="Copy or export it again.") from error
    if not assets and not empty:
        raise AssetError(
            f"there is no mesh with {_EXTENSION} in the scene", where=path, cure="Export the splats as such."
        )
    return assets[0].concatenated(*assets[1:]) if assets else SplatAsset.empty()


def _attributes(asset: SplatAsset) -> dict[str, np.ndarray]:
    """What the extension calls each quantity, in the order of the buffer, all multiples of 4 bytes."""
    linear = linear_from_srgb(asset.base_colours)  # COLOR_0, of points that stand in for splats
    colours = np.concatenate([linear, asset.opacities[:, None]], axis=1)
    attributes = {
        "POSITION": asset.means,
        "COLOR_0": np.rint(colours * 65535.0).astype("<u2"),
        f"{_EXTENSION}:ROTATION": np.roll(unit_quaternions(asset.quaternions), -1, axis=1),
        f"{_EXTENSION}:SCALE": linear_scales(asset),
        f"{_EXTENSION}:OPACITY": asset.opacities[:, None],
    }
    for k, name in enumerate(_harmonic_names(asset.degree)):
        attributes[name] = asset.sh[:, k]
    return {
        name: np.ascontiguousarray(values, None if values.dtype == np.uint16 else "<f4")
        for name, values in attributes.items()
    }


def _harmonic_names(degree: int) -> list[str]:
    return [f"{_EXTENSION}:SH_DEGREE_{band}_COEF_{k}" for band in range(degree + 1) for k in range(2 * band + 1)]


def _document(attributes: dict[str, np.ndarray], size: int) -> dict[str, Any]:
    """The JSON of one primitive whose attributes lie one after another in one buffer."""
    document = {
        "asset": {"version": "2.0", "generator": f"r2sego-blender {__version__}"},
        "extensionsUsed": [_EXTENSION],
        "scene": 0,
    }
    if not attributes:  # glTF knows no accessor of zero elements
        return document | {"scenes": [{}]}
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    offset = 0
    kinds = {width: kind for kind, width in _WIDTHS.items()}
    for values in attributes.values():
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": values.nbytes, "target": _ARRAY_BUFFER})
        accessors.append(
            {
                "bufferView": len(accessors),
                "count": len(values),
                "type": kinds[values.shape[1]],
                "componentType": _FLOAT,
            }
        )
        if values.dtype == np.uint16:
            accessors[-1] |= {"componentType": _UNSIGNED_SHORT, "normalized": True}
        offset += values.nbytes
    positions = attributes["POSITION"]
    accessors[0] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    primitive = {
        "attributes": {name: k for k, name in enumerate(attributes)},
        "mode": _POINTS,
        "extensions": {_EXTENSION: {"kernel": "ellipse", "colorSpace": _COLOUR_SPACE}},
    }
    return document | {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "splats", "mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": size}],
    }


class _Scene:
    """The splats under the nodes of a document. Any structure but glTF's raises a built-in error."""

    def __init__(self, document: dict[str, Any], buffers: list[bytes], path: Path) -> None:
        self._document, self._buffers, self._path = document, buffers, path

    def splats(self) -> Iterator[tuple[np.ndarray, SplatAsset]]:
        """(scene_from_node (4, 4), asset in the node's frame) of each primitive with splats."""
        nodes, meshes = self._document.get("nodes", []), self._document.get("meshes", [])
        tree = gltf_tree(self._document, self._path, AssetError)
        shown = [
            (index, primitive)
            for index, _ in tree
            if "mesh" in nodes[index]
            for primitive in meshes[nodes[index]["mesh"]]["primitives"]
            if _EXTENSION in primitive.get("extensions", {})
        ]
        self._require_few([primitive["attributes"] for _, primitive in shown])
        scene_from: dict[int | None, np.ndarray] = {None: np.eye(4)}
        for index, parent in tree if shown else ():
            scene_from[index] = scene_from[parent] @ _parent_from_node(nodes[index])
        for index, primitive in shown:
            yield scene_from[index], self._asset(primitive)

    def _require_few(self, attributes: list[dict[str, Any]]) -> None:
        """Raises AssetError where the primitives shown take more than the file can mean: many nodes may show
        one mesh, and memory has an end."""
        if len(attributes) > _MOST_PRIMITIVES:
            raise AssetError(
                f"the scene repeats its splats too often, {len(attributes)} times",
                where=self._path,
                cure="Export one copy of them, as one mesh.",
            )
        counts = [self._document["accessors"][one["POSITION"]]["count"] for one in attributes if "POSITION" in one]
        degree = max(map(_degree, attributes), default=0)
        require_room(sum(counts), (degree + 1) ** 2, sum(map(len, self._buffers)), self._path)

    def _asset(self, primitive: dict[str, Any]) -> SplatAsset:
        attributes = primitive["attributes"]
        extension = primitive["extensions"][_EXTENSION]
        if extension.get("colorSpace", _COLOUR_SPACE) != _COLOUR_SPACE:
            raise AssetError(
                f"the splats' colours are in {extension['colorSpace']}",
                where=self._path,
                cure=f"Export them in {_COLOUR_SPACE}: harmonics cannot be converted.",
            )
        degree = _degree(attributes)
        names = ["POSITION", *(f"{_EXTENSION}:{name}" for name in ("ROTATION", "SCALE", "OPACITY"))]
        names += _harmonic_names(degree)
        for name in names:
            if name not in attributes:
                raise AssetError(
                    f"the attribute '{name}' is missing",
                    where=self._path,
                    cure="Export the splats whole and without compression.",
                )
        arrays = [self._values(attributes[name]) for name in names]
        if len({len(values) for values in arrays}) > 1:
            raise ValueError("the attributes differ in number")
        means, rotations, scales, opacities, *harmonics = arrays
        return SplatAsset(
            means=means,
            log_scales=log_scales(scales),
            quaternions=unit_quaternions(np.roll(rotations, 1, axis=1)),
            logit_opacities=logits(opacities[:, 0]),
            sh=np.stack(harmonics, axis=1),
        )

    def _values(self, index: int) -> np.ndarray:
        """(count, width) float32 of an accessor."""
        accessor = self._document["accessors"][index]
        if "bufferView" not in accessor or "sparse" in accessor:
            raise AssetError(
                "the splats are in a sparse or compressed accessor",
                where=self._path,
                cure="Export them without compression.",
            )
        view = self._document["bufferViews"][accessor["bufferView"]]
        kind = np.dtype(_COMPONENTS[accessor["componentType"]])
        width, count = _WIDTHS[accessor["type"]], accessor["count"]
        stride = view.get("byteStride", width * kind.itemsize)
        offset, start = accessor.get("byteOffset", 0), view.get("byteOffset", 0)
        if count < 0 or offset < 0 or start < 0 or stride < width * kind.itemsize:
            raise ValueError("an accessor has impossible sizes")
        end = offset + stride * max(count - 1, 0) + width * kind.itemsize
        buffer = self._buffers[view["buffer"]]
        if end > view["byteLength"] or start + view["byteLength"] > len(buffer):
            raise cut_short(self._path, AssetError)
        raw: np.ndarray = np.ndarray((count, width), kind, buffer, start + offset, (stride, kind.itemsize))
        values = raw.astype(np.float32)
        if accessor.get("normalized", False) and kind.kind != "f":
            values = np.maximum(values / np.iinfo(kind).max, -1.0)
        return values


def _degree(attributes: dict[str, Any]) -> int:
    degree = 0
    while degree < _HIGHEST_DEGREE and _harmonic_names(degree + 1)[-1] in attributes:
        degree += 1
    return degree


def _parent_from_node(node: dict[str, Any]) -> np.ndarray:
    """(4, 4) float64 of a node's matrix, or of its translation, rotation and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    transform = np.eye(4)
    if node.keys().isdisjoint(("rotation", "scale", "translation")):
        return transform
    xyzw = np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64)
    transform[:3, :3] = to_rotation(np.roll(xyzw, 1)[None])[0] * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    transform[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return transform


FORMAT = SplatFormat(
    suffixes=(".glb", ".gltf"),
    menu=(
        (".glb", "glTF Binary", "All attributes, KHR_gaussian_splatting"),
        (".gltf", "glTF", "All attributes, as text"),
    ),
    rank=3,
    magic=(GLB_MAGIC,),
    load=load_gltf,
    save=save_gltf,
    is_y_up=True,
)
