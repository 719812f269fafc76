"""What `r2sego select` says: the targets with their references, and every candidate's reason."""

import json

import numpy as np
import pytest
from bundles import new_bundle

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.results.selection_report import describe_selection, lines
from r2sego_blender.views.references import with_references
from r2sego_blender.views.selection import save_candidates, select_targets

LENS = Camera(64, 48, 40.0, 40.0, 32.0, 24.0, np.eye(4))
NAMES = ("door", "sofa", "window")
FRAMES = 20


def turned(x):
    return LENS.at(look_at([x, 0.0, 1.0], [x, 3.0, 1.0]))


@pytest.fixture
def scene(tmp_path) -> Scene:
    """Two rollouts that pass three captures of a wall; the candidates stand in no order."""

    def fill(folder):
        (folder / "captures").mkdir()
        captures = [
            {"name": name, "file": f"images/{name}.png", **turned(x).to_json()}
            for name, x in zip(NAMES, (-1.0, 0.0, 1.0), strict=True)
        ]
        images = folder / "captures" / "images"
        images.mkdir()
        for name in NAMES:
            (images / f"{name}.png").write_bytes(b"")
        (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": captures}))

    scene = new_bundle(tmp_path / "room.r2s", fill)
    rng = np.random.default_rng(0)
    order = rng.permutation(2 * FRAMES)
    rollout, frame = order // FRAMES, order % FRAMES
    settings = SelectionSettings(target_views=2, nms_window=5)
    deficit = np.where(frame == 10, 0.9, 0.2 + 0.001 * frame) - 0.1 * rollout
    selection = select_targets(deficit, np.full(2 * FRAMES, 0.5), rollout, frame, settings)
    cameras = [turned(0.1 * f - 1.0) for f in frame]
    wall = lambda camera: np.full(camera.shape, 3.0, np.float32)  # noqa: E731
    captures = [turned(x) for x in (-1.0, 0.0, 1.0)]
    with_references(selection, cameras, captures, wall, settings, 2).save(scene.path / "rounds/0/selection")
    save_candidates(scene.path / "rounds/0/selection", cameras)
    return scene


def test_targets_come_best_first_with_their_reference(scene):
    described = json.loads(json.dumps(describe_selection(scene, 0)))
    assert [(t["rollout"], t["frame"]) for t in described["targets"]] == [(0, 10), (1, 10)]
    for target in described["targets"]:  # at x = 0, in front of the sofa
        assert target["reference"] == "sofa"
        assert list(target["overlaps"]) == ["sofa", "door", "window"]
        assert target["overlaps"]["sofa"] == 1.0
        assert 0.1 < target["overlaps"]["door"] < 0.9
        assert target["score"] == pytest.approx(target["deficit"] * target["availability"])
    assert "candidates" not in described


def test_every_candidate_is_explained_rollout_by_rollout(scene):
    described = describe_selection(scene, 0, explain=True)
    stream = [(c["rollout"], c["frame"]) for c in described["candidates"]]
    assert stream == [(r, f) for r in (0, 1) for f in range(FRAMES)]
    text = lines(described)
    assert "2 target views of 40 candidates" in text[0]
    second = text.index(next(line for line in text if line.startswith("rollout 1: 20 candidates, 1 chosen")))
    marked = [line for line in text if line.startswith("*")]
    assert [line.split()[1] for line in marked] == ["10", "10"]
    assert "chosen, rank 1 of 2" in marked[0] and "chosen, rank 2 of 2" in marked[1]
    near = next(line for line in text[second:] if line.split()[:1] == ["9"])
    assert near.endswith("suppressed: frame 10 of this rollout scores higher")
    assert len(text) - second == 2 + FRAMES


def test_without_explain_the_lines_are_few(scene):
    text = lines(describe_selection(scene, 0))
    assert not any(line.startswith("rollout") for line in text)
    best = next(line for line in text if line.split()[:3] == ["1", "0", "10"])
    assert "sofa 100%" in best and "90.0%" in best and "0.450" in best


def test_a_selection_made_with_other_captures_is_said_to_be(scene):
    file = scene.captures_folder / "cameras.json"
    captures = json.loads(file.read_text())["captures"]
    file.write_text(json.dumps({"captures": captures[:1]}))
    with pytest.raises(GenerationError, match=r"selection: .* with 3 captures, and the scene has 1\. Run"):
        describe_selection(scene, 0)
