"""Set where the head camera sits and how far down it looks."""

import json
import math
from collections.abc import Mapping
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, StringProperty

from ...r2sego_blender.bridge.shared.declared_properties import limits
from ...r2sego_blender.config.fields import fields_of
from ...r2sego_blender.core.errors import R2SEgoError, RobotError
from ...r2sego_blender.results.panels.robot_facts import RobotFacts
from ...r2sego_blender.robot.scope.scope import BehaviourScope, Look
from .. import state
from ..base import told
from .declaring import DeclaringOperator

_PITCH_LIMITS = limits(fields_of(Look)["camera_pitch_deg"], math.radians)


class R2SEGO_OT_set_mount(DeclaringOperator, bpy.types.Operator):
    """Declare the head camera's mount on the robot, and the pitch of its bracket"""

    bl_idname = "r2sego.set_mount"
    bl_label = "Set Camera Mount"
    bl_options = {"REGISTER"}

    mount: EnumProperty(
        name="Mount",
        description="Where the camera sits",
        items=[
            ("OWN", "Robot's Own", "The robot file's only camera, or its head_camera"),
            ("CAMERA", "Named Camera", "Another camera of the robot's file"),
            ("PLACE", "Place", "A place on one of the robot's bodies"),
        ],
    )
    camera: StringProperty(name="Camera", description="The name of a camera in the robot's file", default="head_camera")
    body: StringProperty(name="Body", description="The body that carries the camera", default="torso_link")
    place: FloatVectorProperty(
        name="Place",
        description="The camera in the body's frame: x forward, y left, z up",
        size=3,
        default=(0.0576235, 0.01753, 0.42987),
        subtype="TRANSLATION",
        unit="LENGTH",
    )
    turn: FloatVectorProperty(
        name="Turn",
        description="Roll, pitch (positive looks down) and yaw of the camera",
        size=3,
        default=(0.0, 0.8307767, 0.0),
        subtype="EULER",
        unit="ROTATION",
    )
    field_of_view: FloatProperty(
        name="Field of View",
        description="The angle that the image shows",
        default=math.radians(69.0),
        min=math.radians(1.0),
        max=math.radians(170.0),
        subtype="ANGLE",
        unit="ROTATION",
    )
    across: EnumProperty(
        name="Across",
        description="Which side of the image the field of view is measured along",
        items=[("WIDTH", "Width", "From left to right"), ("HEIGHT", "Height", "From top to bottom")],
    )
    pitch: EnumProperty(
        name="Pitch",
        description="How far down the camera looks",
        items=[
            ("MOUNTED", "As Mounted", "The mount as it is, in every rollout"),
            ("DRAWN", "Drawn", "The bracket is set before each rollout, between two angles"),
        ],
    )
    pitch_low: FloatProperty(
        name="From",
        description="The least pitch below the horizon",
        default=math.radians(22.0),
        **_PITCH_LIMITS,
        subtype="ANGLE",
        unit="ROTATION",
    )
    pitch_high: FloatProperty(
        name="To",
        description="The greatest pitch below the horizon",
        default=math.radians(46.0),
        **_PITCH_LIMITS,
        subtype="ANGLE",
        unit="ROTATION",
    )

    def invoke(self, context, event):
        try:
            facts = RobotFacts.read(state.opened_bundle(context))
            declared = suggested_properties(facts.told) | declared_properties(facts.scope)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        for name, value in declared.items():
            setattr(self, name, value)
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "mount")
        shown = {"OWN": (), "CAMERA": ("camera",), "PLACE": ("body", "place", "turn", "field_of_view", "across")}
        for name in shown[self.mount]:
            layout.prop(self, name)
        layout.prop(self, "pitch")
        if self.pitch == "DRAWN":
            layout.prop(self, "pitch_low")
            layout.prop(self, "pitch_high")

    def changes(self, context):
        pitch = ""
        if self.pitch == "DRAWN":
            if self.pitch_low > self.pitch_high:
                low, high = (math.degrees(angle) for angle in (self.pitch_low, self.pitch_high))
                raise RobotError(f"the pitch goes from {low:g}° to {high:g}°", cure="Set the smaller angle as From.")
            pitch = _numbers(map(math.degrees, (self.pitch_low, self.pitch_high)))
        return ["--set", f"robot.mount={self._mount()}", "--set", f"look.camera_pitch_deg={pitch}"]

    def _mount(self):
        """The mount as TOML; '' for the robot's own."""
        if self.mount == "OWN":
            return ""
        if self.mount == "CAMERA":
            return json.dumps(self.camera)
        axis = "hfov_deg" if self.across == "WIDTH" else "fovy_deg"
        fov = f"{{{axis} = {math.degrees(self.field_of_view):.6g}}}"
        return f"[{json.dumps(self.body)}, {_numbers(self.place)}, {_numbers(self.turn)}, {fov}]"


def suggested_properties(told: Mapping[str, Any]) -> dict[str, Any]:
    """A body and a camera that the robot has, by what the engine said of it; none where it has not."""
    body, cameras = told.get("camera", {}).get("parent", ""), told.get("cameras", ())
    return {name: value for name, value in (("body", body), ("camera", next(iter(cameras), ""))) if value}


def declared_properties(scope: BehaviourScope) -> dict[str, Any]:
    """The operator's properties that say what a scope declares. Raises RobotError for a damaged mount."""
    try:
        shown = _properties_of(scope.robot.mount)
    except (KeyError, TypeError, ValueError) as error:
        raise RobotError(
            "the declared mount cannot be read", where=scope.name, cure="Choose the scope again."
        ) from error
    pitch = scope.look.camera_pitch_deg
    if pitch is None:
        return shown | {"pitch": "MOUNTED"}
    low, high = map(math.radians, pitch)
    return shown | {"pitch": "DRAWN", "pitch_low": low, "pitch_high": high}


def _properties_of(mount: Any) -> dict[str, Any]:
    """A mount in one of the forms of ``robot.mount.parse_mount``, which Blender's Python cannot run."""
    if mount is None:
        return {"mount": "OWN"}
    if isinstance(mount, str):
        return {"mount": "CAMERA", "camera": mount}
    if isinstance(mount, Mapping):
        body, place, turn = mount["parent"], mount["xyz"], mount["rpy"]
        fov = {name: mount[name] for name in ("hfov_deg", "fovy_deg") if name in mount}
    else:
        body, place, turn, fov = mount
    ((axis, angle_deg),) = fov.items() if isinstance(fov, Mapping) else [("fovy_deg", fov)]
    x, y, z = map(float, place)
    roll, pitch, yaw = map(float, turn)
    return {
        "mount": "PLACE",
        "body": str(body),
        "place": (x, y, z),
        "turn": (roll, pitch, yaw),
        "field_of_view": math.radians(angle_deg),
        "across": "WIDTH" if axis == "hfov_deg" else "HEIGHT",
    }


def _numbers(values):
    return f"[{', '.join(f'{value:.7g}' for value in values)}]"
