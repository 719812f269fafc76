"""Trust a policy that is a program."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.core.errors import RobotError
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine

_WORDS = (
    "A TorchScript policy is a program.",
    "Whoever made it decides what it does,",
    "with your rights, on this machine.",
    "Trust it only if you trust them.",
    "ONNX policies need no trust.",
)


class R2SEGO_OT_trust_policy(EngineOperator, bpy.types.Operator):
    """Name a TorchScript policy, which is a program, as one that may run on this machine with your rights"""

    bl_idname = "r2sego.trust_policy"
    bl_label = "Trust Policy"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="Policy", description="A TorchScript file: a program that will run with your rights", subtype="FILE_PATH"
    )
    filter_glob: StringProperty(
        name="Kinds", description="The files shown", default="*.pt;*.pth;*.jit;*.torchscript", options={"HIDDEN"}
    )

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        column = self.layout.column(align=True)
        column.alert = True
        for index, words in enumerate(_WORDS):
            column.label(text=words, icon="NONE" if index else "ERROR")

    def arguments(self, context):
        if not self.filepath:
            raise RobotError("no policy is chosen", cure="Choose a TorchScript file.")
        return ["trust", bpy.path.abspath(self.filepath), "--json-progress"]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"Trusted on this machine: {Path(self.filepath).name}"
