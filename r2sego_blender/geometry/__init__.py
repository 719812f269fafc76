"""The capture-anchored geometry proxy: observed, prior and completed surfaces.

Uses ``captures`` and what that stands on. Begin with ``proxy``; it is made of
what ``stereo``, ``room`` and ``objects`` give, by ``surfaces``; ``mesh`` and ``visibility`` serve all;
``collision`` and ``texture`` come after it.
"""
