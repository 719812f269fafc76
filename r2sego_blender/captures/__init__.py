"""Captures: photographs with calibrated poses in the world frame."""
