"""The tensors of a motion's file of torch's, read in a process of its own.

torch is told to read tensors alone (``weights_only``), which has had ways around it (CVE-2025-32434,
CVE-2026-24747), and reads behind the end of what was cut off: so it is done where there is nothing else to
read, to write or to reach. NumPy is needed only for what comes back.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import NativeError, RobotError
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ...workers.confinement import bound_memory, confine

if TYPE_CHECKING:
    import numpy as np

FIELDS = (
    *("rigid_body_pos", "rigid_body_rot", "rate_hz", "fps", "joint_names"),
    *("qpos", "joint_pos", "dof_pos", "root_pos", "root_quat"),
)
"""What a motion is made of; other arrays of its file are left alone."""

_LIMIT_S = 120.0
_MORE_MEMORY, _TIMES_FILE = 200_000_000, 10
_DAMAGED = "this holds more than tensors, or is damaged"
_CURE = "Save tensors alone, by their names; see docs/controllers.md."


def tensors_of(file: Path) -> dict[str, np.ndarray]:
    """The tensors and numbers called ``FIELDS``, by their names. Raises RobotError: others, or damage."""
    from ...core.arrays import opened_arrays

    with ScratchFolder() as folder:
        arrays = Path(folder, "tensors.npz")
        try:
            call_in_child(read_tensors, {"file": str(file.resolve()), "arrays": str(arrays)}, timeout_s=_LIMIT_S)
        except NativeError as error:
            raise RobotError(_DAMAGED, where=file, cure=_CURE) from error
        except RobotError as error:
            raise RobotError(error.what, where=file, cure=error.cure) from error
        with opened_arrays(arrays, RobotError, _DAMAGED, _CURE) as found:
            return dict(found)


def read_tensors(request: dict[str, Any]) -> dict[str, Any]:
    """Write the tensors of ``file`` to ``arrays``; in a process of its own, whose rights it gives up."""
    file, arrays = Path(request["file"]), Path(request["arrays"])
    confine([file], [arrays.parent, Path(tempfile.gettempdir())])
    size = file.stat().st_size
    import numpy as np
    import torch

    bound_memory(max(_MORE_MEMORY, _TIMES_FILE * size))
    try:
        content = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # its unpickler and its archives raise many kinds
        raise RobotError(_DAMAGED, cure=_CURE) from error
    if not isinstance(content, Mapping):
        raise RobotError(f"it holds a {type(content).__name__}, not named tensors", cure=_CURE)
    found = {}
    for name in FIELDS:
        value = content.get(name)
        try:
            if isinstance(value, torch.Tensor):
                # A view may say that it has any number of values.
                if value.numel() * value.element_size() > size:
                    raise ValueError("it says that it holds more than the file")
                found[name] = np.array(value.detach().numpy())
            elif isinstance(value, (int, float)):
                found[name] = np.array(float(value))
        except (RuntimeError, TypeError, ValueError, ArithmeticError) as error:  # sparse, quantised, bfloat16
            raise RobotError(f"{name} is no plain tensor of numbers", cure=_CURE) from error
    with arrays.open("wb") as stream:
        np.savez(stream, **found)
    return {}
