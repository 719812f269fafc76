"""Robots with four and six legs, written as MJCF without a keyframe or actuators."""

from __future__ import annotations

import math

_HEAD = '<camera name="head_camera" pos="{x} 0 {z}" xyaxes="0 -1 0 0.3 0 0.954" fovy="60"/>'


def quadruped_mjcf() -> str:
    """Twelve hinges; calves whose limits leave out zero, so that the zero posture is none."""
    legs = ""
    for end, x in (("front", 0.19), ("rear", -0.19)):
        for side, y in (("left", 1), ("right", -1)):
            name = f"{end}_{side}"
            legs += f"""
      <body name="{name}_hip" pos="{x} {0.05 * y} 0">
        <joint name="{name}_hip" axis="1 0 0" range="-0.8 0.8"/>
        <geom type="sphere" size="0.04" mass="0.6"/>
        <body name="{name}_thigh" pos="0 {0.09 * y} 0">
          <joint name="{name}_thigh" axis="0 1 0" range="-1.5 3.4"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.22" mass="0.9"/>
          <body name="{name}_calf" pos="0 0 -0.22">
            <joint name="{name}_knee" axis="0 1 0" range="-2.7 -0.84"/>
            <geom type="capsule" size="0.014" fromto="0 0 0 0 0 -0.2" mass="0.2"/>
            <body name="{name}_foot" pos="0 0 -0.22">
              <geom type="sphere" size="0.022" mass="0.05"/>
            </body>
          </body>
        </body>
      </body>"""
    return f"""<mujoco model="quadruped">
  <compiler angle="radian"/>
  <default><joint armature="0.01" damping="0.1"/><geom rgba="0.4 0.4 0.5 1"/></default>
  <worldbody>
    <body name="trunk" pos="0 0 0.4">
      <freejoint/>
      <geom type="box" size="0.2 0.05 0.05" mass="7"/>
      {_HEAD.format(x=0.22, z=0.08)}{legs}
    </body>
  </worldbody>
</mujoco>"""


def hexapod_mjcf() -> str:
    """Eighteen hinges; the zero posture has all legs stretched out to the sides."""
    legs = ""
    for row, along_deg in (("front", 40.0), ("middle", 90.0), ("rear", 140.0)):
        for side, sign in (("left", 1), ("right", -1)):
            name, turn = f"{row}_{side}", sign * math.radians(along_deg)
            x, y = 0.14 * math.cos(turn), 0.1 * math.sin(turn)
            legs += f"""
      <body name="{name}_coxa" pos="{x} {y} 0" axisangle="0 0 1 {turn}">
        <joint name="{name}_coxa" axis="0 0 1" range="-0.9 0.9"/>
        <geom type="capsule" size="0.018" fromto="0 0 0 0.05 0 0" mass="0.15"/>
        <body name="{name}_femur" pos="0.05 0 0">
          <joint name="{name}_femur" axis="0 1 0" range="-1.6 1.6"/>
          <geom type="capsule" size="0.015" fromto="0 0 0 0.1 0 0" mass="0.15"/>
          <body name="{name}_tibia" pos="0.1 0 0">
            <joint name="{name}_tibia" axis="0 1 0" range="-2.4 2.4"/>
            <geom type="capsule" size="0.012" fromto="0 0 0 0.16 0 0" mass="0.1"/>
          </body>
        </body>
      </body>"""
    return f"""<mujoco model="hexapod">
  <compiler angle="radian"/>
  <default><joint armature="0.005" damping="0.05"/></default>
  <worldbody>
    <body name="body">
      <freejoint/>
      <geom type="ellipsoid" size="0.16 0.09 0.04" mass="2.5"/>
      {_HEAD.format(x=0.15, z=0.05)}{legs}
    </body>
  </worldbody>
</mujoco>"""
