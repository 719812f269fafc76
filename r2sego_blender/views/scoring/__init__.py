"""The scores of candidate views: what the asset cannot show there, and what the proxy can (Eq. 2).

Begin with ``scores``.
"""
