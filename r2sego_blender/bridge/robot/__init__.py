"""Rollouts on the timeline, and what a person draws of a behaviour scope.

Uses ``shared``.
"""
