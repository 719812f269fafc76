"""The printed plan: every trial with its poses where they are, and nothing that a blinded operator may not read."""

import re
from html.parser import HTMLParser

import pytest
from trials.declarations import declared

from r2sego_blender.trials.plan.page import plan_page
from r2sego_blender.trials.plan.study import freeze_plan

PLACE = re.compile(r'href="#(chair|robot)" transform="translate\((\S+) (\S+)\) rotate\((\S+)\)"')
VIEW = re.compile(r'viewBox="(\S+) (\S+) (\S+) (\S+)"')


@pytest.fixture
def plan(tmp_path):
    return freeze_plan(declared(tmp_path, "floor = [[-1.0, -2.0], [4.0, -2.0], [4.0, 2.0], [-1.0, 2.0]]"))[0]


def test_each_trial_is_drawn_with_its_poses(plan):
    page = plan_page(plan)
    drawn = [(name, *map(float, numbers)) for name, *numbers in PLACE.findall(page)]
    assert len(drawn) == 2 * len(plan.trials)
    for trial, chair, robot in zip(plan.trials, drawn[::2], drawn[1::2], strict=True):
        for one, pose in ((chair, trial.chair_pose), (robot, trial.robot_pose)):
            assert one[1:] == (pose.x_m, -pose.y_m, -pose.heading_deg)
        assert f"{trial.number}. {trial.label}" in page
    assert plan.digest in page


def test_all_of_the_floor_and_the_poses_is_in_view(plan):
    (view,) = set(VIEW.findall(plan_page(plan)))
    left, top, width, height = map(float, view)
    assert (left, top, width, height) == (-1.5, -2.5, 6.0, 5.0)


def test_a_blinded_page_names_no_condition(tmp_path):
    plan, _ = freeze_plan(declared(tmp_path, 'blinded = true\norder = "randomised"'))
    page = plan_page(plan)
    assert all(condition not in page for condition in plan.conditions)
    assert all(policy.file not in page for policy in plan.policies)
    assert all(policy.label in page for policy in plan.policies)


def test_names_of_others_are_no_markup(tmp_path):
    file = declared(tmp_path)
    file.write_text(file.read_text().replace('"sitting"', '"<script>alert(1)</script>"'))
    found = []

    class Tags(HTMLParser):
        def handle_starttag(self, tag, attributes):
            found.append(tag)

    Tags().feed(plan_page(freeze_plan(file)[0]))
    assert "script" not in found and found.count("section") == 48
