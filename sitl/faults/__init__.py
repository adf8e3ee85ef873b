"""Faults of a simulated vehicle: what may fail, how, when, and where each is applied."""
