"""The room's cached facts, read whenever the bundle was opened or has changed."""

from ...r2sego_blender.bridge.captures.show_captures import shows_older_captures
from ...r2sego_blender.captures.frame.correction_history import corrections_of
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.capture_list import listed_captures
from ...r2sego_blender.results.panels.sparse_cloud import read_cloud
from .properties import fit_again


def forget_picks(scene, bundle):
    """Forget what was picked and chosen in another bundle."""
    group = scene.r2sego_captures
    for kept in (group.captures, group.points, group.lengths, group.residuals):
        kept.clear()
    for name in ("active_capture", "active_point", "use_camera_height", "height_capture", "camera_height"):
        group.property_unset(name)


def read_captures(scene, bundle):
    """Fill the list of captures, the drawn points and the residuals of what is picked."""
    group = scene.r2sego_captures
    try:
        listed = listed_captures(bundle)
    except R2SEgoError:
        group.captures.clear()
        raise
    if [one.name for one in listed] != [one.name for one in group.captures]:
        group.captures.clear()
        for _ in listed:
            group.captures.add()
        group.active_capture = 0
    for shown, one in zip(group.captures, listed, strict=True):
        shown.name, shown.width, shown.height = one.name, one.width, one.height
        shown.view_deg, shown.points, shown.overlaps = one.view_deg, one.points, one.overlaps
    if not group.height_capture and listed:
        group.height_capture = listed[0].name
    group.corrections = len(corrections_of(bundle.path))
    group.older = shows_older_captures(scene, bundle)
    read_cloud(bundle)
    fit_again(scene)
