"""The declared behaviours drawn as trajectories, and where in the room they fit.

Uses ``model`` and ``scope``. Begin with ``behaviours``.
"""
