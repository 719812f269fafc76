"""The slot of the renderer of structural conditions, and the one that the settings ask for.

A backend is a file of this folder with ``BACKENDS``, its names in ``generation.renderer``
(``config.slots``), and a function ``make``; nothing else has to know of it.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Protocol, cast

from ...config.settings import GenerationSettings
from ...config.slots import RENDERERS
from ...geometry.proxy.proxy import GeometryProxy
from .conditions import Renderer


class RendererBackend(Protocol):
    """A file of this folder."""

    BACKENDS: Mapping[str, str]

    def make(self, name: str, proxy: GeometryProxy) -> Renderer:
        """The renderer ``name`` of ``proxy``. Raises MachineError when it is not there."""
        ...


def make_renderer(proxy: GeometryProxy, settings: GenerationSettings) -> Renderer:
    """The renderer that ``generation.renderer`` names. Raises MachineError when it is not there."""
    module = importlib.import_module(f".{RENDERERS.module(settings.renderer)}", __package__)
    return cast(RendererBackend, module).make(settings.renderer, proxy)
