"""The bench of Blenders that share frames: every frame once, and figures that fit together."""

import pytest

from r2sego_blender.core.errors import SettingsError
from tools.benchmarks.shards import bench_shards, lines


def test_every_frame_is_rendered_once():
    pytest.importorskip("bpy", reason="pip bpy is not installed")
    figures = bench_shards(frames=104, workers=2, triangles=500, size="32x24")
    assert (figures["rendered"], figures["unfinished_turns"]) == (104, 0)
    assert figures["rate"] == figures["shared_frames_per_s"] / figures["alone_frames_per_s"] > 0.0
    assert 0.0 <= figures["grown_mb"] < figures["memory_mb"]
    assert "104 frames shared, 104 rendered" in lines(figures)[2]


@pytest.mark.parametrize("options", [{"frames": 3}, {"workers": 0}, {"triangles": 0}, {"size": "64"}])
def test_options_that_cannot_be_are_refused(options):
    with pytest.raises(SettingsError, match="--"):
        bench_shards(**options)
