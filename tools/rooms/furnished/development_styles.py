"""The styles that may be tuned on."""

from __future__ import annotations

from .style import Style

WARM = Style(
    name="warm",
    width_m=(4.4, 5.6), depth_m=(3.8, 4.8), height_m=(2.45, 2.7), l_shaped=0.0,
    furniture=("sofa", "shelf", "cabinet", "low_table", "armchair", "floor_lamp", "plant", "pouf", "rug", "boxes"),
    clutter=(2, 5),
    wall=("plaster", ("#cfc3ae", "#ece3d2")), accent=("plaster", ("#75866f", "#98a78e")),
    floor=("planks", ("#93673b", "#bd9160")), ceiling=("#dcd8cf", "#f1eee7"),
    wood=(("#3f2415", "#7b4f2e"), ("#9a7243", "#cfa871")),
    cloth=(("#7d3520", "#b8603c"), ("#1d2c40", "#48617e"), ("#96661a", "#d9a43c")), patterned_cloth=0.2,
    glaze=(("#8f4a2e", "#c07650"), ("#6d6357", "#d5cab8"), ("#1d3b54", "#3f7391")), metal="#b38a45",
    pictures=(2, 4), windows=(1, 2), sun=6.0, lamp_w=22.0, eye_m=(1.5, 1.6),
)  # fmt: skip

DINING = Style(
    name="dining",
    width_m=(4.8, 6.4), depth_m=(4.0, 5.2), height_m=(2.5, 2.9), l_shaped=0.0,
    furniture=("dining_table", "cabinet", "shelf", "wardrobe", "armchair", "plant", "floor_lamp", "rug", "boxes"),
    clutter=(3, 6),
    wall=("stripes", ("#b9c4cc", "#dfe5e6")), accent=("plaster", ("#8b98a5", "#a9b5c0")),
    floor=("tiles", ("#a9a196", "#d8d0c2")), ceiling=("#e2e2de", "#f5f5f2"),
    wood=(("#6d4a2c", "#a37747"), ("#d7c8ad", "#efe5d0")),
    cloth=(("#31473a", "#5f7d63"), ("#8c8375", "#c9c0ae")), patterned_cloth=0.5,
    glaze=(("#26384f", "#54708f"), ("#c9bfa8", "#f0e8d6")), metal="#9a9a98",
    pictures=(2, 3), windows=(1, 2), sun=4.0, lamp_w=26.0, eye_m=(1.45, 1.55),
)  # fmt: skip

STUDY = Style(
    name="study",
    width_m=(5.2, 6.6), depth_m=(4.6, 5.8), height_m=(2.4, 2.6), l_shaped=1.0,
    furniture=("desk", "shelf", "bed", "shelf", "nightstand", "wardrobe", "armchair", "plant", "boxes", "boxes", "rug"),
    clutter=(3, 7),
    wall=("plain", ("#d9d4cb", "#d9d4cb")), accent=("plain", ("#5d7385", "#5d7385")),
    floor=("cloth", ("#6f6a63", "#9b948a")), ceiling=("#e8e6e1", "#f6f4f0"),
    wood=(("#8d8378", "#b9aea0"), ("#4a3626", "#6f5239")),
    cloth=(("#4b2f45", "#80566f"), ("#3b5566", "#6d8fa3")), patterned_cloth=0.4,
    glaze=(("#5b2e2a", "#95534b"), ("#33463a", "#6d8a72")), metal="#2b2b2b",
    pictures=(1, 3), windows=(1, 1), sun=0.0, lamp_w=30.0, eye_m=(1.4, 1.55),
)  # fmt: skip

STYLES = (WARM, DINING, STUDY)
