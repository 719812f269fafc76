"""The asset of the bundle, shown: what its checks share."""

import bpy
import numpy as np
from support import open_bundle

SPLATS, BACKDROP_SPLATS = 60, 12  # as tests/fakes/fake_asset.py writes them


def group():
    """What the room remembers."""
    return bpy.context.scene.r2sego_asset


def show(stage="final"):
    """Open the bundle and show a stage; returns the object."""
    open_bundle()
    assert bpy.ops.r2sego.show_asset(stage=stage) == {"FINISHED"}
    return group().shown


def values(shown, name):
    """An attribute of the vertices."""
    attribute = shown.data.attributes[name]
    found = np.empty(len(attribute.data), bool if attribute.data_type == "BOOLEAN" else np.float32)
    attribute.data.foreach_get("value", found)
    return found


def centres(shown):
    """(N, 3) the vertices."""
    found = np.empty(3 * len(shown.data.vertices), np.float32)
    shown.data.vertices.foreach_get("co", found)
    return found.reshape(-1, 3)
