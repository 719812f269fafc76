"""What colours a video's numbers mean (ITU-T H.273), and sRGB of what OpenCV makes of them.

OpenCV's FFmpeg turns every video to RGB by the matrix of BT.601 and knows no transfer function, so a phone's BT.709
comes with wrong hues, and its HDR (HLG of iPhones, PQ) washed out. What the numbers mean stands in the ``colr`` box of
QuickTime and MP4 files (ISO/IEC 14496-12, 12.1.5).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.colours import linear_from_srgb, srgb_from_linear
from ...core.images import to_uint8
from ...core.text_files import opened_file

UNSPECIFIED = 2

_BT601 = (0.299, 0.114)
_LUMA: Mapping[int, tuple[float, float]] = {1: (0.2126, 0.0722), 9: (0.2627, 0.0593)}
"""Kr and Kb of each matrix that is not BT.601's."""

# Linear BT.709 of linear BT.2020 (BT.2087) and of P3 with D65.
_BT709_FROM: Mapping[int, np.ndarray] = {
    9: np.array([[1.660491, -0.587641, -0.072850], [-0.124550, 1.132900, -0.008349], [-0.018151, -0.100579, 1.118730]]),
    12: np.array([[1.224940, -0.224940, 0.0], [-0.042057, 1.042057, 0.0], [-0.019638, -0.078636, 1.098274]]),
}
_PQ, _HLG = 16, 18
_HDR_NAMES = {_PQ: "PQ", _HLG: "HLG"}
_WHITE_CD_M2 = 203.0
"""Diffuse white of HDR (BT.2408)."""

_HLG_PEAK_CD_M2, _HLG_GAMMA = 1000.0, 1.2
_KNEE = 0.8
_MOST_MOOV_BYTES = 256 << 20
_MOST_BOXES = 4096
_ENTRY_BYTES = 78  # of a VisualSampleEntry, before its boxes


@dataclass(frozen=True)
class VideoColours:
    """Code points of H.273: colour primaries, transfer characteristics and matrix coefficients."""

    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED

    @property
    def hdr(self) -> str:
        """The name of its HDR transfer function; empty where it has none."""
        return _HDR_NAMES.get(self.transfer, "")

    def to_srgb(self, decoded: np.ndarray) -> np.ndarray:
        """sRGB (H, W, 3) uint8 of a frame (H, W, 3) uint8 that was made RGB by BT.601's matrix.

        HDR's diffuse white becomes white, what is brighter than four fifths of it is compressed.
        """
        if self.matrix not in _LUMA and not self.hdr and self.primaries not in _BT709_FROM:
            return decoded
        values = decoded.astype(np.float32) / np.float32(255.0)
        if self.matrix in _LUMA:
            right = np.linalg.inv(_ycbcr(*_LUMA[self.matrix])) @ _ycbcr(*_BT601)
            values = np.clip(values @ right.T.astype(np.float32), 0.0, 1.0)
        if not self.hdr and self.primaries not in _BT709_FROM:
            return to_uint8(values)
        linear = self._light(values) / np.float32(_WHITE_CD_M2) if self.hdr else linear_from_srgb(values)
        if self.primaries in _BT709_FROM:
            linear = np.maximum(linear @ _BT709_FROM[self.primaries].T.astype(np.float32), 0.0)
        return to_uint8(srgb_from_linear(_compressed(linear) if self.hdr else linear))

    def _light(self, signal: np.ndarray) -> np.ndarray:
        """The light in cd/m^2 (H, W, 3) that an HDR signal in [0, 1] shows (BT.2100, tables 4 and 5)."""
        if self.transfer == _PQ:
            root = signal ** np.float32(32.0 / 2523.0)
            share = np.maximum(root - 0.8359375, 0.0) / (18.8515625 - 18.6875 * root)
            return np.float32(10_000.0) * share ** np.float32(16384.0 / 2610.0)
        a, b, c = 0.17883277, 0.28466892, 0.55991073
        scene = np.where(signal <= 0.5, signal**2 / 3.0, (np.exp((signal - c) / a) + b) / 12.0)
        luminance = scene @ _ycbcr(*_LUMA[9])[0].astype(np.float32)
        system = np.maximum(luminance, 1e-6) ** np.float32(_HLG_GAMMA - 1.0)
        return np.float32(_HLG_PEAK_CD_M2) * system[..., None] * scene


def colours_of(video: Path) -> VideoColours:
    """The colours that a QuickTime or MP4 file states of its first video track; unspecified where it states none."""
    try:
        with opened_file(video) as stream:
            size = stream.seek(0, 2)
            place = 0
            for _ in range(_MOST_BOXES):
                stream.seek(place)
                box = _box(stream.read(16), size - place)
                if box is None:
                    break
                if box.kind == b"moov" and box.end <= _MOST_MOOV_BYTES:
                    stream.seek(place + box.begin)
                    return _stated(memoryview(stream.read(box.end - box.begin)))
                place += box.end
    except (OSError, ValueError):
        pass  # whoever decodes it says what is wrong
    return VideoColours()


class _Box(NamedTuple):
    kind: bytes
    begin: int
    end: int


def _box(head: bytes | memoryview, left: int) -> _Box | None:
    """The box that begins here, with where its content begins and ends; None where it does not fit."""
    if len(head) < 8:
        return None
    size, kind = struct.unpack(">I4s", head[:8])
    begin = 8
    if size == 1 and len(head) >= 16:
        size, begin = struct.unpack(">Q", head[8:16])[0], 16
    size = left if size == 0 else size
    return _Box(kind, begin, size) if begin <= size <= left else None


def _boxes(content: memoryview) -> Iterator[tuple[bytes, memoryview]]:
    place = 0
    for _ in range(_MOST_BOXES):
        box = _box(content[place : place + 16], len(content) - place)
        if box is None:
            return
        yield box.kind, content[place + box.begin : place + box.end]
        place += box.end


def _inside(content: memoryview, path: Sequence[bytes]) -> Iterator[memoryview]:
    """What boxes of these kinds, one within the other, hold."""
    for kind, inner in _boxes(content):
        if kind == path[0]:
            yield from _inside(inner, path[1:]) if path[1:] else (inner,)


def _stated(moov: memoryview) -> VideoColours:
    for media in _inside(moov, (b"trak", b"mdia")):
        if not any(bytes(handler[8:12]) == b"vide" for handler in _inside(media, (b"hdlr",))):
            continue
        for entries in _inside(media, (b"minf", b"stbl", b"stsd")):
            for _, entry in _boxes(entries[8:]):
                for colour in _inside(entry[_ENTRY_BYTES:], (b"colr",)):
                    if len(colour) >= 10 and bytes(colour[:4]) in (b"nclx", b"nclc"):
                        return VideoColours(*struct.unpack(">HHH", colour[4:10]))
        break
    return VideoColours()


def _ycbcr(red: float, blue: float) -> np.ndarray:
    """The matrix (3, 3) that makes Y'CbCr of R'G'B' (H.273, equations 41 to 43)."""
    green = 1.0 - red - blue
    luma = np.array([red, green, blue])
    return np.stack([luma, (np.array([0, 0, 1]) - luma) / (2 - 2 * blue), (np.array([1, 0, 0]) - luma) / (2 - 2 * red)])


def _compressed(linear: np.ndarray) -> np.ndarray:
    """Light of which 1 is diffuse white within [0, 1]: each colour dimmed as its brightest channel is."""
    brightest = np.maximum(linear.max(axis=-1, keepdims=True), np.float32(1e-6))
    room = 1.0 - _KNEE
    over = _KNEE + room * (1.0 - np.exp(-np.maximum(brightest - _KNEE, 0.0) / room))
    return linear * np.where(brightest > _KNEE, over / brightest, 1.0).astype(np.float32)
