"""Pandion flight software; read ``flight/autopilot.py`` first and ``signals.py`` second."""
