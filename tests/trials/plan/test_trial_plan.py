"""Plans: drawn once and alike for both of a pair, frozen to the byte, ended with a reason."""

import hashlib
import math
from collections import Counter

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from trials.declarations import CONDITIONS, declared

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.plan.declaration import Declaration
from r2sego_blender.trials.plan.rules import Rules
from r2sego_blender.trials.plan.study import begin_study, end_study, freeze_plan, state_of
from r2sego_blender.trials.plan.trial_plan import TrialPlan, plan_bytes
from r2sego_blender.trials.records.index import RecordIndex


@pytest.fixture
def study(tmp_path):
    return freeze_plan(declared(tmp_path))[1]


def test_a_plan_has_the_papers_trials_in_its_order(tmp_path):
    plan, study = freeze_plan(declared(tmp_path))
    assert study == tmp_path / "sitting.trials" and TrialPlan.load(study) == plan
    assert plan.digest == hashlib.sha256((study / "plan.json").read_bytes()).hexdigest()
    assert [trial.index for trial in plan.trials] == list(range(2 * 3 * 8))
    assert [trial.condition for trial in plan.trials] == [*CONDITIONS] * 24
    counts = Counter((trial.condition, trial.policy_seed) for trial in plan.trials)
    assert set(counts.values()) == {8} and len(counts) == 6
    for trial in plan.trials:
        content = f"{trial.condition} {trial.policy_seed}".encode()
        assert trial.policy_sha256 == hashlib.sha256(content).hexdigest()
    assert plan.rules == Rules() and not plan.blinded


@pytest.mark.parametrize("text", ["", 'order = "randomised"\nblinded = true'])
def test_both_of_a_pair_have_the_same_poses_and_chair(tmp_path, text):
    plan, _ = freeze_plan(declared(tmp_path, text))
    for first, second in zip(plan.trials[::2], plan.trials[1::2], strict=True):
        assert {first.condition, second.condition} == {*CONDITIONS}
        for name in ("policy_seed", "repetition", "robot_pose", "chair_pose", "chair"):
            assert getattr(first, name) == getattr(second, name)
    assert len({trial.robot_pose for trial in plan.trials}) == 24
    of_seed = Counter((trial.policy_seed, trial.chair) for trial in plan.trials)
    assert set(of_seed.values()) == {8}


def test_poses_lie_in_their_ranges(tmp_path):
    plan, _ = freeze_plan(declared(tmp_path))
    for trial in plan.trials:
        chair, robot = trial.chair_pose, trial.robot_pose
        assert 2.0 <= chair.x_m <= 2.4 and -0.5 <= chair.y_m <= 0.5 and 150.0 <= abs(chair.heading_deg) <= 180.0
        across, along = robot.x_m - chair.x_m, robot.y_m - chair.y_m
        assert 0.9998 <= math.hypot(across, along) <= 1.5002
        bearing = math.degrees(math.atan2(along, across))
        assert abs(turn(bearing - chair.heading_deg)) <= 20.01
        assert abs(turn(robot.heading_deg - bearing - 180.0)) <= 10.01


def turn(degrees):
    return (degrees + 180.0) % 360.0 - 180.0


def test_a_plan_is_drawn_the_same_again_and_otherwise_from_another_seed(tmp_path):
    first, study = freeze_plan(declared(tmp_path))
    assert freeze_plan(declared(tmp_path), tmp_path / "again.trials")[0] == first
    other, _ = freeze_plan(declared(tmp_path, "seed = 1"), tmp_path / "other.trials")
    assert [trial.robot_pose for trial in other.trials] != [trial.robot_pose for trial in first.trials]
    assert (study / "plan.sha256").read_text() == f"{first.digest}  plan.json\n"  # as sha256sum -c reads it


def test_randomised_blocks_have_each_condition_once_and_either_first(tmp_path):
    plan, _ = freeze_plan(declared(tmp_path, 'order = "randomised"'))
    first = Counter(trial.condition for trial in plan.trials[::2])
    assert len(first) == 2 and min(first.values()) >= 5


def test_blinded_labels_tell_no_condition(tmp_path):
    plan, _ = freeze_plan(declared(tmp_path, 'order = "randomised"\nblinded = true'))
    labels = {(trial.condition, trial.policy_seed): trial.label for trial in plan.trials}
    assert sorted(labels.values()) == [f"policy {number}" for number in range(1, 7)]
    with pytest.raises(TrialError):
        Declaration.load(declared(tmp_path, "blinded = true"))


@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    place=st.floats(0.0, 1.0, exclude_max=True),
    other=st.integers(1, 255),
    which=st.sampled_from(["plan.json", "begun.json"]),
)
def test_a_plan_that_began_cannot_be_changed_in_any_byte(tmp_path_factory, place, other, which):
    study = begun(tmp_path_factory)
    file = study / which
    before = file.read_bytes()
    index = int(place * len(before))
    if which == "begun.json":
        index = before.index(b'"plan"') + 9 + index % 64  # the digest in it
    changed = bytearray(before)
    changed[index] ^= other
    file.write_bytes(changed)
    try:
        with pytest.raises(TrialError):
            TrialPlan.load(study)
    finally:
        file.write_bytes(before)
    TrialPlan.load(study)


_BEGUN = []


def begun(tmp_path_factory):
    """A study whose first trial began, made once."""
    if not _BEGUN:
        folder = tmp_path_factory.mktemp("begun")
        plan, study = freeze_plan(declared(folder))
        begin_study(study, plan)
        _BEGUN.append(study)
    return _BEGUN[0]


def test_another_plan_does_not_take_the_place_of_one_that_began(tmp_path):
    first, study = freeze_plan(declared(tmp_path))
    second, _ = freeze_plan(declared(tmp_path, "seed = 1"))
    assert second.digest != first.digest
    with pytest.raises(TrialError):
        begin_study(study, first)
    begin_study(study, second)
    begin_study(study, second)
    with pytest.raises(TrialError):
        freeze_plan(declared(tmp_path, "seed = 2"))
    other, elsewhere = freeze_plan(declared(tmp_path, "seed = 2"), tmp_path / "b.trials")
    for name in ("plan.json", "plan.sha256"):  # both, so that they fit together
        (study / name).write_bytes((elsewhere / name).read_bytes())
    with pytest.raises(TrialError):
        TrialPlan.load(study)
    assert other.digest != second.digest


def test_that_a_plan_began_cannot_be_taken_back(tmp_path):
    plan, study = freeze_plan(declared(tmp_path))
    begin_study(study, plan)
    RecordIndex(study).begin(0, plan.digest, True, False)
    (study / "begun.json").unlink()
    with pytest.raises(TrialError):
        TrialPlan.load(study)
    with pytest.raises(TrialError):
        freeze_plan(declared(tmp_path, "seed = 1"))


@pytest.mark.parametrize("link", ["tables", "records", ".unfinished-plan.json", "plan.html"])
def test_a_link_out_of_a_study_is_refused(tmp_path, link):
    plan, study = freeze_plan(declared(tmp_path))
    outside = tmp_path / "outside"
    outside.mkdir()
    (study / link).symlink_to(outside)
    for attempt in (
        lambda: TrialPlan.load(study),
        lambda: freeze_plan(declared(tmp_path)),
        lambda: begin_study(study, plan),
    ):
        with pytest.raises(TrialError):
            attempt()
    assert [*outside.iterdir()] == [] and not (study / "begun.json").exists()


def test_another_folder_is_not_walked_through(tmp_path):
    """A home is full of links that lead out of it: what it lacks is a plan."""
    (tmp_path / "photographs").symlink_to(tmp_path.parent)
    with pytest.raises(TrialError) as told:
        TrialPlan.load(tmp_path)
    assert told.value.where == str(tmp_path / "plan.json")


def test_a_plan_is_written_as_it_is_read(study):
    assert plan_bytes(TrialPlan.load(study)) == (study / "plan.json").read_bytes()


def test_no_plan_is_drawn_for_a_study_that_was_ended(study):
    end_study(study, "planned by mistake")
    with pytest.raises(TrialError) as raised:
        freeze_plan(study.parent / "sitting.toml", study)
    assert str(study) in str(raised.value)


def test_a_folder_is_no_declaration(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TrialError):
        freeze_plan(".")


def test_a_study_is_ended_once_and_with_a_reason(study):
    plan = TrialPlan.load(study)
    begin_study(study, plan)
    for none in ("", "  \n"):
        with pytest.raises(TrialError):
            end_study(study, none)
    assert not state_of(study).ended
    end_study(study, "the robot's knee broke")
    assert state_of(study).reason == "the robot's knee broke" and state_of(study).begun
    with pytest.raises(TrialError):
        end_study(study, "again")
    with pytest.raises(TrialError):
        begin_study(study, plan)
    assert TrialPlan.load(study) == plan


@pytest.mark.parametrize(
    "text",
    [
        'order = "any"',
        "trials = 0",
        "trials = 1000000",
        "chairs = []",
        'chairs = ["a", "a"]',
        "seed = -1",
        "unknown = 1",
        "floor = [[0, 1]]\nfloor = 2",
    ],
)
def test_a_declaration_that_cannot_be_planned_names_its_file(tmp_path, text):
    file = declared(tmp_path, text)
    if text.startswith("chairs"):
        file.write_text(file.read_text().replace('chairs = ["office chair", "stool"]\n', ""))
    with pytest.raises(TrialError) as refused:
        freeze_plan(file)
    assert refused.value.where == str(file) and refused.value.cure
    assert not (tmp_path / "sitting.trials").exists()


@pytest.mark.parametrize("rules", ["support_s = 0.0", "max_loss = 0.5", "tether_n = nan", 'rerun = "never"'])
def test_rules_have_bounds(tmp_path, rules):
    with pytest.raises(TrialError):
        freeze_plan(declared(tmp_path, rules=rules))


def test_seeds_without_their_pair_are_refused(tmp_path):
    file = declared(tmp_path)
    file.write_text(file.read_text().replace('"R2S-EGO"\nseed = 3', '"R2S-EGO"\nseed = 4'))
    with pytest.raises(TrialError):
        freeze_plan(file)


def test_a_policy_is_the_one_that_was_declared(tmp_path):
    file = declared(tmp_path)
    right = hashlib.sha256(b"GaussGym 1").hexdigest()
    text = file.read_text()
    named = 'file = "GaussGym_1.onnx"\n'
    for right_too in (f'{named}sha256 = "{right}"\n', f'sha256 = "{right}"\n'):
        file.write_text(text.replace(named, right_too))
        assert freeze_plan(file)[0].trials[0].policy_sha256 == right
    folder = 'file = "/"\n'
    for wrong in (f'{named}sha256 = "{"0" * 64}"\n', 'file = "gone.onnx"\n', folder, 'sha256 = "12"\n', ""):
        file.write_text(text.replace(named, wrong))
        with pytest.raises(TrialError):
            freeze_plan(file)


def test_two_policies_of_one_content_are_refused(tmp_path):
    file = declared(tmp_path)
    (tmp_path / "R2S-EGO_2.onnx").write_text("GaussGym 2")
    with pytest.raises(TrialError, match=r"GaussGym, seed 2 and R2S-EGO, seed 2"):
        freeze_plan(file)
