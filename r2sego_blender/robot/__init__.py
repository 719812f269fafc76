"""The robot proxy: executable ego views of a declared behaviour.

Uses ``config`` and ``core``. Begin with ``scope`` (what is declared) and ``rollouts`` (what comes of it);
``policies/`` and ``scopes/`` are the declarations that come along.
"""
