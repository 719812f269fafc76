"""The engine: its set-up and the command that runs."""

from .cancel import R2SEGO_OT_cancel
from .check_engine import R2SEGO_OT_check_engine
from .set_up_engine import R2SEGO_OT_set_up_engine

CLASSES = (
    R2SEGO_OT_set_up_engine,
    R2SEGO_OT_check_engine,
    R2SEGO_OT_cancel,
)
