"""The paper's Table 3 and the other files, from a plan and the index of its records."""

import csv
import dataclasses
import io
import itertools
import xml.etree.ElementTree as ET

import pytest
from trials.declarations import CONDITIONS

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.judging.manual import manual_judgement
from r2sego_blender.trials.outcome import Failure, Judgement, Outcome, Unusable
from r2sego_blender.trials.plan.study import begin_study, end_study, freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.tables.counts import Results
from r2sego_blender.trials.tables.success_table import SuccessTable, csv_text
from r2sego_blender.trials.tables.trials_file import trials_csv
from r2sego_blender.trials.tables.writing import write_tables

REAL = {"GaussGym": (0, 0, 1, 2, 1), "R2S-EGO": (7, 7, 7, 6, 6)}
SIMULATED = {"GaussGym": (20, 22, 21, 23, 23), "R2S-EGO": (25, 24, 24, 25, 24)}

SUCCESS = Judgement(Outcome.SUCCESS, (), 3.2, 1.5)
FELL = Judgement(Outcome.FAILURE, ((Failure.TETHER, "212.0 N at 4.10 s"),), 0.0, 212.0)
MISSED = Judgement(Outcome.FAILURE, ((Failure.NO_SUPPORT, ""),), 0.4, -1.25)
GAP = Judgement(Outcome.UNUSABLE, ((Unusable.GAP, "80.0 ms"),), 3.2, 1.5)
SATURATED = Judgement(Outcome.UNUSABLE, ((Unusable.SATURATION, "tether"), (Failure.TETHER, "900 N")), 0.0, 900.0)


def papers_plan(folder, text=""):
    policies = "".join(
        f'[[policies]]\ncondition = "{condition}"\nseed = {seed}\nsha256 = "{number:064x}"\n'
        f"simulated_successes = {SIMULATED[condition][seed - 1]}\n"
        for number, (condition, seed) in enumerate(itertools.product(CONDITIONS, range(1, 6)))
    )
    (folder / "sitting.toml").write_text(f'name = "sitting"\n{text}\n{policies}')
    return freeze_plan(folder / "sitting.toml")


def ran(study, plan, judged):
    """Records of all trials in their order; ``judged`` gives each one's judgements."""
    begin_study(study, plan)
    index = RecordIndex(study)
    for trial in plan.trials:
        for judgement in judged(trial):
            index.judge(index.begin(trial.index, plan.digest, True, False), judgement)


def as_in_the_paper(trial):
    success = trial.repetition < REAL[trial.condition][trial.policy_seed - 1]
    return [SUCCESS] if success else [FELL if trial.repetition % 2 else MISSED]


@pytest.fixture(scope="module")
def papers(tmp_path_factory):
    plan, study = papers_plan(tmp_path_factory.mktemp("papers"))
    ran(study, plan, as_in_the_paper)
    return Results.of(study)


def test_the_papers_table(papers):
    table = SuccessTable.of(papers.counts())
    assert table.complete and [row.pooled for row in table.rows] == [(4, 40), (33, 40)]
    rows = [*csv.reader(io.StringIO(table.csv()))]
    assert rows[1:] == [
        ["GaussGym", "5", "87.2", "5.2", "10.0", "10.5", "4", "40"],
        ["R2S-EGO", "5", "97.6", "2.2", "82.5", "6.8", "33", "40"],
    ]
    assert r"  GaussGym & 87.2 $\pm$ 5.2 & 10.0 $\pm$ 10.5 \\" in table.latex().splitlines()
    bold = r"  \textbf{R2S-EGO} & \textbf{97.6 $\pm$ 2.2} & \textbf{82.5 $\pm$ 6.8} \\"
    assert bold in table.latex().splitlines()
    assert "| GaussGym | 87.2 ± 5.2 | 10.0 ± 10.5 |" in table.markdown().splitlines()
    ((_, difference),) = table.differences
    assert (difference.higher, difference.lower, difference.spread.texts[0]) == (5, 0, "72.5")


def test_all_files_are_written_and_say_the_same(papers, tmp_path):
    _, files = write_tables(papers, tmp_path / "tables")
    assert all(file.stat().st_size > 100 for file in files)
    trials = [*csv.DictReader((tmp_path / "tables" / "trials.csv").open(encoding="utf-8"))]
    assert len(trials) == 80 and [int(row["trial"]) for row in trials] == [*range(1, 81)]
    for condition, counts in REAL.items():
        of = [row for row in trials if row["condition"] == condition]
        successes = [
            sum(row["policy_seed"] == str(seed) and row["outcome"] == "success" for row in of) for seed in range(1, 6)
        ]
        assert tuple(successes) == counts
    assert {float(row["highest_tether_n"]) for row in trials} == {1.5, 212.0, -1.25}
    assert {row["plan_sha256"] for row in trials} == {papers.plan.digest}
    policies = [*csv.DictReader((tmp_path / "tables" / "policies.csv").open(encoding="utf-8"))]
    assert [int(row["real_successes"]) for row in policies] == [*REAL["GaussGym"], *REAL["R2S-EGO"]]
    kinds = {row["kind"]: row for row in csv.DictReader((tmp_path / "tables" / "failures.csv").open(encoding="utf-8"))}
    assert sum(int(row["GaussGym"]) for row in kinds.values()) == 36
    assert sum(int(row["R2S-EGO"]) for row in kinds.values()) == 7
    figure = ET.parse(tmp_path / "tables" / "figure.svg")
    circles = [*figure.iter("{http://www.w3.org/2000/svg}circle")]
    heights = {float(circle.get("cy")) for circle in circles}
    assert len(circles) == 10 and len(heights) == 5  # 0, 1, 2, 6 and 7 of 8


def test_unusable_recordings_count_neither_way_and_are_told(tmp_path):
    plan, study = papers_plan(tmp_path)
    ran(study, plan, lambda trial: [GAP, SATURATED, *as_in_the_paper(trial), SUCCESS])
    results = Results.of(study)
    assert [row.pooled for row in SuccessTable.of(results.counts()).rows] == [(4, 40), (33, 40)]
    assert results.failed_unusable() == {"GaussGym": 40, "R2S-EGO": 40}
    assert all(name in " ".join(results.about()) and "80" in " ".join(results.about()) for name in CONDITIONS)
    assert results.kinds()["GaussGym"] == {
        Unusable.GAP: 40,
        Unusable.SATURATION: 40,
        Failure.TETHER: 19,
        Failure.NO_SUPPORT: 17,
    }


def test_what_persons_judged_and_devices_simulated_is_told(tmp_path):
    plan, study = papers_plan(tmp_path)
    ran(study, plan, lambda trial: as_in_the_paper(trial) if trial.index else [])
    assert Results.of(study).about() == ()
    index = RecordIndex(study)
    number = index.begin(0, plan.digest, True, True)
    index.judge(number, FELL)
    assert len(Results.of(study).about()) == 1 and Results.of(study).simulated
    index.judge(number, manual_judgement(FELL, "success", "Ada", "the rope was pulled by hand"))
    results = Results.of(study)
    assert len(results.about()) == 2 and results.counts()[0].successes == 1
    assert sum("Ada" in line for line in trials_csv(results).splitlines()) == 1


def test_a_study_that_is_not_done_says_so(tmp_path):
    plan, study = papers_plan(tmp_path)
    ran(study, plan, lambda trial: as_in_the_paper(trial) if trial.policy_seed < 3 else [])
    table = SuccessTable.of(Results.of(study).counts())
    assert not table.complete and [row.real.count for row in table.rows] == [2, 2]
    assert [row.real.texts for row in table.rows] == [("0.0", "0.0"), ("87.5", "0.0")]
    assert len(table.notes()) == len(dataclasses.replace(table, complete=True).notes()) + 1


def test_before_the_first_trial_the_table_is_empty(tmp_path):
    _, study = papers_plan(tmp_path)
    table, _ = write_tables(Results.of(study), study / "tables")
    assert [row.real for row in table.rows] == [None, None] and not table.complete


def test_counts_stay_hidden_while_blinded(tmp_path):
    plan, study = papers_plan(tmp_path, 'blinded = true\norder = "randomised"')
    ran(study, plan, lambda trial: [SUCCESS] if trial.index else [GAP])
    with pytest.raises(TrialError):
        Results.of(study)
    end_study(study, "the robot's knee broke")
    assert not Results.of(study).complete


def test_records_of_another_plan_are_not_counted(tmp_path):
    plan, study = papers_plan(tmp_path)
    ran(study, plan, lambda trial: [])
    RecordIndex(study).begin(0, "0" * 64, True, False)
    with pytest.raises(TrialError):
        Results.of(study)


def test_no_cell_is_a_formula():
    assert csv_text([["=1+1", "a,b", -1.5, "-x"]]) == "'=1+1,\"a,b\",-1.5,'-x\n"
