"""``pandion top``: a vehicle's messages, margins and texts in a terminal."""
