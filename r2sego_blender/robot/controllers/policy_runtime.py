"""A policy's file: read once, looked over, and opened in a process of its own.

``.onnx`` describes a computation and is data. A TorchScript file (``.pt``) is a program: it is opened
only where a person has named that very content on this machine (``r2sego trust``); what a bundle or its
scope says is no such word.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np

from ...config.trusted_programs import Program, is_trusted
from ...core.errors import RobotError
from ...core.text_files import read_bytes
from .policy_layout import PolicyLayout
from .policy_networks import ONNX, TORCHSCRIPT, Evaluate, PolicyRefusedError
from .policy_worker import PolicyFailedError, PolicyWorker
from .torchscript_archive import require_whole

MOST_BYTES = 512 << 20
"""The largest file of a policy that is read, bytes."""

# In ONNX's protocol buffers: the key of a tensor whose numbers lie in another file, or in memory. Numbers
# there may be written longer than they need be.
_EXTERNAL_DATA = re.compile(rb"(?:\n|\x8a\x80*\x00)(?:\x08|\x88\x80*\x00)location")
_TORCHSCRIPT = (".pt", ".pth", ".jit", ".torchscript")


def is_program(path: str | Path) -> bool:
    """Whether a policy's file is a program, by its name: then nothing else opens it."""
    return Path(path).suffix.lower() in _TORCHSCRIPT


def content_of(path: Path) -> bytes:
    """The bytes of a policy's file. Raises RobotError: unreadable, no file, or too large."""
    try:
        return read_bytes(path, MOST_BYTES)
    except ValueError as error:  # also a name that no file can have
        raise RobotError(f"this is no policy: {error}", where=path, cure="Give the policy's network alone.") from error
    except OSError as error:
        cure = "Check its path; a scope names it as controller.file or controller.tracker."
        raise RobotError("this policy cannot be read", where=path, cure=cure) from error


def read_policy(path: str | Path) -> bytes:
    """The content of a policy's file.

    Raises RobotError as ``content_of``, and: no kind of policy, tensors in other files, or a program that
    nobody has trusted on this machine.
    """
    path = Path(path)
    if path.suffix.lower() != ".onnx" and not is_program(path):
        raise RobotError(
            f"'{path.suffix}' is no policy", where=path, cure="Give an ONNX file (.onnx) or a TorchScript file (.pt)."
        )
    content = content_of(path)
    if is_program(path):
        program = Program.of(path.name, content)
        if not is_trusted(program):
            raise RobotError(
                f"this policy is a program that nobody has trusted on this machine: {program}",
                where=path,
                cure=f"It would run with your rights. If you trust who made it, "
                f"`r2sego trust {shlex.quote(str(path))}`; else take it as ONNX.",
            )
    elif _EXTERNAL_DATA.search(content):
        raise RobotError("its tensors lie in other files", where=path, cure="Export the policy as one file.")
    return content


class PolicyFile:
    """A policy's file, read once and checked against its layout.

    Raises RobotError as ``read_policy``, and: more than one input, sizes other than the layout's, actions
    that are not finite, a network that damages or fills its process, or computes without an end.
    """

    def __init__(self, path: str | Path, layout: PolicyLayout) -> None:
        self.path, self._layout = Path(path), layout
        content = read_policy(self.path)
        kind = TORCHSCRIPT if is_program(self.path) else ONNX
        if kind == TORCHSCRIPT:
            try:
                require_whole(content, MOST_BYTES)
            except ValueError as error:
                raise self._error(f"this is no TorchScript file: {error}", "Export it with torch.jit.save.") from error
        try:
            self._worker = PolicyWorker(kind, content, layout.observation_size, layout.where)
        except PolicyFailedError as error:
            raise self._error(f"this policy cannot be opened: {error}", "Export the policy again.") from error
        self._check(self.network())

    def network(self) -> Evaluate:
        """The network as it is before its first observation. Raises RobotError; calling it, PolicyFailedError."""
        try:
            return self._worker.network()
        except PolicyRefusedError as error:
            raise self._error(error.what, error.cure) from error
        except PolicyFailedError as error:
            raise self._error(f"this policy cannot be opened: {error}", "Export the policy again.") from error

    def _check(self, network: Evaluate) -> None:
        layout = self._layout
        try:
            actions = network(np.zeros(layout.observation_size, np.float32))
        except PolicyFailedError as error:
            raise self._error(
                f"the network does not take the layout's {layout.observation_size} observations: {error}",
                f"Declare the layout that it was trained with: observation and history of {layout.where} are others.",
            ) from error
        if actions.shape != (layout.action_size,):
            raise self._error(
                f"the network gives {actions.size} actions, the layout {layout.action_size}",
                f"Correct joints or action.joints of {layout.where}.",
            )
        if not np.isfinite(actions).all():
            raise self._error("the network's actions are not finite", "Export the policy again.")

    def _error(self, what: str, cure: str) -> RobotError:
        return RobotError(what, where=self.path, cure=cure)
