"""The behaviour scope B: what a person declared of motions, views and initial conditions.

Uses ``behaviours``. Begin with ``scope``.
"""
