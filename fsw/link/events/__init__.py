"""MAVLink's events interface: what happens, in numbers that a document explains."""
