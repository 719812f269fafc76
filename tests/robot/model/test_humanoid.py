"""The embedded humanoid against the published robot's numbers."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from r2sego_blender.robot.model.humanoid import STANDING_HEIGHT_M, humanoid_mjcf


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(humanoid_mjcf())


def test_has_29_actuators_and_the_published_mass(model):
    assert (model.nu, model.nq, model.nv) == (29, 36, 35)
    assert model.body_mass.sum() == pytest.approx(35.112, abs=0.01)
    assert (model.actuator_forcerange[:, 1] > 0.0).all()


def test_uses_primitive_shapes_only(model):
    kinds = {mujoco.mjtGeom(kind).name for kind in model.geom_type}
    assert kinds == {"mjGEOM_BOX", "mjGEOM_CAPSULE", "mjGEOM_SPHERE"}


def test_stands_on_its_soles_at_the_published_height(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    assert data.body("pelvis").xpos[2] == pytest.approx(STANDING_HEIGHT_M) == 0.785
    spheres = model.geom_type == int(mujoco.mjtGeom.mjGEOM_SPHERE)
    for side in ("left", "right"):
        soles = spheres & (model.geom_bodyid == model.body(f"{side}_ankle_roll_link").id)
        bottoms = data.geom_xpos[soles, 2] - model.geom_size[soles, 0]
        assert len(bottoms) == 4
        np.testing.assert_allclose(bottoms, 0.0, atol=1e-5)


def test_is_mirror_symmetric(model):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for index in range(model.nbody):
        name = model.body(index).name
        if name.startswith("left_"):
            other = data.body(name.replace("left_", "right_"))
            np.testing.assert_allclose(data.xpos[index] * [1, -1, 1], other.xpos, atol=1e-9)


def test_moves_as_the_published_robot(model, shared_robot):
    published = mujoco.MjModel.from_xml_path(str(shared_robot("g1/unitree_mujoco_g1/g1_29dof.xml")))
    names = [published.joint(index).name for index in range(published.njnt)]
    assert [model.joint(index).name for index in range(model.njnt)] == names
    np.testing.assert_allclose(model.jnt_range, published.jnt_range, atol=1e-4)
    np.testing.assert_allclose(model.body_mass, published.body_mass, atol=1e-6)
    np.testing.assert_allclose(model.actuator_forcerange, published.actuator_ctrlrange)
    ours, theirs = mujoco.MjData(model), mujoco.MjData(published)
    rng = np.random.default_rng(0)
    for _ in range(5):
        ours.qpos[7:] = theirs.qpos[7:] = rng.uniform(model.jnt_range[1:, 0], model.jnt_range[1:, 1])
        theirs.qpos[:3] = ours.qpos[:3]
        mujoco.mj_kinematics(model, ours)
        mujoco.mj_kinematics(published, theirs)
        np.testing.assert_allclose(ours.xpos, theirs.xpos, atol=2e-4)
