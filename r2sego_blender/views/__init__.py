"""Which views are generated: scores, selection and references (RobotProxy in Algorithm 1).

Uses ``robot``, ``geometry`` and ``splats``. Begin with ``allocation``.
"""
