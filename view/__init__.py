"""Shows flights: live, and from their logs."""
