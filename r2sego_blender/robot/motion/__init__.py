"""Motions of all joints: composed for a behaviour, or recorded and carried over to this robot.

Uses ``planning``, ``behaviours`` and ``model``. Begin with ``motion``.
"""
