"""Generators that are programs of their own: asked through files, given conditions of their own size."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.cameras import Camera
from ...core.errors import CaptureError, GenerationError, NativeError
from ...core.images import load_image, resize, save_image
from ...workers.protocol.asking import Worker, ask
from ...workers.protocol.request import Request
from ...workers.protocol.response import Limits, RefusedRequestError, Response
from ..conditions.condition_files import save_conditions
from ..conditions.conditions import Condition
from ..paths.paths import reference_from_frame
from .slot import ClipInputs, Frame, Generator, Installation

_VALID = 0.5
_LIMITS = Limits(seconds=3600.0, silent_s=3600.0)
_MOST_BROKEN = 3


@contextlib.contextmanager
def program_generator(worker: Worker, installed: Installation, inputs: ClipInputs) -> Iterator[Generator]:
    """The generator whose clips ``worker`` makes; what it started ends with the context."""
    with contextlib.closing(worker):
        yield ProgramGenerator(worker, inputs, installed.size)


class ProgramGenerator:
    """A generator in a process of its own, asked through files (docs/backends.md)."""

    def __init__(self, worker: Worker, inputs: ClipInputs, size: tuple[int, int] | None = None) -> None:
        """``size``: (width, height) of the only frames it makes, None where it makes any."""
        self.name = worker.name
        self._worker, self._inputs, self._size = worker, inputs, size
        self._broken = 0

    def generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        """See ``Generator``. The program is given conditions of its own size, letterboxed.

        Where the program tells no confidence, it is 1 where the condition is valid, elsewhere that
        of a pixel no capture saw. Raises GenerationError, which costs this clip, where the program refuses,
        breaks, hangs, or leaves frames that are missing or of another size; NativeError where the last
        ``_MOST_BROKEN`` clips broke, too; and MachineError where it cannot be started or says what it lacks.
        """
        try:
            frames = self._generate(reference, conditions)
        except RefusedRequestError as error:
            raise GenerationError(error.what, where=error.where) from error
        except NativeError as error:
            self._broken += 1
            if self._broken == _MOST_BROKEN:
                raise
            raise GenerationError(error.what, where=error.where, cure=error.cure) from error
        self._broken = 0
        return frames

    def _generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        target = conditions[-1].camera
        box = letterbox(target, *(self._size or (target.width, target.height)))
        path = [box.camera.at(condition.camera.world_from_camera) for condition in conditions]
        with tempfile.TemporaryDirectory(prefix=".request-", dir=self._inputs.scratch) as name:
            folder = Path(name).resolve()  # the program may run elsewhere
            request = self._request(folder / "request", reference, path)
            with ask(self._worker, request, limits=_LIMITS, folder=folder) as response:
                self.name = response.backend
                told = response.values.get("frames")
                if told != len(conditions):
                    raise self._incomplete(f"made {told!r} frames, not {len(conditions)}")
                return [self._frame(response, k, box, condition) for k, condition in enumerate(conditions)]

    def _request(self, folder: Path, reference: int, path: Sequence[Camera]) -> Request:
        """The task of a clip, its files written into ``folder``."""
        given = self._inputs
        capture = given.captures[reference]
        folder.mkdir()
        save_image(folder / "reference.png", capture.image())
        conditions = given.renderer.render(path)
        save_conditions(folder / "conditions", conditions, given.colours.render(reference, conditions))
        parameters: dict[str, Any] = {
            "seed": given.settings.seed,
            "frames": len(path),
            "width": path[0].width,
            "height": path[0].height,
            "reference": {"name": capture.name, "camera": capture.camera.to_json()},
            "cameras": [camera.to_json() for camera in path],
            "reference_from_frame": reference_from_frame(capture.camera, path).tolist(),
        }
        files = {file.relative_to(folder).as_posix(): file for file in folder.rglob("*") if file.is_file()}
        return Request("clip", self._inputs.settings.generation.generator, parameters, files)

    def _frame(self, response: Response, index: int, box: Letterbox, condition: Condition) -> Frame:
        """The program's frame of this index, at the condition's size."""
        size = condition.camera.width, condition.camera.height
        image = self._read(response, f"frames/{index:03d}.png", box)
        told = f"confidence/{index:03d}.png"
        if told in response.files:
            confidence = resize(self._read(response, told, box)[..., 0], *size)
        else:
            unseen = np.float32(self._inputs.settings.generation.hole_confidence)
            confidence = np.where(condition.validity >= _VALID, np.float32(1.0), unseen)
        return Frame(resize(image, *size), confidence)

    def _read(self, response: Response, told: str, box: Letterbox) -> np.ndarray:
        """The part of an image of the program that is of the view. (h, w, 3) float32."""
        if told not in response.files:
            raise self._incomplete(f"left no {told}: the image is missing")
        try:
            image = load_image(response.files[told])
        except CaptureError as error:
            raise self._incomplete(f"left no {told}: {error.what}") from error
        if image.shape[:2] != box.camera.shape:
            has, wanted = image.shape[:2], box.camera.shape
            raise self._incomplete(f"made {told} {has[1]}x{has[0]} pixels, not {wanted[1]}x{wanted[0]}")
        return box.cut(image)

    def _incomplete(self, what: str) -> NativeError:
        return NativeError(
            f"the generator {what}", where=self.name, cure="Mend it, or use --set generation.generator=blending."
        )


@dataclass(frozen=True)
class Letterbox:
    """A camera's view in the middle of a larger image of a given size, as large as fits.

    ``camera`` has that size, the same pose and, but for the rounding to whole pixels, square
    pixels of the view's: what is beside the view is seen too. The view is the ``view_width`` x
    ``view_height`` pixels from column ``left`` and row ``top`` on, exactly.
    """

    camera: Camera
    left: int
    top: int
    view_width: int
    view_height: int

    def cut(self, image: np.ndarray) -> np.ndarray:
        """The view (view_height, view_width, ...) in an image of the larger size."""
        return image[self.top : self.top + self.view_height, self.left : self.left + self.view_width]


def letterbox(view: Camera, width: int, height: int) -> Letterbox:
    """The view in the middle of ``width`` x ``height`` pixels."""
    inner = view.scaled(min(width / view.width, height / view.height))
    left, top = (width - inner.width) // 2, (height - inner.height) // 2
    camera = replace(inner, width=width, height=height, cx=inner.cx + left, cy=inner.cy + top)
    return Letterbox(camera, left, top, inner.width, inner.height)
