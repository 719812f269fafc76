"""The proxy of a scene as one textured mesh: holes closed, decimated, unwrapped, baked and written."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from ..bundle.containment import require_outside
from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..config.settings import Settings
from ..core.cameras import Camera
from ..core.errors import AssetError, SceneError, SettingsError
from ..core.progress import SILENT, Progress
from ..geometry.mesh.decimation import decimated
from ..geometry.mesh.small_holes import small_holes_closed
from ..geometry.proxy.proxy import PROXY, GeometryProxy
from ..geometry.texture.textured_mesh import TexturedMesh
from ..geometry.texture.textured_obj import BESIDE, obj_files
from ..geometry.texture.texturing import bake
from ..geometry.texture.unwrapping import unwrapped
from ..splats.formats.files import publishing

_TOO_MANY = 1.1  # times the faces asked for, which decimation keeps to where it can

FILE = "textured_proxy.glb"
"""Its name in the bundle."""


@dataclass(frozen=True)
class TextureFigures:
    """What was written: ``file``, ``megabytes`` with what lies beside it, ``faces``, ``size_px``,
    how it was unwrapped, ``seen`` (the share of the surface a capture saw), ``psnr_db`` of the
    captures rendered again where the mesh covers them (``covered``, a share of their pixels), and
    the ``seconds`` it took."""

    file: str
    megabytes: float
    faces: int
    size_px: int
    unwrapped_by: str
    seen: float
    psnr_db: float
    covered: float
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """A JSON-ready dict."""
        return asdict(self)

    def line(self) -> str:
        """One line a person reads."""
        return (
            f"{self.file}: {self.megabytes:.1f} MB, {self.faces} faces, {self.size_px} texels a side, "
            f"{self.seen:.0%} seen by a capture; the captures again: {self.psnr_db:.1f} dB on "
            f"{self.covered:.1%} of their pixels; {self.seconds:.0f} s, unwrapped by {self.unwrapped_by}"
        )


def texture_scene(
    scene: Scene, settings: Settings, file: Path | None = None, progress: Progress = SILENT
) -> TextureFigures:
    """Write the newest proxy of ``scene`` with colours baked from its captures.

    ``file`` ends in ``.glb``, or in ``.obj``: then its material, its texture and MuJoCo's scene of it are
    written beside it. By default it is the bundle's own ``textured_proxy.glb``. The captures' exposures
    are evened out first. Raises SettingsError for another suffix, SceneError for another file in a bundle,
    when there is no proxy yet, its world frame was corrected since, or while another process or thread writes
    to the scene, AssetError when the file cannot be written, and where what is written beside a new ``.obj`` is there.
    """
    with scene.locked():
        return _textured(scene, settings, file, progress)


def _textured(scene: Scene, settings: Settings, file: Path | None, progress: Progress) -> TextureFigures:
    started = time.monotonic()
    target = scene.path / FILE if file is None else Path(file)
    if file is not None and target != scene.path / FILE:
        require_outside(target)
    if target.suffix.lower() not in (".glb", ".obj"):
        raise SettingsError(f"'{target.name}' ends neither in .glb nor in .obj", where="--to", cure="Name it so.")
    if not target.parent.is_dir():
        raise AssetError("there is no such folder", where=target.parent, cure="Make it first.")
    is_obj = target.suffix.lower() == ".obj"
    if is_obj:
        target = target.with_suffix(".obj")  # as MuJoCo's scene beside it names it
        _require_free_beside(target)
    textured, views = _baked(scene, _newest_proxy(scene), settings, progress)
    files = obj_files(textured, target.stem) if is_obj else {target.name: textured.glb()}
    for name, data in files.items():
        with publishing(target.with_name(name)) as staging:
            staging.write_bytes(data)
    squares, pixels = 0.0, 0
    for view in views:
        again, known = textured.render(view.camera)
        known &= view.shown
        squares += float(((again - view.image)[known] ** 2).sum())
        pixels += int(known.sum())
    psnr_db = 10 * np.log10(3 * pixels / max(squares, 1e-12)) if pixels else 0.0
    return TextureFigures(
        file=str(target),
        megabytes=sum(map(len, files.values())) / 1e6,
        faces=len(textured.faces),
        size_px=settings.texture.size_px,
        unwrapped_by=textured.method,
        seen=textured.seen,
        psnr_db=float(psnr_db),
        covered=pixels / sum(view.camera.width * view.camera.height for view in views),
        seconds=time.monotonic() - started,
    )


def textured_room(scene: Scene, proxy: GeometryProxy, settings: Settings, progress: Progress = SILENT) -> TexturedMesh:
    """A proxy of ``scene`` with colours baked from its captures, small holes closed, and decimated.

    Raises GeometryError where no capture sees it.
    """
    return _baked(scene, proxy, settings, progress)[0]


class _View(NamedTuple):
    """A capture's ``camera``, its ``image``, and where it is ``shown``."""

    camera: Camera
    image: np.ndarray
    shown: np.ndarray


def _baked(
    scene: Scene, proxy: GeometryProxy, settings: Settings, progress: Progress
) -> tuple[TexturedMesh, list[_View]]:
    """The textured mesh, and the captures as they were baked on it."""
    captures = scene.read(CAPTURES)
    whole = small_holes_closed(proxy.vertices, proxy.faces, settings.texture.hole_m)
    fewer = decimated(*whole, settings.texture.faces)
    if len(fewer[1]) > _TOO_MANY * settings.texture.faces:
        progress.message(
            f"texture.faces {settings.texture.faces}: {len(fewer[1])} are left, in parts that lose no more", "warning"
        )
    mesh = unwrapped(*fewer, settings.texture, progress)
    cameras = [capture.camera for capture in captures]
    images = [capture.image() for capture in captures]
    shown = [_on_photograph(capture) for capture in captures]
    textured = bake(mesh, images, cameras, settings.texture, progress, shown)
    return textured, [_View(*view) for view in zip(cameras, images, shown, strict=True)]


def _require_free_beside(obj: Path) -> None:
    """Raises AssetError where a new ``obj`` would be written beside what is not its own."""
    beside = [obj.with_suffix(suffix) for suffix in BESIDE]
    for file in beside if not obj.exists() else ():
        if file.exists():
            raise AssetError("it would be written over", where=file, cure="Choose another name, or move it away.")


def _on_photograph(capture: Capture) -> np.ndarray:
    """(H, W) bool: the pixels that the photograph reaches, less a pixel at its border.

    Straightening a strongly distorted photograph may leave blank ones.
    """
    height, width = capture.camera.shape
    if capture.lens is None:
        return np.ones((height, width), bool)
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    shares = capture.photograph_shares(np.column_stack([columns.ravel(), rows.ravel()]))
    inside = ((shares >= 0) & (shares <= 1)).all(1).reshape(height, width)
    return ndimage.binary_erosion(inside, border_value=1)


def _newest_proxy(scene: Scene) -> GeometryProxy:
    index = scene.newest_round("proxy/proxy.npz")
    if index < 0:
        raise SceneError(
            "there is no proxy to texture yet", where=scene.path, cure=f"Run `r2sego refine {scene.path}` first."
        )
    require_present_frame(scene, [of_round(index, "proxy")], "textured")
    return scene.read(PROXY.of_round(index))
