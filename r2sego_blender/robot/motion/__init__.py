"""Motions of all joints: composed for a behaviour, or recorded and carried over to this robot.

Uses ``behaviours`` and ``model``. Begin with ``motion``.
"""
