"""The bench of conditions: complete figures that fit together, and clear words about options."""

import json
import math

import pytest
from click.testing import CliRunner

from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import SettingsError
from tools.benchmarks.conditions import FRAMES, bench_conditions, lines


def test_figures_are_written_and_fit_together(tmp_path):
    file = tmp_path / "figures.json"
    options = ["--triangles", "2000", "--size", "64x48", "--repeats", "1", "--json", str(file)]
    result = CliRunner().invoke(main, ["bench", "conditions", *options], catch_exceptions=False)
    assert result.exit_code == 0
    figures = json.loads(file.read_text())
    assert result.output.strip().splitlines()[-len(lines(figures)) :] == lines(figures)
    assert (figures["size"], figures["renderer"], figures["frames"]) == ("64x48", "z-buffer", FRAMES)
    assert abs(figures["triangles"] - 2000) < 400
    passes = figures["passes"]
    assert math.isclose(figures["frames_per_s"] * passes["generator_passes"]["wall_ms"], 1000.0)
    both_ms = passes["generator_passes"]["wall_ms"] + passes["points_and_visibility"]["wall_ms"]
    assert math.isclose(figures["frames_per_s_with_points"] * both_ms, 1000.0)
    assert all(cost["wall_ms"] > 0.0 for cost in passes.values())
    assert 0.0 < figures["clip_mb"] < FRAMES * 64 * 48 * 60 / 1e6


@pytest.mark.parametrize("options", [{"triangles": 0}, {"repeats": 0}, {"size": "64"}])
def test_options_that_cannot_be_are_refused(options):
    with pytest.raises(SettingsError, match="--"):
        bench_conditions(**options)
