"""SAM 3 (Meta, 2025), the paper's source of object masks, in its own environment.

A vocabulary of words in, the mask of every thing that one of them names out, photograph by
photograph. Only the published interface is used: ``build_sam3_image_model``, and a
``Sam3Processor`` with ``set_image`` and ``set_text_prompt``. SAM 3 needs Python 3.12, torch 2.7
and an NVIDIA GPU, and its weights are given on request, under a licence of their own; it runs
in the interpreter that the environment variable ``R2SEGO_SAM3_PYTHON`` names.

What runs there is ``workers.models.sam3``, asked for the task "masks": inputs ``photograph_000`` and on, (H, W, 3)
uint8; parameters ``vocabulary`` and ``least_score``; outputs black and white images, of which the value ``masks``
tells ``output``, ``photograph`` (its number), ``word`` and ``score``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..core.json_files import finite_number
from .external_environment import named_python
from .learned_backends import LEARNED_BACKENDS
from .protocol.asking import ask
from .protocol.program_worker import ProgramWorker, library_command
from .protocol.request import Request
from .protocol.response import Limits, Response

if TYPE_CHECKING:
    import numpy as np

PYTHON_VARIABLE = LEARNED_BACKENDS["sam3"].variable
_NAME = "SAM 3"
_WHITE = 128
_LIMITS = Limits(seconds=1800.0, silent_s=1800.0)
_CURE = (
    f"Install sam3 (github.com/facebookresearch/sam3) in an environment of its own, ask for its weights, and "
    f"set {PYTHON_VARIABLE} to that environment's python, or draw the masks: --masks FOLDER."
)


@dataclass(frozen=True)
class FoundMask:
    """One thing in one photograph: ``mask`` (H, W) bool, named by a ``word`` of the vocabulary."""

    photograph: str
    word: str
    score: float
    mask: np.ndarray


def segment_externally(
    photographs: Mapping[str, np.ndarray], vocabulary: Sequence[str], least_score: float = 0.5
) -> tuple[str, tuple[FoundMask, ...]]:
    """The backend with its version, and what it found in ``photographs``, (H, W, 3) in [0, 1].

    Raises MachineError when there is no such environment or SAM 3 is not in it, NativeError
    when it ends without a whole result.
    """
    from ..core.images import to_uint8

    python = named_python(PYTHON_VARIABLE, _NAME, "--segment", _CURE)
    names = list(photographs)
    request = Request(
        "masks",
        _NAME,
        {"vocabulary": list(vocabulary), "least_score": least_score},
        {f"photograph_{k:03d}": to_uint8(photographs[name]) for k, name in enumerate(names)},
    )
    command = library_command(python, "workers.models.sam3")
    with ProgramWorker(command, PYTHON_VARIABLE, _CURE) as worker, ask(worker, request, limits=_LIMITS) as response:
        found = []
        for one in response.listed("masks"):
            try:
                photograph, word, score = names[int(one["photograph"])], str(one["word"]), finite_number(one["score"])
            except (LookupError, TypeError, ValueError) as error:
                raise response.wrong("gave a mask that is of no photograph") from error
            found.append(FoundMask(photograph, word, score, _mask(response, one, photographs[photograph].shape[:2])))
        return response.backend, tuple(found)


def _mask(response: Response, told: Mapping[str, Any], shape: tuple[int, ...]) -> np.ndarray:
    """A mask in its file, (H, W) bool. Raises NativeError unless it has its photograph's ``shape``."""
    from ..core.errors import CaptureError
    from ..core.images import load_image_uint8

    try:
        mask = load_image_uint8(response.file(str(told.get("output"))))[..., 0] >= _WHITE
    except CaptureError as error:
        raise response.wrong(f"gave a mask that cannot be read: {error.what}") from error
    if mask.shape != shape:
        raise response.wrong("gave a mask that has not the size of its photograph")
    return mask
