"""7-Scenes: a sequence of frames with a pose each, or a scene, of which the training sequences are read."""

from __future__ import annotations

from pathlib import Path

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat
from ..seven_scenes_files import TRAIN, holds_frames


def find(place: Path) -> list[Path]:
    """A scene or a sequence, at its own folder."""
    found = place.is_dir() and ((place / TRAIN).is_file() or holds_frames(place))
    return [place] if found else []


def read(place: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``seven_scenes``; metric. The sensor's depth is of another camera, and stays out."""
    from ..photographs import with_unique_names
    from ..seven_scenes import frames_in, posed_frame, sequences
    from ..trajectories import thinned

    folders = sequences(place, TRAIN) if (place / TRAIN).is_file() else [place]
    photographs = [posed_frame(frame) for one in folders for frame in frames_in(one)]
    return Posed(with_unique_names(thinned(photographs, settings.max_keyframes, progress)), FORMAT.name, metric=True)


FORMAT = PoseFormat("7-Scenes", find, read, photographs_too=True, order=7)
