"""Robots, their policies and their recorded motions."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..harness import Harness
from ..seeds import OBSERVATIONS, of_tests

_FRAMES = 6
_LAYOUT = """name = "knees"
rate_hz = 50.0
step_s = 0.005
joints = [["left_knee", 0.1, 100.0, 2.0], ["right_knee", 0.1, 100.0, 2.0]]
held = [["waist_yaw", 0.0, 50.0, 1.0]]
observation = [
  { term = "projected_gravity", scale = 1.0, clip = 10.0 },
  { term = "joint_pos_rel", scale = [1.0, 2.0] },
  { term = "velocity_command" },
]

[action]
scale = 0.25
clip = 5.0

[commands]
vx_m_s = [-1.0, 1.0]
vy_m_s = [-0.5, 0.5]
yaw_rate_rad_s = [-1.0, 1.0]
"""
_URDF = """<?xml version="1.0"?>
<robot name="cart">
  <link name="base"><inertial><mass value="8"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.4 0.3 0.2"/></geometry></collision></link>
  {wheels}
  <link name="caster"><inertial><mass value="0.1"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="caster" type="fixed"><parent link="base"/><child link="caster"/><origin xyz="-0.15 0 0.05"/></joint>
</robot>
"""
_WHEEL = """<link name="{side}"><inertial><mass value="0.5"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link>
  <joint name="{side}" type="continuous"><parent link="base"/><child link="{side}"/><origin xyz="0.1 {y} 0.1"/>
    <axis xyz="0 1 0"/><limit effort="5" velocity="20"/></joint>"""


def _mjcf(folder: Path) -> None:
    from r2sego_blender.robot.model.wheeled_base import wheeled_base_mjcf

    (folder / "robot.xml").write_text(wheeled_base_mjcf())


def _legged(folder: Path) -> None:
    (folder / "robot.xml").write_text(of_tests("legged_robots").quadruped_mjcf())


def _urdf(folder: Path) -> None:
    wheels = "\n  ".join(_WHEEL.format(side=side, y=y) for side, y in (("left", 0.2), ("right", -0.2)))
    (folder / "robot.urdf").write_text(_URDF.format(wheels=wheels))


def _with_mesh(suffix: str) -> Callable[[Path], None]:
    def build(folder: Path) -> None:
        import trimesh

        vertices, faces = of_tests("fake_proxy").crate()
        trimesh.Trimesh(0.1 * vertices, faces, process=False).export(folder / f"m{suffix}")
        text = of_tests("legged_robots").quadruped_mjcf()
        text = text.replace("<worldbody>", f'<asset><mesh name="m" file="m{suffix}"/></asset><worldbody>')
        text = text.replace('<geom type="box" size="0.2 0.05 0.05"', '<geom type="mesh" mesh="m"')
        (folder / "robot.xml").write_text(text)

    return build


def _robot(name: str, mount: Any = None) -> Callable[[Path], Any]:
    def read(folder: Path) -> Any:
        from r2sego_blender.robot.model.model import RobotModel

        return RobotModel.load(folder / name, mount)

    return read


def _layout(folder: Path) -> None:
    (folder / "layout.toml").write_text(_LAYOUT)


def _read_layout(folder: Path) -> Any:
    from r2sego_blender.robot.controllers.policy_layout import PolicyLayout

    layout = PolicyLayout.load(str(folder / "layout.toml"))
    # What is not declared is NaN or infinite: a term's period and clip, a policy's height.
    terms = tuple(replace(term, period_s=1.0, clip=1.0) for term in layout.terms)
    commands = replace(layout.commands, walking_height_m=1.0)
    return replace(layout, terms=terms, commands=commands, action_clip=min(layout.action_clip, 1e9))


def _policy(name: str) -> Callable[[Path], None]:
    def build(folder: Path) -> None:
        policies = of_tests("tiny_policies")
        weight, bias = np.full((OBSERVATIONS, 2), 0.25), np.array([0.5, -0.5])
        write = policies.onnx_policy if name.endswith(".onnx") else policies.torchscript_policy
        write(folder / name, weight, bias)
        _layout(folder)

    return build


def _read_policy(name: str) -> Callable[[Path], Any]:
    def read(folder: Path) -> Any:
        from r2sego_blender.config.trusted_programs import Program, trust
        from r2sego_blender.robot.controllers.policy_runtime import PolicyFile

        os.environ["R2SEGO_CONFIG"] = str(folder / "config")
        if name.endswith(".pt"):  # as if a person had looked at each
            trust(Program.of(name, (folder / name).read_bytes()))
        layout = _read_layout(folder)
        network = PolicyFile(folder / name, layout).network()
        return network(np.ones(layout.observation_size, np.float32))

    return read


def _qpos() -> np.ndarray:
    qpos = np.zeros((_FRAMES, 10))
    qpos[:, 2], qpos[:, 3] = 0.8, 1.0
    qpos[:, 7:] = np.linspace(0.0, 0.3, _FRAMES)[:, None]
    return qpos


def _csv(folder: Path) -> None:
    lines = ["# rate_hz = 30, quaternion = wxyz", "x,y,z,qw,qx,qy,qz,a,b,c"]
    lines += [",".join(f"{value:.4f}" for value in row) for row in _qpos()]
    (folder / "m.csv").write_text("\n".join(lines) + "\n")


def _npz(folder: Path) -> None:
    np.savez(folder / "m.npz", qpos=_qpos(), rate_hz=np.array(30.0), joint_names=np.array(["a", "b", "c"]))


def _bodies() -> dict[str, np.ndarray]:
    from r2sego_blender.robot.motion.recorded_motion import HUMAN_BODIES

    rotation = np.zeros((_FRAMES, len(HUMAN_BODIES), 4), np.float32)
    rotation[..., 3] = 1.0
    position = np.random.default_rng(1).uniform(0.0, 1.5, (*rotation.shape[:2], 3)).astype(np.float32)
    return {"rigid_body_pos": position, "rigid_body_rot": rotation}


def _human_npz(folder: Path) -> None:
    np.savez(folder / "m.npz", fps=np.array(30.0), **_bodies())


def _human_motion(folder: Path) -> None:
    import torch

    torch.save(
        {name: torch.from_numpy(values) for name, values in _bodies().items()} | {"fps": 30}, folder / "m.motion"
    )


def _bodies_npz(folder: Path) -> None:
    """Joints without names and without a base, which the bodies beside them tell."""
    from r2sego_blender.robot.model.model import RobotModel
    from r2sego_blender.robot.model.structure import posed

    robot = RobotModel.load()
    data = posed(robot.model, robot.rest_qpos)
    bodies = [np.repeat(values[None, 1:], _FRAMES, axis=0) for values in (data.xpos, data.xquat)]
    joints = np.repeat(robot.rest_qpos[None, 7:], _FRAMES, axis=0)
    names = [robot.model.body(body).name for body in range(1, robot.model.nbody)]
    arrays = {"joint_pos": joints, "body_pos_w": bodies[0], "body_quat_w": bodies[1], "body_names": np.array(names)}
    np.savez(folder / "m.npz", fps=np.array([30]), **arrays)


def _played(folder: Path) -> Any:
    from r2sego_blender.robot.model.model import RobotModel
    from r2sego_blender.robot.motion.recorded_motion import RobotRecording, read_recording, robot_motion

    recording = read_recording(folder / "m.npz")
    return robot_motion(recording, RobotModel.load()) if isinstance(recording, RobotRecording) else recording


def _motion(name: str) -> Callable[[Path], Any]:
    def read(folder: Path) -> Any:
        from r2sego_blender.robot.motion.recorded_motion import read_recording

        return read_recording(folder / name)

    return read


_MOUNT = ["base", [0.1, 0.0, 0.4], [0.0, 0.3, 0.0], 60.0]

HARNESSES = (
    Harness("robots/wheeled.xml", _mjcf, "robot.xml", "xml", _robot("robot.xml")),
    Harness("robots/legged.xml", _legged, "robot.xml", "xml", _robot("robot.xml")),
    Harness("robots/urdf", _urdf, "robot.urdf", "xml", _robot("robot.urdf", _MOUNT)),
    Harness("robots/mesh.stl", _with_mesh(".stl"), "m.stl", "bytes", _robot("robot.xml"), share=0.5),
    Harness("robots/mesh.obj", _with_mesh(".obj"), "m.obj", "text", _robot("robot.xml"), share=0.5),
    Harness("policies/layout.toml", _layout, "layout.toml", "toml", _read_layout),
    Harness("policies/onnx", _policy("p.onnx"), "p.onnx", "onnx", _read_policy("p.onnx"), share=0.04),
    Harness("policies/torchscript", _policy("p.pt"), "p.pt", "archive", _read_policy("p.pt"), share=0.04),
    Harness("motions/csv", _csv, "m.csv", "text", _motion("m.csv")),
    Harness("motions/npz", _npz, "m.npz", "npz", _motion("m.npz")),
    Harness("motions/bodies.npz", _bodies_npz, "m.npz", "npz", _played, share=0.2),
    Harness("motions/human.npz", _human_npz, "m.npz", "npz", _motion("m.npz")),
    Harness("motions/human.motion", _human_motion, "m.motion", "archive", _motion("m.motion"), share=0.04),
)
