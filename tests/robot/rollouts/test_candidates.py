"""The candidate stream: frames of successes, less those that turn too fast."""

import numpy as np
from scipy.spatial.transform import Rotation

from r2sego_blender.robot.rollouts.candidates import candidate_stream
from r2sego_blender.robot.rollouts.rollouts import Rollout

RATE_HZ = 10.0


def turning(degrees, success=True):
    """A rollout whose camera moves 1 m a frame and turns about the vertical to ``degrees`` (T,)."""
    count = len(degrees)
    poses = np.tile(np.eye(4), (count, 1, 1))
    angles = np.asarray(degrees, float)[:, None]
    poses[:, :3, :3] = Rotation.from_euler("z", angles, degrees=True).as_matrix()
    poses[:, 0, 3] = np.arange(count)
    return Rollout(
        success=success,
        reason="" if success else "fall",
        frame=count - 1,
        qpos=np.eye(1, 7, 3).repeat(count, 0),
        times_s=np.arange(count) / RATE_HZ,
        camera_poses=poses,
        seed=(0, 0),
    )


def test_frames_beside_a_fast_turn_are_no_candidates():
    rollouts = [
        turning([0.0, 2.0, 12.0, 14.0, 16.0, -4.0, -6.0]),  # 100 deg/s from 1 to 2, 200 from 4 to 5
        turning(np.zeros(5), success=False),
        turning([0.0, 4.9]),
        turning([90.0]),
    ]
    stream = candidate_stream(rollouts, max_turn_deg_s=50.0)
    assert stream.frame.tolist() == [0, 3, 6, 0, 1, 0]
    assert stream.rollout.tolist() == [0, 0, 0, 1, 1, 2]
    np.testing.assert_array_equal(stream.poses[:, 0, 3], stream.frame)
    assert candidate_stream(rollouts, max_turn_deg_s=150.0).frame.tolist() == [0, 1, 2, 3, 6, 0, 1, 0]
    assert len(candidate_stream(rollouts)) == 7 + 2 + 1
