"""Keyframes: which of a video's frames, or of hundreds of photographs, become captures.

The sharpest of neighbours, and of those the ones that together show most of the room from most places.
"""
