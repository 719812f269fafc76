"""What the embedded generator makes of any view, of a scene's captures and its last proxy."""

from __future__ import annotations

from collections.abc import Callable

from ..bundle.scene import Scene
from ..captures.store import CAPTURES
from ..core.cameras import Camera
from ..core.errors import R2SEgoError
from ..generation.conditions.conditions import ZBufferRenderer
from ..generation.generators.blending import BlendingGenerator
from ..generation.generators.slot import Frame
from ..geometry.proxy.proxy import PROXY
from ..geometry.stereo.stereo import DEPTH
from ..refine.depths import proxy_depths, reliable_depths


def blended_captures(scene: Scene) -> Callable[[Camera], Frame] | None:
    """Gives the captures' blend at a camera; what none of them saw of it has the surfaces' colours as they are
    continued, and the confidence of a hole. None where the scene has no proxy that can be read.
    """
    h, last = scene.declaration.settings, scene.newest_round("asset.ply")
    if last < 0:
        return None
    try:
        captures, proxy = scene.read(CAPTURES), scene.read(PROXY.of_round(last))
        observed = reliable_depths(captures, scene.read(DEPTH), h.stereo)
    except R2SEgoError:
        return None
    generator = BlendingGenerator(captures, proxy_depths(captures, proxy), h.generation, observed)
    renderer = ZBufferRenderer(proxy)
    return lambda camera: generator.blend(renderer.condition(camera), seen=False)
