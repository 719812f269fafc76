"""Make a scene bundle from photographs."""

import os
from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ...r2sego_blender.captures.poses.dropped_files import ARCHIVES, VIDEOS
from ...r2sego_blender.core.errors import CaptureError, RobotError, SceneError
from ...r2sego_blender.results.panels.bundle import SUFFIX, Bundle
from ...r2sego_blender.results.panels.scene_choices import robot_choices, scope_choices
from .. import state
from ..base import EngineOperator, needs_idle_engine, needs_own_scene
from ..room_view import show_room


def _matching(choices):
    """The search of a property that suggests ``choices()`` and takes any path too."""
    return lambda operator, context, text: [one for one in choices() if text.lower() in one.lower()]


class R2SEGO_OT_new_scene(EngineOperator, bpy.types.Operator):
    """Make a scene bundle from a folder of photographs or a video"""

    bl_idname = "r2sego.new_scene"
    bl_label = "New Scene"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="Scene", description="The bundle to make, a folder that ends in .r2s", subtype="FILE_PATH"
    )
    filter_glob: StringProperty(default=f"*{SUFFIX}", options={"HIDDEN"})
    captures: StringProperty(
        name="Photographs",
        description="Folder of photographs of the room, three at least, or a zip of it; what a phone's scanner "
        "wrote; or a video of a walk through it",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    poses: StringProperty(
        name="Poses",
        subtype="FILE_PATH",
        description="transforms.json, cameras.json or a file of a COLMAP model; empty = those of the "
        "recording or export, else they are solved",
        options={"SKIP_SAVE"},
    )
    robot: StringProperty(
        name="Robot",
        default="embedded:humanoid",
        search=_matching(robot_choices),
        search_options={"SUGGESTION"},
        description="The robot: embedded:humanoid, embedded:wheeled, or an MJCF or URDF file",
    )
    scope: StringProperty(
        name="Behaviour Scope",
        default="walk_and_look",
        search=_matching(scope_choices),
        search_options={"SUGGESTION"},
        description="What the robot may do: the name of a shipped scope, or a TOML file",
    )
    scale: EnumProperty(
        name="Scale",
        description="What says how large the room is",
        items=[
            ("POSES", "From the Poses", "Poses in metres as they are; else a usual camera height is assumed"),
            ("CAMERA_HEIGHT", "Camera Height", "Height of the first photograph's camera above the floor"),
            ("MARKER", "Printed Marker", "Side of an ArUco 4x4_50 marker in the photographs"),
            ("KNOWN_LENGTH", "Known Length", "Two pixels of one photograph and their distance"),
            ("DEPTH", "Depth Maps", "What a depth sensor measured, a map for each photograph"),
        ],
    )
    camera_height: FloatProperty(
        name="Camera Height",
        description="Height of the first camera above the floor",
        default=1.5,
        min=0.05,
        max=10.0,
        subtype="DISTANCE",
        unit="LENGTH",
    )
    marker_side: FloatProperty(
        name="Marker Side",
        description="Side of the printed black square",
        default=0.15,
        min=0.01,
        max=2.0,
        subtype="DISTANCE",
        unit="LENGTH",
    )
    known_length: StringProperty(name="Known Length", description="photo:x,y:x,y:metres")
    depth: StringProperty(
        name="Depth Maps",
        subtype="DIR_PATH",
        description="Folder of depth maps called as the photographs are: 16-bit PNG in millimetres, or EXR "
        "or NPY in metres",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return needs_own_scene(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        if not self.filepath:
            self.filepath = f"room{SUFFIX}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("captures", "poses", "robot", "scope", "scale"):
            layout.prop(self, name)
        if self.scale != "POSES":
            layout.prop(self, self.scale.lower() if self.scale != "MARKER" else "marker_side")

    def arguments(self, context):
        if not self.captures:
            raise CaptureError("no folder of photographs and no video is chosen", cure="Choose one in the side bar.")
        command = ["new", str(self._bundle_path()), "--json-progress", "--captures", str(self._photographs())]
        for name in ("robot", "scope"):
            if not (chosen := bpy.path.abspath(getattr(self, name))):
                raise RobotError(f"no {name} is chosen", cure="Choose one in the side bar, or a file.")
            command += [f"--{name}", chosen]
        if self.poses:
            command += ["--poses", bpy.path.abspath(self.poses)]
        if self.scale == "CAMERA_HEIGHT":
            command += ["--camera-height", f"{self.camera_height:.6g}"]
        elif self.scale == "MARKER":
            command += ["--marker-side", f"{self.marker_side:.6g}"]
        elif self.scale == "KNOWN_LENGTH":
            command += ["--known-length", self.known_length]
        elif self.scale == "DEPTH":
            if not self.depth:
                raise CaptureError("no folder of depth maps is chosen", cure="Choose one in the side bar.")
            command += ["--depth", bpy.path.abspath(self.depth)]
        return command

    def finish(self, context, result):
        bundle = Bundle.open(self._bundle_path())
        state.show_bundle(context.scene, bundle)
        return f"Made {bundle.path.name}: {result.get('scale', '')}{show_room(context.scene, bundle)}"

    def _photographs(self):
        """The folder, the zip or the video that is chosen, or the folder of a photograph that is."""
        path = Path(bpy.path.abspath(self.captures))
        return path.parent if path.is_file() and path.suffix.lower() not in (*VIDEOS, *ARCHIVES) else path

    def _bundle_path(self):
        if not self.filepath:
            raise SceneError("no place for the bundle is chosen", cure=f"Name a folder ending in {SUFFIX}.")
        path = Path(bpy.path.abspath(self.filepath)).absolute()
        if path.suffix != SUFFIX and self.filepath.endswith(("/", os.sep)):  # as from a file browser without a name
            raise SceneError("this is a folder", where=path, cure=f"Name the bundle in it, such as room{SUFFIX}.")
        return path if path.suffix == SUFFIX else path.with_name(path.name + SUFFIX)
