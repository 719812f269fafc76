"""What a policy is trained in: episodes in a bundle's scene, as Gymnasium environments.

Uses ``robot`` for physics and the low level, ``splats`` and ``geometry`` for what the head camera sees. Begin with
``state``: what is known of an episode besides its observation.
"""
