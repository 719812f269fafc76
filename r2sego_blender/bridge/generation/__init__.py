"""Generated clips, their cameras and conditions.

Uses ``shared``.
"""
