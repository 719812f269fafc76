"""Reading a bundle beside a job: what is caught halfway is read again, and what stays halfway is told."""

import json
import threading
import time

import pytest
from bundles import new_bundle
from expected_errors import refused

from r2sego_blender.bundle import damage
from r2sego_blender.bundle.damage import damaged_results
from r2sego_blender.bundle.journal import Journal
from r2sego_blender.bundle.layout import REFINED_ASSET
from r2sego_blender.bundle.reading import read_beside_jobs
from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core import atomic_files as whole_files
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import SceneError
from r2sego_blender.results.plan import describe_plan
from r2sego_blender.results.status import describe, lines


def fill(folder):
    (folder / "captures").mkdir(exist_ok=True)
    (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": [{}, {}]}))


@pytest.fixture
def scene(tmp_path) -> Scene:
    return new_bundle(tmp_path / "room.r2s", fill)


def status(scene):
    return read_beside_jobs(scene.path, lambda opened: describe(opened, look_at_results=True))


class _Killed(BaseException):
    pass


def correct(scene, monkeypatch, killed_at):
    """A correction of captures and declaration that is killed at a rename once it counts."""
    renames, rename = [], whole_files.rename

    def killed(made, place):
        if ".changes" in made.parts or ".unfinished-old" in place.name:
            renames.append(place)
            if len(renames) == killed_at:
                raise _Killed
        rename(made, place)

    with monkeypatch.context() as patch, pytest.raises(_Killed):
        patch.setattr(whole_files, "rename", killed)
        with scene.corrected() as new:
            fill(new.path)
            new.declare(ground="corrected")


def test_a_correction_that_was_cut_off_halfway_is_told(scene, monkeypatch):
    assert not status(scene)["half_corrected"]
    correct(scene, monkeypatch, killed_at=3)  # the captures are in their place, the declaration is not
    told = status(scene)
    assert told["half_corrected"] and not told["refined"] and told["ground"] == "floor"
    assert "a correction was cut off before all of it was in its place; refine" in "\n".join(lines(told))
    assert describe_plan([], half_corrected=True)["line"].startswith("A correction was cut off")
    with refused(SceneError, scene.path, "finished now"), scene.locked():
        pass
    told = status(scene)
    assert not told["half_corrected"] and told["ground"] == "corrected"


def test_captures_put_aside_by_a_correction_that_was_cut_off_are_not_called_damaged(scene, monkeypatch):
    correct(scene, monkeypatch, killed_at=2)
    assert not scene.captures_folder.exists()
    with refused(SceneError, scene.path, "correction", cure="`r2sego refine`, which finishes it"):
        status(scene)


def test_what_is_gone_for_a_moment_is_read_once_it_is_back(scene):
    aside = scene.path / ".unfinished-old-captures"
    scene.captures_folder.rename(aside)
    (scene.path / ".changes").mkdir()
    (scene.path / ".changes" / "parts.json").write_text("[]")

    def finish():
        time.sleep(0.3)
        aside.rename(scene.captures_folder)
        (scene.path / ".changes" / "parts.json").unlink()

    job = threading.Thread(target=finish)
    job.start()
    told = status(scene)
    job.join()
    assert told["captures"] == 2 and not told["half_corrected"]


def test_what_is_damaged_for_good_is_told_at_once(scene):
    (scene.captures_folder / "cameras.json").write_text("{")
    reads = []

    def read(opened):
        reads.append(opened)
        return describe(opened)

    with refused(SceneError, "captures/cameras.json", "damaged", cure="`r2sego new`"):
        read_beside_jobs(scene.path, read)
    assert len(reads) == 2


def test_a_reader_gives_up_waiting(scene):
    """A job that declares something at each look does not hold the reader for ever."""
    reads = []

    def read(opened):
        reads.append(opened.declare(ground=f"{len(reads)}"))
        return len(reads)

    started = time.monotonic()
    assert read_beside_jobs(scene.path, read) == len(reads) > 3
    assert time.monotonic() - started < 10.0


def test_a_result_that_is_published_meanwhile_is_not_called_damaged(scene, monkeypatch):
    def publish(content):
        Runner(scene).step(REFINED_ASSET, lambda file: file.write_text(content), parameters=content)

    publish("first")
    looked_at = damage.is_damaged

    def caught(of, *asked):
        if of.path == scene.path and (scene.path / REFINED_ASSET).read_text() == "first":
            old = of.outputs()
            publish("second")
            return old[REFINED_ASSET] != content_digest(of.path / REFINED_ASSET)
        return looked_at(of, *asked)

    with monkeypatch.context() as patch:
        patch.setattr(damage, "is_damaged", caught)
        assert damaged_results(Scene.open(scene.path)) == ()
    # As the step does before the third one takes its place.
    Journal(scene.path).write(publishing=REFINED_ASSET)
    (scene.path / REFINED_ASSET).write_text("third")
    assert damaged_results(scene) == () and REFINED_ASSET not in scene.outputs()
    publish("fourth")
    (scene.path / REFINED_ASSET).write_text("cut")
    assert damaged_results(scene) == (REFINED_ASSET,)
