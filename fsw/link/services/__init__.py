"""MAVLink services on one link: parameters, missions, time, and their dispatch."""
