"""Reading and writing images: sRGB uint8 on disk, float32 (H, W, 3) in [0, 1] in memory."""

from __future__ import annotations

import contextlib
import io
import re
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from PIL import AvifImagePlugin, Image, ImageCms, ImageOps, TiffImagePlugin  # noqa: F401  (the order below)

from .errors import CaptureError
from .image_sizes import MOST_FILE_BYTES, MOST_PX, require_sensible_size
from .text_files import read_bytes

try:
    from pillow_heif import register_heif_opener

    # After AVIF: a file of the brand "mif1" may be either, and only AVIF's reader tells before its pixels.
    register_heif_opener(thumbnails=False, depth_images=False, aux_images=False)
    _READS_HEIC = True
except ImportError:  # an engine of before HEIC was read
    _READS_HEIC = False

HEIC = frozenset({".heic", ".heif"})
SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".avif"}) | HEIC
DAMAGED = (
    AssertionError,  # a picture of a palette that has none
    EOFError,
    OSError,
    RuntimeError,
    SyntaxError,
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    ArithmeticError,
    AssertionError,
    MemoryError,
    struct.error,
    zlib.error,
)
"""What Pillow raises for damaged files: each format has errors of its own."""

_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "AVIF", "HEIF")
"""Those of ``SUFFIXES``, whatever a file is called: of others Pillow starts programs, as of EPS Ghostscript."""

Image.MAX_IMAGE_PIXELS = MOST_PX // 2  # Pillow refuses twice as many, whoever opens an image
warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # and of fewer ``opened_image`` tells better

_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNG_CHUNKS = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_BITS, _TIFF_PHOTOMETRIC, _TIFF_PLANAR = 256, 257, 258, 262, 284
_WHITE_IS_ZERO, _PLANES = 0, 2
_JPEG, _JPEG_FORMATS = b"\xff\xd8\xff", ("JPEG", "MPO")  # of the latter a phone's with a second picture
_JPEG_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")
_START_OF_SCAN, _END_OF_IMAGE = 0xDA, 0xD9
_MOST_SCANS, _MOST_SEGMENTS = 200, 4096
"""Of a JPEG. A scan goes over all pixels, and may be told in ten bytes; the finest that an optimiser makes are 64."""

_MOST_PNG_CHUNKS = 1 << 20


def image_files(folder: Path) -> list[Path]:
    """The image files straight inside ``folder``, sorted by name.

    Hidden ones are none: a Mac leaves a ``._IMG_1.jpg`` that is no image beside each file. Of
    IMG_1.HEIC and IMG_1.JPG, of which a phone or a person made one of the other, the HEIC is none.
    """
    found = [p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith(".")]
    found = [p for p in found if p.is_file()]
    other_kinds = {p.stem.lower() for p in found if p.suffix.lower() not in HEIC}
    found = [p for p in found if p.suffix.lower() not in HEIC or p.stem.lower() not in other_kinds]
    return sorted(found, key=lambda path: path.name)  # Windows compares paths in small letters, others do not


def load_image(path: Path) -> np.ndarray:
    """The image as (H, W, 3) float32 in [0, 1], turned upright by its EXIF orientation.

    Colours of another profile, such as a phone's Display P3, become sRGB, and what is transparent
    is seen over black. Raises CaptureError
    when the file is missing, empty, cut short or not an image.
    """
    image = load_image_uint8(path).astype(np.float32)
    image /= 255.0  # in its place: a phone's 200 megapixels take 2.4 GB
    return image


def load_image_uint8(path: Path) -> np.ndarray:
    """The image as (H, W, 3) uint8 sRGB; otherwise as ``load_image``."""
    with opened_image(path) as image:
        if image.format in _JPEG_FORMATS:
            _require_few_scans(read_bytes(path, MOST_FILE_BYTES))
        ImageOps.exif_transpose(image, in_place=True)
        return np.asarray(_srgb(image, path))


@contextlib.contextmanager
def opened_image(
    path: Path, what: str = "image", cure: str = "Replace the file, or take it out of the folder."
) -> Iterator[Image.Image]:
    """The image in a file of one of ``SUFFIXES``, its pixels not decoded yet.

    Whatever damage is met inside the ``with``, and more pixels than its bytes account for, raises
    CaptureError that says ``what`` cannot be read, and the ``cure``.
    """
    try:
        if not path.is_file():  # a pipe would never end
            raise FileNotFoundError(path)
        with Image.open(path, formats=_readable()) as image:
            require_sensible_size(path, image.width, image.height, path.stat().st_size)
            yield image
    except Image.DecompressionBombError as error:
        raise CaptureError(f"the {what} has more pixels than is sensible", where=path, cure="Scale it down.") from error
    except FileNotFoundError as error:
        raise CaptureError(f"the {what} is missing", where=path, cure="Check the path.") from error
    except DAMAGED as error:
        raise unread(path, f"the {what} cannot be read", cure) from error


def _readable() -> tuple[str, ...]:
    return _FORMATS if _READS_HEIC else _FORMATS[:-1]


def unread(path: Path, what: str, cure: str) -> CaptureError:
    """The error for a file that Pillow cannot read: for HEIC, that its package is missing, if it is."""
    if path.suffix.lower() in HEIC and not _READS_HEIC:
        what = "HEIC cannot be read without the package pillow-heif"
        cure = "Press Set Up Engine in the add-on's preferences, or pip install pillow-heif."
    return CaptureError(what, where=path, cure=cure)


def _srgb(image: Image.Image, path: Path) -> Image.Image:
    """The image in 8 bits and the colours of sRGB."""
    if image.mode in ("F", "I"):  # Pillow would make them black or white
        raise CaptureError(
            "the image has 32 bits a value, of which none says what is white",
            where=path,
            cure="Save it with 8 or 16 bits a channel.",
        )
    tags = image.tag_v2 if isinstance(image, TiffImagePlugin.TiffImageFile) else {}
    if tags.get(_TIFF_PLANAR) == _PLANES and max(tags.get(_TIFF_BITS, (8,))) > 8:  # Pillow mixes their bytes up
        raise CaptureError(
            "the image has 16 bits a value and its colours one after another",
            where=path,
            cure="Save it with interleaved (chunky) colours, or with 8 bits a channel.",
        )
    if image.mode.startswith("I;16"):  # Pillow would cut grey values off at 255
        grey = (np.asarray(image) >> 8).astype(np.uint8)
        image = Image.fromarray(255 - grey if tags.get(_TIFF_PHOTOMETRIC) == _WHITE_IS_ZERO else grey)
    profile = image.info.get("icc_profile")
    if image.has_transparency_data:  # over black as splats are: what it hides may be of any colour
        image = image.convert("RGBA")
        image = Image.alpha_composite(Image.new("RGBA", image.size, (0, 0, 0, 255)), image)
    image = image if image.mode == "RGB" else image.convert("RGB")
    if not profile:
        return image
    try:
        given = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        if given.profile.xcolor_space.strip() != "RGB" or "sRGB" in ImageCms.getProfileDescription(given):
            return image
        return ImageCms.profileToProfile(image, given, ImageCms.createProfile("sRGB")) or image
    except (ImageCms.PyCMSError, *DAMAGED):  # a damaged profile says nothing
        return image


def stored_values(path: Path) -> np.ndarray | None:
    """The values of an image as they are stored, of any kind and number of channels; None for no image.

    OpenCV itself opens no file of Windows whose path has letters beyond the system's own, and takes the
    memory that a file says it needs. Raises CaptureError for more pixels than is sensible.
    """
    try:
        data = read_bytes(path, MOST_FILE_BYTES)
        if data.startswith(_PNG):
            data = _plain_png(data)
        width, height = _stored_size(data)
        require_sensible_size(path, width, height, len(data))
        _require_few_scans(data)
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (*DAMAGED, cv2.error, Image.DecompressionBombError):
        return None


def _stored_size(data: bytes) -> tuple[int, int]:
    """(width, height) that an image says it has. Raises ``DAMAGED``."""
    if data.startswith(_TIFF):  # of which OpenCV reads more kinds than Pillow
        stream = io.BytesIO(data)
        begin = stream.read(16 if data[2:3] in b"+" or data[3:4] == b"+" else 8)
        tags = TiffImagePlugin.ImageFileDirectory_v2(begin)
        stream.seek(tags.next)
        tags.load(stream)
        return int(tags[_TIFF_WIDTH]), int(tags[_TIFF_HEIGHT])
    with Image.open(io.BytesIO(data), formats=_readable()) as image:
        return image.size


def _require_few_scans(data: bytes) -> None:
    """Raises ValueError for a JPEG of more scans than any has a use for, which take hours to decode."""
    if not data.startswith(_JPEG) or data.count(b"\xff\xda") <= _MOST_SCANS:
        return
    scans, place = 0, 2  # a thumbnail, and the video that a phone puts behind its photograph, have such bytes too
    for _ in range(_MOST_SEGMENTS):
        found = _JPEG_MARKER.search(data, place)
        if found is None or found[1][0] == _END_OF_IMAGE:
            return
        scans += found[1][0] == _START_OF_SCAN
        if scans > _MOST_SCANS:
            break
        place = found.end() + int.from_bytes(data[found.end() : found.end() + 2], "big")  # a segment tells its length
    raise ValueError(f"it is a JPEG of more than {_MOST_SCANS} scans, or {_MOST_SEGMENTS} segments")


def _plain_png(data: bytes) -> bytes:
    """A PNG's size, colours and pixels alone. OpenCV dies of some animations, and takes what follows the end for
    chunks, with the memory that they say they need.

    Raises ValueError where a chunk says that it is longer than the file, and where none has pixels.
    """
    place, kept = len(_PNG), []
    for _ in range(_MOST_PNG_CHUNKS):
        kind, end = data[place + 4 : place + 8], place + 12 + int.from_bytes(data[place : place + 4], "big")
        if end > len(data):
            break
        if kind in _PNG_CHUNKS:
            kept.append((kind, data[place:end]))
        if kind == b"IEND":
            break
        place = end
    if not kept or kept[-1][0] != b"IEND" or b"IDAT" not in dict(kept):
        raise ValueError("it is cut off")
    return _PNG + b"".join(chunk for _, chunk in kept)


def to_uint8(image: np.ndarray) -> np.ndarray:
    """Float [0, 1] values as uint8, rounded and clipped."""
    levels: np.ndarray = np.clip(image, 0.0, 1.0) * 255.0 + 0.5
    return levels.astype(np.uint8)


def save_image(path: Path, image: np.ndarray) -> None:
    """Write (H, W, 3) or (H, W), float [0, 1] or uint8, as a PNG."""
    pixels = image if image.dtype == np.uint8 else to_uint8(image)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=3)
    path.write_bytes(buffer.getvalue())


def resize(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resample to (height, width): area average when shrinking, bilinear when growing."""
    if image.shape[:2] == (height, width):
        return image
    shrinks = width * height < image.shape[0] * image.shape[1]
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return cv2.resize(image, (width, height), interpolation=method)


def at_pixels(values: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Values of an image (H, W) or (H, W, C) float32 at pixels (n, 2), (n,) or (n, C), bilinear.

    The first pixel's centre is (0.5, 0.5); beyond the border its values go on.
    """
    places = (np.asarray(pixels) - 0.5).astype(np.float32)
    # OpenCV takes no more than 32767 rows at once.
    parts = np.array_split(places, max(1, len(places) // 30000 + 1))
    found = [
        cv2.remap(values, part[:, :1], part[:, 1:], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for part in parts
    ]
    return np.concatenate([one[:, 0] for one in found])


def resize_nearest(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """Resample a map whose values must not be mixed, such as depth or ids, to (height, width).

    A pixel takes the value where its centre lies; OpenCV's INTER_NEAREST takes that of its corner.
    """
    rows, columns = (
        ((np.arange(count) + 0.5) * known / count).astype(np.int64)
        for count, known in zip((height, width), values.shape[:2], strict=True)
    )
    return np.ascontiguousarray(values[np.ix_(rows, columns)])
