"""The simulator's side of the MAVLink connection to the flight software."""
