"""What the example scripts share: this checkout on the path, the operators, installed or of it, and the
ranges of their numbers."""

import contextlib
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from r2sego_blender.bridge.shared.reports import reported
from r2sego_blender.core.errors import SceneError

ROOT = Path(__file__).resolve().parents[2]


@contextlib.contextmanager
def enabled_addon() -> Iterator[None]:
    """``bpy.ops.r2sego`` in an empty file: of the installed add-on, else of this checkout.

    What an operator reports as an error becomes a SceneError.
    """
    addon = None if dir(bpy.ops.r2sego) else _checkout()
    bpy.ops.wm.read_homefile(use_empty=True)
    if addon is not None:
        addon.register()
    try:
        yield
    except RuntimeError as error:
        raise SceneError(reported(error).rstrip(".")) from error
    finally:
        if addon is not None:
            addon.unregister()


def require_in_range(name: str, /, **given) -> None:
    """Raise SceneError for a number outside of what the operator of this name takes, which Blender would move
    into its range without a word."""
    known = getattr(bpy.ops.r2sego, name).get_rna_type().properties
    for what, value in given.items():
        if what in known and known[what].type in {"INT", "FLOAT"} and isinstance(value, (int, float)):
            low, high = known[what].hard_min, known[what].hard_max
            if not low <= np.float32(value) <= high:
                raise SceneError(f"{what} is {value:g}", where=name, cure=f"It lies from {low:g} to {high:g}.")


def _checkout():
    """The add-on this script belongs to, as the module ``r2sego``."""
    spec = importlib.util.spec_from_file_location(
        "r2sego", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    addon = sys.modules["r2sego"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(addon)
    return addon
