"""The one protocol of workers: a model, or a program of a person's own, asked through folders of files.

May use ``core`` and what of ``workers`` runs processes. Begin with ``asking`` for the side that asks; ``serving``
is the worker's side, a file that runs alone in the model's environment.
"""
