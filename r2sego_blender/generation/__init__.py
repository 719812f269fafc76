"""Ego-view generation: camera paths, structural conditions, generators, registration."""
