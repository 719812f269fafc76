"""What Blender remembers of trials: the study that is open, and the device that judges."""

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from ...r2sego_blender.trials.running.live import Live
from . import facts, session


class R2SEGO_PG_trials(bpy.types.PropertyGroup):
    """The room Trials."""

    study: StringProperty(name="Study", description="The study's folder, NAME.trials", subtype="DIR_PATH")
    device: StringProperty(
        name="Device", description="Where the device is: /dev/ttyACM0, COM3, socket://HOST:PORT, rfc2217://HOST:PORT"
    )
    adapter: StringProperty(
        name="Kind",
        description="What it is: stream (sends by itself, as the sketch does), mark10 or mark10:CHANNEL (is asked)",
        default="stream",
    )
    baud: IntProperty(name="Baud", description="The line's rate; 0 is the usual one of its kind", default=0, min=0)
    calibration: StringProperty(
        name="Calibration",
        description="The device's calibration, as r2sego trials calibrate wrote it",
        subtype="FILE_PATH",
    )
    simulated: BoolProperty(name="Simulated", description="A simulated device in place of a real one: nothing counts")

    @property
    def facts(self) -> facts.StudyFacts:
        """What the study's folder held when it was read."""
        return facts.of(self.id_data)

    @property
    def live(self) -> Live | None:
        """The running session of this study, None where none is followed."""
        return session.live_of(facts.study_path(self.id_data))
