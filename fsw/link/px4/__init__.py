"""PX4 as the vehicle: it flies, and is told where the plan wants it."""
