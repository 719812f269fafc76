"""R2S-EGO: dual-proxy refinement of a few photographs into a robot's training scene.

The library behind the Blender extension. It imports no ``bpy`` outside ``bridge/``; ``bundle`` and what
it stands on need NumPy alone, so that Blender's own Python can read a scene bundle.

Scripts take from here what stays in its place when folders move: ``Scene``, ``Settings``,
``create_scene``, ``load_asset`` and ``save_asset``, each imported when it is asked for; and from
``pipeline`` the function ``refine``.
"""

import os
import sys
from importlib import import_module
from typing import Any

__version__ = "0.1.0"

if sys.platform.startswith("linux"):
    # OpenCV puts a folder of its own before what this variable holds. Before nothing, every program that is started
    # then would look for its libraries in the folder that the person stands in, which may be a stranger's.
    _PLACES = filter(None, os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep))
    os.environ["LD_LIBRARY_PATH"] = os.pathsep.join(_PLACES) or os.devnull

_HOMES = {
    "Scene": "bundle.scene",
    "Settings": "config.settings",
    "create_scene": "refine.creation",
    "load_asset": "splats.formats.registry",
    "save_asset": "splats.formats.registry",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
