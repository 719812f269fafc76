"""EgoVideoReg: what is written, what is replaced, what is read back."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.generation.conditions.condition_files import load_conditions
from r2sego_blender.generation.decisions import save_decision
from r2sego_blender.generation.ego_views import ego_video_reg, load_pseudo_observations
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.generators.slot import Frame
from r2sego_blender.generation.registration.frame_registration import Landmarks
from r2sego_blender.views.references import with_references
from r2sego_blender.views.selection import select_targets

SETTINGS = Settings()
SETTINGS = replace(
    SETTINGS,
    selection=replace(SETTINGS.selection, target_views=2),
    generation=replace(SETTINGS.generation, clip_frames=3, clip_scale=0.25, max_replacements=2),
)


@pytest.fixture(scope="module")
def scene(room_a):
    """Four candidates at frozen views, best first, with what makes ego views of them."""
    count = 4
    selection = select_targets(
        np.linspace(0.8, 0.5, count), np.ones(count), np.arange(count), np.zeros(count), SETTINGS.selection
    )
    candidates = [view.camera for view in room_a.frozen[:count]]
    selection = with_references(
        selection,
        candidates,
        [capture.camera for capture in room_a.captures],
        room_a.renderer.depth,
        SETTINGS.selection,
        count,
    )
    return SimpleNamespace(
        selection=selection,
        candidates=candidates,
        generator=BlendingGenerator(room_a.captures, room_a.depths, SETTINGS.generation),
        landmarks=Landmarks.build(room_a.captures, room_a.depths),
    )


def views_of(room_a, scene, generator, folder, settings=SETTINGS, space=None):
    return ego_video_reg(
        scene.selection,
        scene.candidates,
        room_a.captures,
        room_a.renderer,
        generator,
        scene.landmarks,
        settings,
        folder,
        space=space,
    )


class FailingAt:
    """The embedded generator, except that chosen calls give up or return noise."""

    name = "failing"

    def __init__(self, inner, give_up=(), noise=()):
        self.inner, self.give_up, self.noise, self.calls = inner, give_up, noise, -1

    def generate(self, reference, conditions):
        self.calls += 1
        if self.calls in self.give_up:
            raise GenerationError("out of ideas")
        frames = self.inner.generate(reference, conditions)
        if self.calls in self.noise:
            noise = np.random.default_rng(0).random(frames[-1].image.shape, np.float32)
            frames[-1] = Frame(noise, frames[-1].confidence)
        return frames


def test_views_are_written_registered_and_read_back(tmp_path, room_a, scene):
    observations = views_of(room_a, scene, scene.generator, tmp_path)
    assert [o.rank for o in observations] == [0, 1]
    for observation in observations:
        folder = tmp_path / f"{observation.rank:03d}"
        record = json.loads((folder / "pose.json").read_text())
        query = scene.candidates[record["candidate"]]
        assert record["accepted"]
        assert record["reason"].startswith("registered")
        assert record["query"]["world_from_camera"] == query.world_from_camera.tolist()
        assert record["reference_name"] == room_a.captures[observation.reference].name
        # estimated, so near the query and yet not the query
        assert 0.0 < np.linalg.norm(observation.camera.centre - query.centre) < 0.02
        turn = rotation_angle_rad(observation.camera.world_from_camera, query.world_from_camera)
        assert np.degrees(turn) < 0.5
        assert observation.image.shape == (480, 640, 3)
        assert observation.confidence.shape == (480, 640)
        assert {p.name for p in folder.iterdir()} == {
            "path.json",
            "conditions",
            "clip",
            "clip.webp",
            "frame.png",
            "confidence.png",
            "pose.json",
        }
        conditions = load_conditions(folder / "conditions")
        assert [c.camera.shape for c in conditions] == [(120, 160), (120, 160), (480, 640)]
        path = json.loads((folder / "path.json").read_text())
        np.testing.assert_allclose(path["reference_from_frame"][0], np.eye(4), atol=1e-9)
        with Image.open(folder / "clip.webp") as clip:
            assert (clip.n_frames, clip.size) == (3, (160, 120))
    (tmp_path / "001/frame.png").write_bytes(b"")
    with pytest.raises(GenerationError, match=r"001: this generated view cannot be used"):
        load_pseudo_observations(tmp_path)


def test_of_the_conditions_the_targets_alone_may_be_kept(tmp_path, room_a, scene):
    target = replace(SETTINGS, generation=replace(SETTINGS.generation, kept_conditions="target"))
    views_of(room_a, scene, scene.generator, tmp_path, target)
    (kept,) = load_conditions(tmp_path / "000/conditions")
    np.testing.assert_allclose(
        kept.camera.world_from_camera, scene.candidates[scene.selection.targets[0]].world_from_camera
    )


def test_the_clip_follows_the_way_around_and_says_so(tmp_path, room_a, scene):
    def aside(start, end):
        """Half a metre to the side of the middle, so that both legs are as long."""
        across = np.cross(end - start, [0.0, 0.0, 1.0])
        corner = (start + end) / 2 + 0.5 * across / np.linalg.norm(across)
        return SimpleNamespace(points=np.stack([start, corner, end]), note="around it")

    views_of(room_a, scene, scene.generator, tmp_path, space=SimpleNamespace(way=aside))
    path = json.loads((tmp_path / "000/path.json").read_text())
    first, middle, last = (np.array(camera["world_from_camera"])[:3, 3] for camera in path["cameras"])
    np.testing.assert_allclose(middle, aside(first, last).points[1])
    assert path["note"] == "around it"


def test_what_a_person_decided_overrules_the_gate(tmp_path, room_a, scene):
    generator = FailingAt(scene.generator, noise=(0,))
    assert [o.rank for o in views_of(room_a, scene, generator, tmp_path)] == [1, 2]
    save_decision(tmp_path / "001", False)
    assert [o.rank for o in load_pseudo_observations(tmp_path)] == [2]
    save_decision(tmp_path / "000", True)
    with pytest.raises(GenerationError, match="accepted by hand, but has no estimated pose"):
        load_pseudo_observations(tmp_path)
    pose = json.loads((tmp_path / "000/pose.json").read_text())
    (tmp_path / "000/pose.json").write_text(json.dumps({**pose, "estimate": pose["query"]}))
    assert [o.rank for o in load_pseudo_observations(tmp_path)] == [0, 2]


def test_rejected_views_are_replaced_by_the_next_ranked(tmp_path, room_a, scene):
    generator = FailingAt(scene.generator, give_up=(0,), noise=(1,))
    observations = views_of(room_a, scene, generator, tmp_path)
    assert [o.rank for o in observations] == [2, 3]
    reasons = [json.loads(p.read_text())["reason"] for p in sorted(tmp_path.glob("*/pose.json"))]
    assert reasons[0] == "rejected: out of ideas."
    assert reasons[1].startswith("rejected: ")
    assert all(reason.startswith("registered") for reason in reasons[2:])


def test_replacements_are_bounded(tmp_path, room_a, scene):
    generator = FailingAt(scene.generator, give_up=range(9))
    assert views_of(room_a, scene, generator, tmp_path) == ()
    assert generator.calls == 3  # two targets and two replacements


def test_what_no_frame_could_be_registered_for_is_not_generated(tmp_path, room_a, scene):
    best, *others = scene.candidates
    far_above = best.at(best.world_from_camera + np.outer([0.0, 0.0, 40.0, 0.0], [0.0, 0.0, 0.0, 1.0]))
    moved = SimpleNamespace(**{**vars(scene), "candidates": [far_above, *others]})
    generator = FailingAt(scene.generator)
    assert [o.rank for o in views_of(room_a, moved, generator, tmp_path)] == [1, 2]
    assert generator.calls == 1  # counted from 0
    record = json.loads((tmp_path / "000/pose.json").read_text())
    assert record["reason"].startswith("rejected: not generated, only 0 of the captures' ")
    assert {file.name for file in (tmp_path / "000").iterdir()} == {"path.json", "conditions", "pose.json"}
    assert [c.camera.shape for c in load_conditions(tmp_path / "000/conditions")] == [(480, 640)]


def test_a_generator_that_returns_too_little_is_rejected(tmp_path, room_a, scene):
    short = SimpleNamespace(name="short", generate=lambda reference, conditions: [])
    assert views_of(room_a, scene, short, tmp_path) == ()
    record = json.loads((tmp_path / "000/pose.json").read_text())
    assert "short returned 0 frames" in record["reason"]
