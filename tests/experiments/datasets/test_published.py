"""What others report stands below our tables, told apart from them."""

from __future__ import annotations

from fake_experiment import PLAN

from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.datasets.published import published_latex, published_markdown, published_of
from r2sego_blender.experiments.gathering import LATEX, MARKDOWN, gather
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.page import PAGE
from r2sego_blender.experiments.plan import Plan


def test_figures_of_others_are_told_with_their_source_and_that_the_set_is_another():
    for table in (published_markdown("replica"), published_latex("replica")):
        assert "Published, means over Replica at 6 views, not the same set" in table
        assert "arXiv:2512.25073" in table and "RTX 4090" in table
        for row in (("3DGS with DUSt3R points", "24.74", "0.862"), ("GaMO", "26.40", "0.882")):
            assert any(all(cell in line for cell in row) for line in table.splitlines())
    for name in ("", "7scenes"):
        assert published_markdown(name) == published_latex(name) == ""


def test_a_plan_may_ask_for_them(plan_file, tmp_path):
    plan_file.write_text(f'published = "replica"\n{PLAN}')
    plan = Plan.load(plan_file)
    cells = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    (tmp_path / "out").mkdir()
    gather(plan, cells, {}, tmp_path / "out")
    assert (tmp_path / "out" / MARKDOWN).read_text().endswith(published_markdown("replica"))
    assert (tmp_path / "out" / LATEX).read_text().endswith(published_latex("replica"))
    page = (tmp_path / "out" / PAGE).read_text()
    for one in published_of("replica").scores:
        assert f'<td>{one.method}</td><td class="number">{one.psnr:.2f}</td>' in page
