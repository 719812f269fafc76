"""Rollouts: attempts simulated and judged, and the candidate stream V_0 of those that succeed.

Uses all of ``robot``. Begin with ``rollouts``.
"""
