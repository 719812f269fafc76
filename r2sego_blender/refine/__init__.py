"""The steps of Algorithm 1 on a scene bundle, and a bundle made from photographs.

Uses all parts of the paper. ``pipeline`` calls it line by line; begin with ``steps``.
"""
