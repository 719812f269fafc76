"""The captures' colours baked on the proxy.

Uses ``mesh`` and ``visibility``. Begin with ``texturing``.
"""
