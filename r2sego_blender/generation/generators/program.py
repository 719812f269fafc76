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
from ...core.errors import CaptureError, NativeError
from ...core.images import load_image, resize, save_image
from ...core.json_files import write_json
from ...workers.external_environment import PROTOCOL
from ...workers.generator_program import GeneratorProgram
from ..conditions.condition_files import save_conditions
from ..conditions.conditions import Condition
from ..paths.paths import reference_from_frame
from .slot import ClipInputs, Frame, Generator, Installation

_VALID = 0.5


@contextlib.contextmanager
def program_generator(installed: Installation, inputs: ClipInputs, name: str, cure: str) -> Iterator[Generator]:
    """The generator that answers by ``installed.command``; what it started ends with the context.

    ``name`` is where errors are and what it is called until it tells its own, ``cure`` what they advise.
    """
    with GeneratorProgram(installed.command, name, cure) as program:
        yield ProgramGenerator(program, name, inputs, installed.size)


class ProgramGenerator:
    """A generator in a process of its own, asked through files (docs/backends.md)."""

    def __init__(
        self, program: GeneratorProgram, name: str, inputs: ClipInputs, size: tuple[int, int] | None = None
    ) -> None:
        """``size``: (width, height) of the only frames it makes, None where it makes any."""
        self.name = name
        self._program, self._inputs, self._size = program, inputs, size

    def generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        """See ``Generator``. The program is given conditions of its own size, letterboxed.

        Where the program tells no confidence, it is 1 where the condition is valid, elsewhere that
        of a pixel no capture saw. Raises as ``GeneratorProgram.answer`` does, and NativeError when
        frames are missing or of another size.
        """
        target = conditions[-1].camera
        box = letterbox(target, *(self._size or (target.width, target.height)))
        path = [box.camera.at(condition.camera.world_from_camera) for condition in conditions]
        with tempfile.TemporaryDirectory(prefix=".request-", dir=self._inputs.scratch) as name:
            folder = Path(name).resolve()  # the program may run elsewhere
            self._write_request(folder, reference, path)
            told = self._program.answer(folder)
            self.name = str(told["backend"])
            if told["frames"] != len(conditions):
                raise self._incomplete(f"made {told['frames']} frames, not {len(conditions)}")
            return [self._frame(folder, k, box, condition) for k, condition in enumerate(conditions)]

    def _write_request(self, folder: Path, reference: int, path: Sequence[Camera]) -> None:
        given = self._inputs
        capture = given.captures[reference]
        save_image(folder / "reference.png", capture.image())
        conditions = given.renderer.render(path)
        save_conditions(folder / "conditions", conditions, given.colours.render(reference, conditions))
        request: dict[str, Any] = {
            "protocol": PROTOCOL,
            "seed": given.settings.seed,
            "frames": len(path),
            "width": path[0].width,
            "height": path[0].height,
            "reference": {"name": capture.name, "camera": capture.camera.to_json()},
            "cameras": [camera.to_json() for camera in path],
            "reference_from_frame": reference_from_frame(capture.camera, path).tolist(),
        }
        write_json(folder / "request.json", request)

    def _frame(self, folder: Path, index: int, box: Letterbox, condition: Condition) -> Frame:
        """The program's frame of this index, at the condition's size."""
        size = condition.camera.width, condition.camera.height
        image = self._read(folder / "frames" / f"{index:03d}.png", box)
        told = folder / "confidence" / f"{index:03d}.png"
        if told.is_file():
            confidence = resize(self._read(told, box)[..., 0], *size)
        else:
            unseen = np.float32(self._inputs.settings.generation.hole_confidence)
            confidence = np.where(condition.validity >= _VALID, np.float32(1.0), unseen)
        return Frame(resize(image, *size), confidence)

    def _read(self, file: Path, box: Letterbox) -> np.ndarray:
        """The part of an image of the program that is of the view. (h, w, 3) float32."""
        told = f"{file.parent.name}/{file.name}"
        try:
            image = load_image(file)
        except CaptureError as error:
            raise self._incomplete(f"left no {told}: {error.what}") from error
        if image.shape[:2] != box.camera.shape:
            has, wanted = image.shape[:2], box.camera.shape
            raise self._incomplete(f"made {told} {has[1]}x{has[0]} pixels, not {wanted[1]}x{wanted[0]}")
        return box.cut(image)

    def _incomplete(self, what: str) -> NativeError:
        self._program.close()
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
