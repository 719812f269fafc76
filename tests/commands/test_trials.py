"""``r2sego trials plan``, ``page``, ``end`` and ``table``, from a declaration to the table."""

import json

from click.testing import CliRunner
from trials.declarations import declared

from r2sego_blender.commands.cli import main
from r2sego_blender.trials.outcome import Judgement, Outcome
from r2sego_blender.trials.plan.study import begin_study
from r2sego_blender.trials.plan.trial_plan import TrialPlan
from r2sego_blender.trials.records.index import RecordIndex


def r2sego(*arguments):
    return CliRunner().invoke(main, ["trials", *map(str, arguments)])


def test_from_a_declaration_to_the_table(tmp_path):
    said = r2sego("plan", declared(tmp_path, "trials = 1"), "--json")
    assert said.exit_code == 0, said.output
    study, plan = tmp_path / "sitting.trials", TrialPlan.load(tmp_path / "sitting.trials")
    assert json.loads(said.output)["sha256"] == plan.digest and len(plan.trials) == 6
    assert r2sego("page", study).exit_code == 0 and plan.digest in (study / "plan.html").read_text()
    begin_study(study, plan)
    for trial in plan.trials:
        outcome = Outcome.SUCCESS if trial.condition == "R2S-EGO" else Outcome.FAILURE
        index = RecordIndex(study)
        index.judge(index.begin(trial.index, plan.digest, True, False), Judgement(outcome, (), 3.0, 1.0))
    said = r2sego("table", study)
    assert said.exit_code == 0 and "| R2S-EGO | - | 100.0 ± 0.0 |" in said.output
    told = json.loads(r2sego("table", study, "--json").output)
    assert told["complete"] and told["pooled"] == {"GaussGym": [0, 3], "R2S-EGO": [3, 3]}
    assert (study / "tables" / "table3.tex").is_file()


def test_the_page_of_another_plan_does_not_stay(tmp_path):
    study = tmp_path / "sitting.trials"
    r2sego("plan", declared(tmp_path))
    r2sego("page", study)
    before = TrialPlan.load(study).digest
    r2sego("plan", declared(tmp_path, "trials = 1"))
    assert TrialPlan.load(study).digest != before and not (study / "plan.html").exists()


def test_a_plan_that_began_is_ended_not_changed(tmp_path):
    file = declared(tmp_path)
    r2sego("plan", file)
    study = tmp_path / "sitting.trials"
    begin_study(study, TrialPlan.load(study))
    again = r2sego("plan", file)
    assert again.exit_code == 1 and "r2sego trials end" in again.output
    assert r2sego("end", study).exit_code == 2
    assert r2sego("end", study, "--reason", "the floor was wet").exit_code == 0
    assert r2sego("plan", file).exit_code == 1


def test_a_changed_plan_is_named_and_printed_no_more(tmp_path):
    r2sego("plan", declared(tmp_path))
    file = tmp_path / "sitting.trials" / "plan.json"
    file.write_text(file.read_text().replace('"tether_n": 30.0', '"tether_n": 300.0'))
    for verb in ("page", "table"):
        said = r2sego(verb, file.parent)
        assert said.exit_code == 1 and str(file) in said.output and not (file.parent / "plan.html").exists()
