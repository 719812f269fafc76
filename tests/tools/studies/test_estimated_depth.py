"""One point of the study on a painted room: what is recorded is what was disturbed, and nothing of it stays behind."""

import pytest
from painted_room import write_painted_room

from r2sego_blender.geometry.room.completed_depth import COMPLETED
from tools.studies.estimated_depth import NONE, Point, measure

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "room").mkdir()
    scene = write_painted_room(folder / "room")
    points = (Point(NONE), Point("all"), Point("smooth", 0.05))
    return folder, {point.name: measure(scene, folder / "to", point) for point in points}


def test_a_point_without_an_estimate_has_none(measured):
    _, found = measured
    assert not {"given", "estimate", "best"} & set(found[NONE])
    assert 0.5 < found[NONE]["completed"]["within_5_percent"] <= 1.0


def test_true_depth_is_brought_back_to_the_truth_and_completes_it(measured):
    _, found = measured
    true = found["all_0_0"]
    assert true["given"]["absrel"] < 1e-6
    assert true["estimate"]["within_5_percent"] > 0.98 * true["estimate"]["valid"]
    assert true["completed"]["within_5_percent"] >= found[NONE]["completed"]["within_5_percent"]
    assert true["best"]["within_5_percent"] >= true["completed"]["within_5_percent"] - 0.02


def test_a_disturbed_point_is_as_far_off_as_it_says(measured):
    _, found = measured
    assert 0.03 < found["smooth_0.05_0"]["given"]["absrel"] <= 0.05
    assert found["smooth_0.05_0"]["estimate"]["within_1"] > 0.4
    assert found["smooth_0.05_0"]["estimate"]["unseen"]["valid"] <= 1.0


def test_only_the_bundle_without_estimates_stays(measured):
    folder, _ = measured
    assert [one.name for one in (folder / "to").iterdir()] == ["room.r2s"]
    assert not (folder / "to" / "room.r2s" / "estimates").exists()


def test_what_was_cut_off_goes_on_where_it_stopped(measured):
    folder, found = measured
    kept = []

    def cut_off(figures):
        kept.append(dict(figures))
        raise KeyboardInterrupt

    scene, to = folder / "room", folder / "to"
    with pytest.raises(KeyboardInterrupt):
        measure(scene, to, Point("smooth", 0.05), keep=cut_off)
    (bundle,) = to.glob("room_smooth*")
    stamp = (bundle / COMPLETED.name).stat().st_mtime_ns
    stamps = set()
    again = measure(
        scene, to, Point("smooth", 0.05), keep=lambda _: stamps.add((bundle / COMPLETED.name).stat().st_mtime_ns)
    )
    assert stamps == {stamp}
    assert again == found["smooth_0.05_0"] and kept[0]["completed"] == again["completed"] and "proxy" not in kept[0]
