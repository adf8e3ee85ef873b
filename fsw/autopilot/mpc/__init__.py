"""The 10 Hz planner: reference, linearisation, program, solver."""
