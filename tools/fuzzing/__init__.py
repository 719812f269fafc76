"""Inputs that were changed at random, for every reader (see README.md in this folder)."""
