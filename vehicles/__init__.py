"""Vehicles as files: what the flight software and the simulator each build their physics from."""
