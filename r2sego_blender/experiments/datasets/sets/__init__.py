"""The data sets that experiments know by name: one file each, which offers ``DATASET``.

A new set is a file here and its tests; ``registry`` finds it, the command's help and the pages name it.
"""
