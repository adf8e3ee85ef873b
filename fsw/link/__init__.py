"""MAVLink on both sides of the flight software: the simulator or vehicle, and ground stations."""
