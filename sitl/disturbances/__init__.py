"""Disturbances: scenario items that add up."""
