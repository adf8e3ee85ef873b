"""Modes, commands, faults and the safety gate."""
