"""The README's table of results: its scenes refined and scored, and its rows."""
