"""LPIPS-Alex, computed by the weights that a person gives, and left out without them.

Uses ``core`` and, once there are weights, torch. Begin with ``weights``.
"""
