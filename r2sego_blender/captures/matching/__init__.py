"""Which photographs show the same things: features, their matches, what only repeats, how alike patches look on planes.

Begin with ``overlap``.
"""
