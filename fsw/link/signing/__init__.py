"""MAVLink 2 signing: of frames, who may set a key, and where it is kept."""
