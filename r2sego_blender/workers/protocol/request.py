"""What is asked of a worker, and how it becomes a folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...core.text_files import write_text
from .serving import PROTOCOL, REQUEST_FILE, write_part


@dataclass(frozen=True)
class Request:
    """One task for a worker.

    ``task`` is what is to be made: "depth", "registration", "masks", "mesh", "surface", "clip"; ``backend`` the
    name of the model that is meant. ``parameters``: JSON's values. ``inputs``: arrays of numbers, or files, by
    plain names, such as "photograph_000" or "conditions/000_points".
    """

    task: str
    backend: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, np.ndarray | Path] = field(default_factory=dict)


def write_request(request: Request, folder: Path) -> None:
    """Write a request into ``folder``; a file that lies there under its name already stays."""
    record = {
        "protocol": PROTOCOL,
        "task": request.task,
        "backend": request.backend,
        "parameters": dict(request.parameters),
        "inputs": {name: write_part(folder, name, one, move=False) for name, one in request.inputs.items()},
    }
    write_text(folder / REQUEST_FILE, json.dumps(record, sort_keys=True))
