"""Tunables and their presets."""
