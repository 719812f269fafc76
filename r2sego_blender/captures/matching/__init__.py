"""Which photographs show the same things: features and their matches, and how alike patches look on planes.

Begin with ``overlap``.
"""
