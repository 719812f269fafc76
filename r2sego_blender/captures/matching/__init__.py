"""Which photographs show the same things: features, and their matches.

Begin with ``overlap``.
"""
