"""Rotations, vectors and frames."""
