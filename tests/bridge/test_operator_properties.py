"""An operator's properties as JSON, and back into a call of it."""

import json

import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.shared.operator_properties import as_arguments, given_properties  # noqa: E402

SEEN = []


class TEST_OT_given(bpy.types.Operator):  # noqa: N801
    """Notes what it was given"""

    bl_idname = "test.given"
    bl_label = "Given"

    name: bpy.props.StringProperty(default="unset")
    path: bpy.props.StringProperty()
    count: bpy.props.IntProperty()
    exact: bpy.props.BoolProperty()
    colour: bpy.props.FloatVectorProperty(size=3)
    kind: bpy.props.EnumProperty(items=[(name, name, "") for name in "AB"])
    kinds: bpy.props.EnumProperty(items=[(name, name, "") for name in "ABC"], options={"ENUM_FLAG"})

    def execute(self, context):
        SEEN.append(given_properties(self))
        return {"FINISHED"}


@pytest.fixture
def operator():
    SEEN.clear()
    bpy.utils.register_class(TEST_OT_given)
    yield bpy.ops.test.given
    bpy.utils.unregister_class(TEST_OT_given)


def test_what_was_given_comes_back(operator):
    given = {"count": 3, "exact": False, "colour": (0.25, 0.5, 1.0), "kind": "B", "kinds": {"A", "C"}}
    operator(**given)
    (noted,) = SEEN
    kept = json.loads(json.dumps(noted))
    assert kept == {"count": 3, "exact": False, "colour": [0.25, 0.5, 1.0], "kind": "B", "kinds": ["A", "C"]}
    operator(**as_arguments(operator, {**kept, "of_an_older_version": 1}))
    assert SEEN[1] == noted


def test_a_path_beside_the_file_is_kept_whole(operator, tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "here.blend"))
    operator(path="//captures")
    (noted,) = SEEN
    assert noted == {"path": str(tmp_path / "captures")}
    bpy.ops.wm.read_homefile(use_empty=True)
