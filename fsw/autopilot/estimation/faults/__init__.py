"""Which measurement or sensor is wrong, and what the filter does about it."""
