"""The behaviours that a scope may declare, a module each: its ranges, its weight, how it is drawn.

Uses ``config`` and NumPy alone. Begin with ``behaviour``; ``registry`` finds the modules, and a new
one is there by being in this folder (docs/behaviour-scope.md).
"""
