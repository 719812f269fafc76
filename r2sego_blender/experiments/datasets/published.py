"""What others report of a data set, below an experiment's tables and told apart from them."""

from __future__ import annotations

from ...core.formatting import counted, latex_text, markdown_text
from .dataset import Published
from .registry import DATASETS


def published_of(name: str) -> Published | None:
    """What others report of the data set ``name``, '' for none."""
    return DATASETS[name].published if name else None


def published_markdown(name: str) -> str:
    """The table of what others report of the data set ``name``; nothing without any."""
    found = published_of(name)
    if found is None:
        return ""
    rows = [f"| {markdown_text(one.method)} | {one.psnr:.2f} | {one.ssim:.3f} |" for one in found.scores]
    head = ["| method | PSNR, dB | SSIM |", "| --- | ---: | ---: |"]
    return (
        "\n".join(["", f"## {title_of(found)}", "", *head, *rows, "", f"Source: {markdown_text(found.source)}."]) + "\n"
    )


def published_latex(name: str) -> str:
    """The same as a tabular."""
    found = published_of(name)
    if found is None:
        return ""
    rows = [f"  {latex_text(one.method)} & {one.psnr:.2f} & {one.ssim:.3f} " + r"\\" for one in found.scores]
    head = [r"\begin{tabular}{@{}lrr@{}}", r"  \toprule", r"  method & PSNR, dB & SSIM \\", r"  \midrule"]
    about = [f"% {latex_text(title_of(found))}", f"% Source: {latex_text(found.source)}."]
    return "\n".join([*about, *head, *rows, r"  \bottomrule", r"\end{tabular}"]) + "\n"


def title_of(found: Published) -> str:
    """What the figures are, and that they are no measurement beside ours."""
    return f"Published, {found.of} at {counted(found.captures, 'view')}, not the same set"
