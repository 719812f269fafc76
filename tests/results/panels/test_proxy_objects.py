"""What a bundle's record says of its objects is looked over before Blender lists them."""

from __future__ import annotations

import json

import pytest
from fake_bundle import write_bundle

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.proxy_objects import read_objects


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("world_from_own", [[1.0]]),
        ("world_from_own", "a"),
        ("world_from_own", [["nan", 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
        ("energy", {}),
        ("energy", "inf"),
        ("silhouette_iou", "much"),
    ],
)
def test_a_figure_that_is_none_is_an_error_of_the_record(field, value, tmp_path):
    path = write_bundle(tmp_path / "a.r2s")
    assert [known.name for known in read_objects(Bundle.open(path))] == ["crate", "lamp"]
    file = path / "geometry/priors/priors.json"
    records = json.loads(file.read_text())
    file.write_text(json.dumps([records[0] | {field: value}, records[1]]))
    with pytest.raises(GeometryError, match=r"priors\.json"):
        read_objects(Bundle.open(path))
