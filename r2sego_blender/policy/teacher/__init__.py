"""The teacher: it knows where the robot, the seat and the obstacles are, and says what to do in any state.

A function of ``environment``'s privileged state; ways come from ``robot``'s planner. Begin with ``teacher``.
"""
