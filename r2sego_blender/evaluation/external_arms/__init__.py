"""Methods of others that run in an environment of their own and show the frozen views themselves: no asset is read.

May use ``workers`` and what ``evaluation`` may. Begin with ``external_views``; a method is a file of this folder that
offers what ``slot.ExternalArm`` lists, an entry of ``evaluation.arms`` and one of ``workers.learned_backends``.
"""
