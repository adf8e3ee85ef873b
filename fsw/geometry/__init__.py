"""Rotations and frames."""
