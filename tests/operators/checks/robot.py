"""What holds of the room Robot, checked inside Blender."""

OPERATORS = set()
