"""``r2sego try-rollouts`` says what went wrong, not only how often."""

from dataclasses import replace

import click.testing
from fake_bundle import write_bundle
from fake_rollouts import ROBOT, rollouts

from r2sego_blender.commands.cli import main
from r2sego_blender.editing import trial_rollouts
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.rollout import Rollout


def test_the_most_frequent_failure_is_told_with_what_happened(tmp_path, monkeypatch):
    write_bundle(tmp_path / "room.r2s")
    well, touched, astray, _ = rollouts(RobotModel.load(ROBOT))
    late = replace(astray, reason="time_out", detail="1.25 m from the goal")

    def told(*tried: Rollout) -> dict[str, str]:
        monkeypatch.setattr(trial_rollouts, "try_rollouts", lambda *_: tried)
        done = click.testing.CliRunner().invoke(main, ["try-rollouts", str(tmp_path / "room.r2s")])
        return dict(line.split(": ", 1) for line in done.stdout.splitlines())

    failed = told(touched, late, well, replace(late, detail="0.40 m from the goal"))
    assert (failed["succeeded"], failed["failures"]) == ("1", "time_out (2), body_contact (1)")
    assert failed["most_frequent"] == "time_out, 1.25 m from the goal"
    assert "most_frequent" not in told(well)
