"""The command tree ``r2sego``, a file for what the commands are about.

Uses everything but ``bridge``; holds none of the method. Begin with ``cli``.
"""
