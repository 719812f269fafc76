"""The collision surface and what was dropped on it.

Uses ``shared``.
"""
