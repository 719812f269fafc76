"""The generator that the settings ask for: the embedded one, or a program with a model of its own."""

from __future__ import annotations

import contextlib
import shlex
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...captures.capture import Capture
from ...config.settings import GenerationSettings, Settings
from ...core.cameras import Camera
from ...core.errors import CaptureError, NativeError
from ...core.images import load_image, resize, save_image
from ...core.text_files import write_json
from ...workers.external_environment import PROTOCOL
from ...workers.generator_program import COMMAND_VARIABLE, GeneratorProgram, named_command, named_size
from ...workers.viewcrafter import CURE, SIZES, viewcrafter_command
from ..conditions.condition_files import save_conditions
from ..conditions.conditions import Condition, Renderer
from ..conditions.point_condition import PointConditions
from ..paths.paths import reference_from_frame
from .blending import BlendingGenerator
from .slot import Frame, Generator

_VALID = 0.5


@contextlib.contextmanager
def open_generator(
    captures: Sequence[Capture], depths: Sequence[np.ndarray], observed: Sequence[np.ndarray],
    renderer: Renderer, colours: PointConditions, settings: Settings, scratch: Path,
) -> Iterator[Generator]:  # fmt: skip
    """The generator that ``generation.generator`` names; what it started ends with the context.

    ``depths`` and ``observed`` are what the embedded one blends by (``BlendingGenerator``);
    ``renderer`` and ``colours`` make the conditions of a program's own size; what is asked and
    answered lies in the folder ``scratch`` meanwhile. Raises MachineError when a program is not
    set up on this machine.
    """
    chosen = settings.generation
    if chosen.generator == "blending":
        yield BlendingGenerator(captures, depths, chosen, observed)
        return
    if chosen.generator in SIZES:
        name, cure, size = "ViewCrafter", CURE, SIZES[chosen.generator]
        command = viewcrafter_command(chosen.clip_frames)
    else:
        command, size = named_command(), named_size()
        name, cure = shlex.join(command), f"Mend the program in {COMMAND_VARIABLE}, see docs/backends.md."
    with GeneratorProgram(command, name, cure) as program:
        yield ProgramGenerator(
            program, name, captures, renderer, colours, chosen, settings.seed, scratch, size
        )


class ProgramGenerator:
    """A generator in a process of its own, asked through files (docs/backends.md)."""

    def __init__(
        self, program: GeneratorProgram, name: str, captures: Sequence[Capture], renderer: Renderer,
        colours: PointConditions, settings: GenerationSettings, seed: int, scratch: Path,
        size: tuple[int, int] | None = None,
    ) -> None:  # fmt: skip
        """``size``: (width, height) of the only frames it makes, None where it makes any."""
        self.name = name
        self._program, self._captures, self._renderer, self._colours = program, captures, renderer, colours
        self._settings, self._seed, self._scratch, self._size = settings, seed, scratch, size

    def generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        """See ``Generator``. The program is given conditions of its own size, letterboxed.

        Where the program tells no confidence, it is 1 where the condition is valid, elsewhere that
        of a pixel no capture saw. Raises as ``GeneratorProgram.answer`` does, and NativeError when
        frames are missing or of another size.
        """
        target = conditions[-1].camera
        box = letterbox(target, *(self._size or (target.width, target.height)))
        path = [box.camera.at(condition.camera.world_from_camera) for condition in conditions]
        with tempfile.TemporaryDirectory(prefix=".request-", dir=self._scratch) as name:
            folder = Path(name).resolve()  # the program may run elsewhere
            self._write_request(folder, reference, path)
            told = self._program.answer(folder)
            self.name = str(told["backend"])
            if told["frames"] != len(conditions):
                raise self._incomplete(f"made {told['frames']} frames, not {len(conditions)}")
            return [self._frame(folder, k, box, condition) for k, condition in enumerate(conditions)]

    def _write_request(self, folder: Path, reference: int, path: Sequence[Camera]) -> None:
        capture = self._captures[reference]
        save_image(folder / "reference.png", capture.image())
        conditions = self._renderer.render(path)
        save_conditions(folder / "conditions", conditions, self._colours.render(reference, conditions))
        request: dict[str, Any] = {
            "protocol": PROTOCOL, "seed": self._seed, "frames": len(path),
            "width": path[0].width, "height": path[0].height,
            "reference": {"name": capture.name, "camera": capture.camera.to_json()},
            "cameras": [camera.to_json() for camera in path],
            "reference_from_frame": reference_from_frame(capture.camera, path).tolist(),
        }  # fmt: skip
        write_json(folder / "request.json", request)

    def _frame(self, folder: Path, index: int, box: Letterbox, condition: Condition) -> Frame:
        """The program's frame of this index, at the condition's size."""
        size = condition.camera.width, condition.camera.height
        image = self._read(folder / "frames" / f"{index:03d}.png", box)
        told = folder / "confidence" / f"{index:03d}.png"
        if told.is_file():
            confidence = resize(self._read(told, box)[..., 0], *size)
        else:
            unseen = np.float32(self._settings.hole_confidence)
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
            f"the generator {what}", where=self.name,
            cure="Mend it, or use --set generation.generator=blending.",
        )  # fmt: skip


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
