"""The pictures in docs/pictures."""
