"""MAVLink 2 signing: signatures, the setting of a key, and its file."""
