"""The planner's optimiser against others, on the same recorded requests."""
