"""Decisions by hand outlive views that are generated anew, where those show the same."""

import json
import shutil
from pathlib import Path

import pytest
from box_room import arc
from bundles import new_bundle
from progress_recorder import ProgressRecorder

from r2sego_blender.bundle.artifacts import Artifact
from r2sego_blender.bundle.runner import Runner
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.generation.carried_decisions import carry_decisions
from r2sego_blender.generation.conditions.condition_files import save_conditions
from r2sego_blender.generation.decisions import DECISION, decision_of, save_decision
from r2sego_blender.refine import steps as steps_module
from r2sego_blender.refine.capture_steps import AlignedPriors, RegisteredCaptures
from r2sego_blender.refine.steps import Steps


def write_view(folder: Path, camera: Camera, conditions, estimate: bool = True) -> Path:
    folder.mkdir(parents=True)
    save_conditions(folder / "conditions", conditions)
    record = {"query": camera.to_json(), "estimate": camera.to_json() if estimate else None}
    (folder / "pose.json").write_text(json.dumps(record))
    return folder


@pytest.fixture(scope="module")
def cameras() -> list[Camera]:
    return arc(4, 48, 36)


@pytest.fixture
def before(tmp_path, box_room, cameras) -> Path:
    """Four views, of which the first was rejected and the third accepted."""
    conditions = box_room.renderer.render(cameras)
    for rank, camera in enumerate(cameras):
        write_view(tmp_path / "before" / f"{rank:03d}", camera, conditions[: rank + 1])
    save_decision(tmp_path / "before" / "000", False)
    save_decision(tmp_path / "before" / "002", True)
    return tmp_path / "before"


def test_a_decision_holds_for_the_same_camera_and_condition_whatever_its_rank(tmp_path, before, box_room, cameras):
    conditions = box_room.renderer.render(cameras)  # rendered anew: the files come out the same
    after = tmp_path / "after"
    for rank, index in enumerate((2, 3, 0)):
        write_view(after / f"{rank:03d}", cameras[index], [conditions[index]])  # of the last frame alone
    assert carry_decisions(before, after) == []
    assert [decision_of(after / name) for name in ("000", "001", "002")] == [True, None, False]


def test_what_shows_something_else_is_decided_anew_and_said(tmp_path, before, box_room, cameras):
    conditions = box_room.renderer.render(cameras)
    after = tmp_path / "after"
    write_view(after / "000", cameras[0], [conditions[1]])  # the camera's, but another surface
    write_view(after / "001", cameras[1], [conditions[2]])  # the surface, but another camera's
    write_view(after / "002", cameras[2], [conditions[2]], estimate=False)
    save_decision(before / "001", False)
    (before / "003" / DECISION).write_text("{")
    first, second, third, fourth = carry_decisions(before, after)
    assert first == "view 0: that it was rejected by hand is dropped, no view shows the same now"
    assert second.startswith("view 1: that it was rejected")
    assert third == "view 2: that it was accepted by hand is dropped, no pose could be estimated for it now"
    assert fourth.startswith("view 3: what was decided of it by hand is damaged")
    assert not list(after.rglob(DECISION))
    save_decision(before / "002", False)  # a rejection needs no pose
    assert len(carry_decisions(before, after)) == 3 and decision_of(after / "002") is False


def test_nothing_is_carried_where_there_was_nothing(tmp_path, before):
    assert carry_decisions(tmp_path / "none", before) == []
    shutil.rmtree(before / "000" / "conditions")
    assert carry_decisions(before, tmp_path / "none")[0].endswith("no view shows the same now")


def test_the_step_carries_them_and_warns(tmp_path, box_room, cameras, monkeypatch):
    """The step of the bundle, with a generator that only writes conditions."""
    shown = box_room.renderer.render(cameras)

    scene = new_bundle(tmp_path / "room.r2s")
    (scene.path / "targets").mkdir()

    def generate(selection, candidates, captures, renderer, generator, landmarks, h, folder, *others):
        for rank, condition in enumerate(shown):
            write_view(folder / f"{rank:03d}", cameras[rank], [condition])

    class Nothing:
        """Stands for what the generator would read."""

        def __init__(self, *given) -> None:
            self.vertices = self.faces = None

        build = staticmethod(lambda *given: None)
        require_captures = lambda self, count: (None, None)  # noqa: E731
        __enter__ = lambda self: self  # noqa: E731
        __exit__ = lambda self, *given: None  # noqa: E731

    def read_as_nothing(name: str) -> Artifact:
        return Artifact(name, load=lambda place: Nothing())

    for name in ("PointConditions", "open_generator", "ClearSpace", "Landmarks", "make_renderer"):
        monkeypatch.setattr(steps_module, name, Nothing)
    for name in ("proxy_depths", "reliable_depths", "completed_depths"):
        monkeypatch.setattr(steps_module, name, Nothing)
    monkeypatch.setattr(steps_module, "ego_video_reg", generate)
    nothing = read_as_nothing("nothing")
    captures = RegisteredCaptures(Artifact("captures", load=lambda place: ()), nothing, nothing)
    priors = AlignedPriors(nothing, nothing, nothing, nothing)
    progress = ProgressRecorder()

    def run() -> Path:
        steps = Steps(Runner(scene), Settings(), progress)
        (made,) = steps.ego_video_reg(0, captures, priors, nothing, read_as_nothing("targets"))
        return scene.path / made.name

    views = run()
    save_decision(views / "001", False)
    (scene.path / "targets" / "another").touch()
    assert decision_of(run() / "001") is False and progress.warnings == []
    shown[1] = shown[2]
    (scene.path / "targets" / "another").unlink()
    assert decision_of(run() / "001") is None
    assert progress.warnings == ["round 0, view 1: that it was rejected by hand is dropped, no view shows the same now"]
