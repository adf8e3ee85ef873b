"""Barrier Lyapunov functions; each contributes rows to the planner's program."""
