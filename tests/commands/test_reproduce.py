"""``r2sego reproduce table3`` takes scores of the assets that its policies will see."""

from __future__ import annotations

import json

import pytest
from bundles import new_bundle
from click.testing import CliRunner

from r2sego_blender.commands.cli import main


@pytest.mark.parametrize(("arms", "told"), [(["refined"], "not scored"), (["gaussgym", "refined"], "changed")])
def test_policies_wait_for_scores_that_hold(tmp_path, arms, told):
    scene = new_bundle(tmp_path / "room.r2s")
    scene.report_folder.mkdir()
    scores = {arm: {"psnr": 20.0, "ssim": 0.5} for arm in arms}
    scene.metrics_file.write_text(json.dumps({"arms": scores, "assets": {"asset.ply": "of before"}}))
    scene.note(step="asset.ply", inputs="0", output="of now")
    asked = ["reproduce", "table3", str(scene.path), "--out", str(tmp_path / "out"), "--seeds", "1", "--episodes", "1"]
    done = CliRunner().invoke(main, asked)
    assert done.exit_code == 1 and told in done.output and "r2sego evaluate" in done.output
    assert not [*(tmp_path / "out").glob("*")]
