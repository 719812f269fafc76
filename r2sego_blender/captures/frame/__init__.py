"""The world frame W: gravity, floor, origin, heading and metres, by measure or as a person shows them.

Uses ``sensors`` and ``poses``. Begin with ``world_frame``.
"""
