"""The photographs and their cameras, and the world's frame by hand."""

from ...r2sego_blender.results.panels.sparse_cloud import forget_clouds
from .. import state
from . import facts, properties
from .correct_registration import R2SEGO_OT_correct_registration
from .import_captures import R2SEGO_OT_import_captures
from .known_length import R2SEGO_OT_add_length, R2SEGO_OT_remove_length
from .look_through import R2SEGO_OT_look_through
from .look_through_next import R2SEGO_OT_look_through_next
from .pick_point import R2SEGO_OT_pick_point
from .place_frame import R2SEGO_OT_place_frame
from .remove_pick import R2SEGO_OT_remove_pick
from .undo_correction import R2SEGO_OT_undo_correction

CLASSES = (
    *properties.CLASSES,
    R2SEGO_OT_import_captures,
    R2SEGO_OT_look_through,
    R2SEGO_OT_look_through_next,
    R2SEGO_OT_pick_point,
    R2SEGO_OT_remove_pick,
    R2SEGO_OT_add_length,
    R2SEGO_OT_remove_length,
    R2SEGO_OT_place_frame,
    R2SEGO_OT_correct_registration,
    R2SEGO_OT_undo_correction,
)


def register():
    """Attach the properties, and read the captures of every opened bundle."""
    properties.attach()
    state.readers[facts.CaptureFacts] = state.Reader(facts.read)
    state.readers[facts.PickFacts] = state.Reader(facts.read_picks, facts.chosen_picks)
    state.followers.append(facts.follow)
    state.forgetters.append(facts.forget_bundle)


def unregister():
    """Take them away."""
    state.forgetters.remove(facts.forget_bundle)
    state.followers.remove(facts.follow)
    del state.readers[facts.PickFacts], state.readers[facts.CaptureFacts]
    forget_clouds()
    properties.detach()
