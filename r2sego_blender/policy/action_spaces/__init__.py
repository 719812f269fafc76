"""The slot of the action space: what the numbers of a policy's action mean, and what carries them out.

Uses ``robot``. Begin with ``slot``; ``commands`` is the embedded space, ``sonic_tokens`` the motion tokens of SONIC
with its layouts (``sonic_layout``), networks and message (``token_message``).
"""
