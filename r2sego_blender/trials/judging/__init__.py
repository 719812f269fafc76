"""Judging a trial from what the device sent and what the operator told, repeatable from the record.

Uses ``plan`` (its rules). Begin with ``judge``; ``validity`` says when a recording tells nothing, ``support`` what
stable support by the chair is, ``manual`` what a person's judgement may say.
"""
