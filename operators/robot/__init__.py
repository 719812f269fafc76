"""The robot, its behaviour and its rollouts."""

CLASSES = ()
