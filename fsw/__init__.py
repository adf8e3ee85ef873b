"""Pandion flight software; read ``runtime/flight_loop.py`` first and ``signals.py`` second."""
