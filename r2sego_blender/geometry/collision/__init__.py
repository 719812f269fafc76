"""The collision surface: what a simulated robot touches, made of the proxy.

Uses ``proxy`` and ``mesh``. Begin with ``collision``; ``collision_files`` writes it for simulators.
"""
