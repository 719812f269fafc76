"""Which views are generated: scores, selection and references (RobotProxy in Algorithm 1); what a head sees.

Uses ``robot``, ``geometry`` and ``splats``. Begin with ``allocation``; ``head_image`` draws
a robot's own body among the splats.
"""
