"""Gymnasium environments of a bundle: what the robot sees and feels in it, and what becomes of its commands.

Physics on the collision surface, pictures of the visual asset. Uses ``robot`` and ``splats``; of the packages of
the extra ``policy`` Gymnasium alone, and no torch. Begin with ``environments``, then ``episode`` and ``head_image``.
"""
