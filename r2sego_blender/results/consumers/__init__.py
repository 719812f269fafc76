"""Folders for other people's training code, made of an export: ``r2sego export --for NAME``.

Uses ``geometry``, ``splats`` and ``robot``; none of the consumers' packages. Begin with ``consumer``; a file that
offers ``CONSUMER`` is found by ``registry``.
"""
