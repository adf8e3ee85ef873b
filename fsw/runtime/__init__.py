"""Time, threads and the loop around the pure tick."""
