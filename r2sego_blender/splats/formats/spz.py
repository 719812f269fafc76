"""Assets as SPZ files: quantised to about 64 bytes a Gaussian at degree 3, then compressed.

Versions 1 to 4 (github.com/nianticlabs/spz) are read, 3 is written: of those in gzip, which
most programs read, the one that keeps rotations well.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ..asset import SplatAsset
from ..quaternions import unit_quaternions
from .files import content, publishing, require_room
from .record import SplatFormat
from .values import Y_UP_FROM_WORLD, in_world, logits_of_bytes, to_bytes

_MAGIC = b"NGSP"
_GZIP_MAGIC = b"\x1f\x8b"
_HEADER = struct.Struct("<4sIIBBBB")
"""Magic, version, count, degree, fractional bits, flags and, in version 4, the number of streams."""
_TABLE_OFFSET = struct.Struct("<I")
_HEADER_BYTES_V4 = 32
_TABLE_ENTRY = struct.Struct("<QQ")
_WRITTEN_VERSION = 3
_BEFORE_4 = range(1, 4)
_HIGHEST_DEGREE = 4
_HAS_EXTENSIONS = 2
_COORDINATE_SYSTEM = 0xADBE0003
_COORDINATE_SYSTEMS = (
    "RUB",
    *("LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF"),
    *("LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU", "RBU"),
)
"""By the number of the coordinate system extension: where x, y and z point; 0 is unspecified."""
_AXES = {"R": (1, 0, 0), "L": (-1, 0, 0), "F": (0, 1, 0), "B": (0, -1, 0), "U": (0, 0, 1), "D": (0, 0, -1)}

_MOST_FRACTIONAL_BITS = 14
"""Steps of 0.06 mm within 512 m: finer ones would be noise that does not compress."""
_LARGEST_FIXED = 2**23 - 1
_COLOUR_SCALE = 0.15 * 255.0
_LARGEST_COMPONENT, _COMPONENT_STEPS = 0.5**0.5, 511
_OTHER_COMPONENTS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_COMPONENT_SHIFTS = np.array([20, 10, 0], np.uint32)

_LONGEST_EXTENSIONS = 1 << 20


@dataclass(frozen=True)
class _Packed:
    """The quantised Gaussians: each part (N, bytes a Gaussian) uint8."""

    version: int
    degree: int
    fractional_bits: int
    parts: dict[str, np.ndarray]
    extensions: bytes


def save_spz(path: Path, asset: SplatAsset) -> None:
    """Write ``asset`` as version 3 in SPZ's axes: x right, y up, z back."""
    asset = asset.finite().transformed(Y_UP_FROM_WORLD)
    reach = float(np.abs(asset.means).max(initial=0.0))
    bits = _MOST_FRACTIONAL_BITS
    while bits and reach * 2.0**bits > _LARGEST_FIXED:
        bits -= 1
    if reach > _LARGEST_FIXED:
        raise AssetError(
            f"a Gaussian stands {reach:.3g} m from the origin, beyond the reach of SPZ",
            where=path,
            cure="Remove it, or use .ply.",
        )
    fixed = np.rint(asset.means.astype(np.float64) * 2.0**bits).astype("<i4")
    parts = [
        fixed.view(np.uint8).reshape(-1, 4)[:, :3],
        to_bytes(asset.opacities * 255.0),
        to_bytes(asset.sh[:, 0] * _COLOUR_SCALE + 127.5),
        to_bytes((asset.log_scales + 10.0) * 16.0),
        _packed_rotations(asset.quaternions),
        to_bytes(asset.sh[:, 1:] * 128.0 + 128.0),
    ]
    header = _HEADER.pack(_MAGIC, _WRITTEN_VERSION, len(asset), asset.degree, bits, 0, 0)
    compressor = zlib.compressobj(wbits=16 + zlib.MAX_WBITS)
    with publishing(path) as staging, staging.open("wb") as file:
        for part in [header, *(part.tobytes() for part in parts)]:
            file.write(compressor.compress(part))
        file.write(compressor.flush())


def load_spz(path: Path) -> SplatAsset:
    """Read an SPZ file of version 1 to 4; of degree 4, the degrees up to 3.

    Versions 1 to 3 may stand there without their gzip. Axes are SPZ's own (x right, y up, z back)
    or those the file's coordinate system extension names. Raises AssetError naming the file when it is damaged.
    """
    data = content(path)
    if data.startswith(_MAGIC) and int.from_bytes(data[4:8], "little") in _BEFORE_4:
        packed = _before_version_4(io.BytesIO(data).read, len(data), path)
    elif data.startswith(_MAGIC):
        packed = _opened_v4(data, path)
    elif data.startswith(_GZIP_MAGIC):
        packed = _opened_gzip(data, path)
    else:
        raise AssetError("the file is not an SPZ", where=path, cure="Give an .spz file.")
    parts = packed.parts
    count = len(parts["alphas"])
    if packed.version == 1:
        means = parts["positions"].view("<f2").astype(np.float32)
    else:
        low, middle, high = np.moveaxis(parts["positions"].reshape(count, 3, 3).astype(np.int32), -1, 0)
        unsigned = low | middle << 8 | high << 16
        means = ((unsigned ^ 0x800000) - 0x800000) * 2.0**-packed.fractional_bits
    stored = (packed.degree + 1) ** 2
    coefficients = min(stored, 16)
    sh = np.empty((count, coefficients, 3), np.float32)
    sh[:, 0] = (parts["colours"] - 127.5) / _COLOUR_SCALE
    sh[:, 1:] = (parts["sh"].reshape(count, stored - 1, 3)[:, : coefficients - 1] - 128.0) / 128.0
    unpacked = _first_three if packed.version < 3 else _smallest_three
    asset = SplatAsset(
        means=means,
        log_scales=parts["scales"] / 16.0 - 10.0,
        quaternions=np.roll(unpacked(parts["rotations"]), 1, axis=1),
        logit_opacities=logits_of_bytes(parts["alphas"][:, 0]),
        sh=sh,
    )
    return in_world(asset, _world_from_file(packed.extensions, path), path)


def _sizes(version: int, degree: int) -> dict[str, int]:
    """Bytes a Gaussian of each part, in the order of the file."""
    return {
        "positions": 6 if version == 1 else 9,
        "alphas": 1,
        "colours": 3,
        "scales": 3,
        "rotations": 3 if version < 3 else 4,
        "sh": 3 * ((degree + 1) ** 2 - 1),
    }


def _checked_header(header: bytes, versions: range, file_bytes: int, path: Path) -> tuple[int, ...]:
    """Version, count, degree, fractional bits, flags and streams of a header that can be true."""
    if len(header) < _HEADER.size or not header.startswith(_MAGIC):
        raise AssetError("the file is not an SPZ", where=path, cure="Give an .spz file.")
    _, version, count, degree, *rest = _HEADER.unpack_from(header)
    if version not in versions:
        raise AssetError(
            f"SPZ version {version} is unknown in this kind of file", where=path, cure="Export it as version 1 to 4."
        )
    if degree > _HIGHEST_DEGREE:
        raise AssetError(f"the degree {degree} is unknown", where=path, cure="Degrees 0 to 4 are known.")
    require_room(count, (degree + 1) ** 2, file_bytes, path)
    return version, count, degree, *rest


def _opened_gzip(data: bytes, path: Path) -> _Packed:
    """Versions 1 to 3: one gzip stream."""
    inflater = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
    waiting = data

    def read(count: int) -> bytes:
        nonlocal waiting
        part = inflater.decompress(waiting, count) if count else b""  # 0 means all to zlib
        waiting = inflater.unconsumed_tail if count else waiting
        return part

    try:
        packed = _before_version_4(read, len(data), path)
    except zlib.error as error:
        raise AssetError("the compressed data are damaged", where=path, cure="Copy it again.") from error
    if not (inflater.eof or inflater.unconsumed_tail):
        raise _cut_short(path)
    return packed


def _before_version_4(read: Callable[[int], bytes], file_bytes: int, path: Path) -> _Packed:
    """Header, parts and extensions of versions 1 to 3, of which ``read`` gives the next so many bytes."""
    version, count, degree, bits, flags, _ = _checked_header(read(_HEADER.size), _BEFORE_4, file_bytes, path)
    sizes = _sizes(version, degree)
    size = count * sum(sizes.values())
    body, rest = read(size), read(_LONGEST_EXTENSIONS)
    if len(body) < size:
        raise _cut_short(path)
    ends = np.cumsum([count * width for width in sizes.values()])[:-1]
    streams = np.split(np.frombuffer(body, np.uint8), ends)
    parts = {name: s.reshape(count, w) for (name, w), s in zip(sizes.items(), streams, strict=True)}
    return _Packed(version, degree, bits, parts, rest if flags & _HAS_EXTENSIONS else b"")


def _opened_v4(data: bytes, path: Path) -> _Packed:
    """Version 4: a plain header, extensions, a table of sizes and one ZSTD stream a part."""
    version, count, degree, bits, flags, streams = _checked_header(
        data[:_HEADER_BYTES_V4], range(4, 5), len(data), path
    )
    sizes = _sizes(version, degree)
    stored = [name for name, width in sizes.items() if count * width]
    if len(data) < _HEADER_BYTES_V4:
        raise _cut_short(path)
    (table,) = _TABLE_OFFSET.unpack_from(data, _HEADER.size)
    start = table + streams * _TABLE_ENTRY.size
    if streams != len(stored) or table < _HEADER_BYTES_V4 or start > len(data):
        raise AssetError("the table of streams is damaged", where=path, cure="Copy or export it again.")
    parts = {name: np.zeros((count, width), np.uint8) for name, width in sizes.items() if not count * width}
    for k, name in enumerate(stored):
        length, size = _TABLE_ENTRY.unpack_from(data, table + k * _TABLE_ENTRY.size)
        if start + length > len(data) or size != count * sizes[name]:
            raise _cut_short(path)
        raw = _unzstd(data[start : start + length], size, path)
        parts[name] = np.frombuffer(raw, np.uint8).reshape(count, sizes[name])
        start += length
    extensions = data[_HEADER_BYTES_V4:table] if flags & _HAS_EXTENSIONS else b""
    return _Packed(version, degree, bits, parts, extensions)


def _unzstd(stream: bytes, size: int, path: Path) -> bytes:
    """``size`` bytes out of a ZSTD frame, whatever size the frame itself claims."""
    import zstandard

    try:
        claimed = zstandard.get_frame_parameters(stream).content_size
        if claimed in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raw = zstandard.ZstdDecompressor().decompress(stream, max_output_size=size)
            if len(raw) == size:
                return raw
    except zstandard.ZstdError as error:
        raise AssetError("the compressed data are damaged", where=path, cure="Copy it again.") from error
    raise _cut_short(path)


def _cut_short(path: Path) -> AssetError:
    return AssetError(
        "the file is cut short: its header claims more Gaussians than it holds",
        where=path,
        cure="Copy or export it again.",
    )


def _records(extensions: bytes) -> Iterator[tuple[int, bytes]]:
    """Type and payload of each extension; what follows a damaged one is passed over."""
    start = 0
    while start + 8 <= len(extensions):
        kind, length = struct.unpack_from("<II", extensions, start)
        start += 8 + length
        yield kind, extensions[start - length : start]


def _world_from_file(extensions: bytes, path: Path) -> np.ndarray:
    """(4, 4), from the axes the file is in to the world's."""
    system = 0
    for kind, payload in _records(extensions):
        if kind == _COORDINATE_SYSTEM and len(payload) == 4:
            (system,) = struct.unpack("<I", payload)
    name = _COORDINATE_SYSTEMS[system] if system < len(_COORDINATE_SYSTEMS) else f"number {system}"
    world_from_file = np.eye(4)
    if system < len(_COORDINATE_SYSTEMS):
        world_from_file[:3, :3] = np.array([_AXES[letter] for letter in name]).T
    if system >= len(_COORDINATE_SYSTEMS) or np.linalg.det(world_from_file) < 0.0:
        raise AssetError(
            f"the file is in the coordinate system {name}, not a right-handed one",
            where=path,
            cure="Export it as RUB, SPZ's own.",
        )
    return world_from_file


def _packed_rotations(quaternions: np.ndarray) -> np.ndarray:
    """(N,) uint32: the largest component's index (xyzw) in 2 bits, the others in sign and 9 bits."""
    xyzw = np.roll(unit_quaternions(quaternions), -1, axis=1)
    largest = np.abs(xyzw).argmax(axis=1)
    xyzw *= np.where(np.take_along_axis(xyzw, largest[:, None], axis=1) < 0.0, -1.0, 1.0)
    others = np.take_along_axis(xyzw, _OTHER_COMPONENTS[largest], axis=1)
    steps = np.rint(np.abs(others) / _LARGEST_COMPONENT * _COMPONENT_STEPS).clip(max=_COMPONENT_STEPS)
    fields = steps.astype(np.uint32) | (others < 0.0).astype(np.uint32) << 9
    packed = largest.astype(np.uint32) << 30
    return (packed | (fields << _COMPONENT_SHIFTS).sum(axis=1, dtype=np.uint32)).astype("<u4")


def _smallest_three(raw: np.ndarray) -> np.ndarray:
    """(N, 4) float64 xyzw of ``_packed_rotations``."""
    packed = np.ascontiguousarray(raw).view("<u4")
    largest = (packed >> 30).astype(np.intp)
    fields = packed >> _COMPONENT_SHIFTS & 1023
    others = (fields & _COMPONENT_STEPS) * (_LARGEST_COMPONENT / _COMPONENT_STEPS)
    others = np.where(fields >> 9, -others, others)
    xyzw = np.empty((len(raw), 4))
    np.put_along_axis(xyzw, _OTHER_COMPONENTS[largest[:, 0]], others, axis=1)
    np.put_along_axis(xyzw, largest, _missing_component(others), axis=1)
    return xyzw


def _first_three(raw: np.ndarray) -> np.ndarray:
    """(N, 4) float64 xyzw of versions 1 and 2: x, y and z in bytes, w not negative."""
    xyz = raw / 127.5 - 1.0
    return np.concatenate([xyz, _missing_component(xyz)], axis=1)


def _missing_component(others: np.ndarray) -> np.ndarray:
    """(N, 1), what a unit quaternion has beside three components (N, 3)."""
    return np.sqrt(np.maximum(1.0 - (others**2).sum(axis=1, keepdims=True), 0.0))


FORMAT = SplatFormat(
    suffixes=(".spz",),
    menu=((".spz", "SPZ", "Small: a fifth of the PLY, quantised"),),
    rank=1,
    magic=(_MAGIC, _GZIP_MAGIC + b"\x08"),
    load=load_spz,
    save=save_spz,
    is_y_up=True,
)
