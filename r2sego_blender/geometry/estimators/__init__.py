"""Captures in, depth of each out, in an estimator's own unit; brought to the registered poses here.

May use ``captures`` and ``stereo``, and of Blender's Python ``estimated_depth`` and ``aligned_depth`` alone.
Begin with ``backends``; ``alignment`` is what every estimate goes through, ``contradictions`` what it is held against.
"""
