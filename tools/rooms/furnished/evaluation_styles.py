"""Styles for evaluation alone: nothing was tuned on rooms of theirs, and nothing may be.

Their colours, finishes, mixes of furniture and seeds were written down before any room of theirs was refined. A
change makes another benchmark: the digest in the tests then changes, too, and earlier figures no longer compare.
"""

from __future__ import annotations

from .style import Style

LOFT = Style(
    name="loft",
    width_m=(6.0, 7.2), depth_m=(4.8, 6.0), height_m=(2.9, 3.3), l_shaped=0.0,
    furniture=("sofa", "dining_table", "tv_board", "shelf", "armchair", "low_table", "floor_lamp", "plant", "boxes"),
    clutter=(1, 4),
    wall=("bricks", ("#8a4a36", "#b5705a")), accent=("plaster", ("#b7b3ab", "#d0ccc4")),
    floor=("plain", ("#8f8d88", "#8f8d88")), ceiling=("#c9c7c2", "#dddbd6"),
    wood=(("#2b2320", "#4d4039"), ("#a8854f", "#d2b07a")),
    cloth=(("#3a3a3a", "#676767"), ("#6a4a26", "#a57a44")), patterned_cloth=0.1,
    glaze=(("#1b1b1b", "#4a4a4a"), ("#d8d8d2", "#f4f4ee")), metal="#232323",
    pictures=(1, 3), windows=(2, 3), sun=5.0, lamp_w=40.0, eye_m=(1.5, 1.65),
)  # fmt: skip

NURSERY = Style(
    name="nursery",
    width_m=(3.6, 4.4), depth_m=(3.4, 4.2), height_m=(2.4, 2.55), l_shaped=0.0,
    furniture=("bed", "wardrobe", "cabinet", "boxes", "pouf", "plant", "boxes", "rug"),
    clutter=(3, 7),
    wall=("checks", ("#e3cfd6", "#f5eaee")), accent=("stripes", ("#a9d0c4", "#e9f5f0")),
    floor=("planks", ("#b9a486", "#dccbb0")), ceiling=("#efece8", "#fbf9f6"),
    wood=(("#d3cabd", "#f1ebe2"), ("#b7966b", "#dcbf95")),
    cloth=(("#b0567a", "#e08cab"), ("#4f8fb0", "#8cc2dc"), ("#c9a94a", "#efd684")), patterned_cloth=0.7,
    glaze=(("#c04f4f", "#ec8a80"), ("#4c9a72", "#8ccfaa")), metal="#d9d4c8",
    pictures=(3, 5), windows=(1, 1), sun=3.0, lamp_w=18.0, eye_m=(1.4, 1.5),
)  # fmt: skip

SUITE = Style(
    name="suite",
    width_m=(5.6, 7.0), depth_m=(5.0, 6.2), height_m=(2.5, 2.8), l_shaped=1.0,
    furniture=("bed", "nightstand", "desk", "wardrobe", "sofa", "low_table", "armchair", "tv_board", "floor_lamp"),
    clutter=(1, 3),
    wall=("plain", ("#c7c0b4", "#c7c0b4")), accent=("stripes", ("#5b4636", "#705a47")),
    floor=("cloth", ("#2f3d4a", "#566878")), ceiling=("#e9e6e0", "#f7f4ee"),
    wood=(("#5a2f1c", "#8a5433"), ("#1f1a17", "#3a322c")),
    cloth=(("#d2cabd", "#f0eadf"), ("#5a6b4e", "#8a9b78")), patterned_cloth=0.3,
    glaze=(("#20313c", "#4f6f7e"), ("#b79b5e", "#dcc590")), metal="#c0a062",
    pictures=(2, 4), windows=(1, 2), sun=0.0, lamp_w=34.0, eye_m=(1.5, 1.6),
)  # fmt: skip

STYLES = (LOFT, NURSERY, SUITE)
