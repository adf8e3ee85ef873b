"""The planner: reference, linearisation, program, solver."""
