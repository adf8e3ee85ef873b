"""The simulator: an aerial manipulator, its world and its sensors, seen only through messages."""
