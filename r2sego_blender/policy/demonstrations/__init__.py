"""Demonstrations for other people's training: episodes of the teacher as LeRobot datasets.

Uses ``core`` and, with the packages of the extra ``policy``, PyAV and Arrow. Begin with ``lerobot``.
"""
