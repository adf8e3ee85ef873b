"""Pandion flight software; ``autopilot/`` is pure, the rest is the process around it."""
