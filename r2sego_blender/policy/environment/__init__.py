"""What a policy is trained in: episodes in a bundle's scene, as Gymnasium environments.

Physics on the collision surface, pictures of the visual asset. Uses ``robot`` for physics and the low level,
``splats`` and ``geometry`` for what the head camera sees; of the extra ``policy`` Gymnasium alone, and no torch.
Begin with ``environments``; ``state`` is what is known of an episode besides its observation.
"""
