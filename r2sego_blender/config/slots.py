"""The paper's slots whose backends are files of a folder: what each file offers there.

A file of the slot's folder that begins a line with ``BACKENDS = {...}``, the names in the settings and
what people are shown for them, is a backend; ``ORDER`` is its place among the choices. Both are literals,
read from the text: the settings and Blender's Python know them, and import none of what stands behind.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

LIBRARY = Path(__file__).resolve().parents[1]

_BACKENDS = re.compile(r"^BACKENDS = (\{.*?\})$", re.MULTILINE | re.DOTALL)
_ORDER = re.compile(r"^ORDER = (\d+)$", re.MULTILINE)
_LAST = 1000  # of those that name no place: what Blender's files remember by number stays the same


@dataclass(frozen=True)
class Slot:
    """A slot by its ``folder`` in the library."""

    folder: str

    @cached_property
    def labels(self) -> Mapping[str, str]:
        """What each backend is called for people, by its name in the settings."""
        return {name: label for name, (label, _) in self._backends.items()}

    def module(self, name: str) -> str:
        """The name, inside the folder's package, of the module that has the backend ``name``."""
        return self._backends[name][1]

    @cached_property
    def _backends(self) -> dict[str, tuple[str, str]]:
        found = []
        for file in sorted((LIBRARY / self.folder).glob("*.py")):
            text = file.read_text(encoding="utf-8")
            if declared := _BACKENDS.search(text):
                place = _ORDER.search(text)
                order = int(place[1]) if place else _LAST
                found.append((order, file.stem, ast.literal_eval(declared[1])))
        return {name: (label, stem) for _, stem, labels in sorted(found) for name, label in labels.items()}


SURFACES = Slot("geometry/surfaces")
"""What makes the surface of depth maps, ``proxy.surface``."""

RENDERERS = Slot("generation/conditions")
"""What renders the structural conditions, ``generation.renderer``."""

GENERATORS = Slot("generation/generators")
"""What makes the clips, ``generation.generator``."""

REGISTRARS = Slot("generation/registration")
"""What tells where generated frames were taken, ``registration.registrar``."""

TRAINERS = Slot("splats/backends")
"""What renders and moves the Gaussians in training, ``training.backend``."""

ESTIMATORS = Slot("geometry/estimators")
"""What estimates depth of captures that stereo and sensors do not know."""

ACTION_SPACES = Slot("policy/action_spaces")
"""What the numbers of a policy's action mean, and what carries them out."""
