"""Where a generated frame really is: registered to the captures.

Begin with ``frame_registration``.
"""
