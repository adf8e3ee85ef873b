"""Searches over flights: for the worst disturbance, the worst flight, and better parameters."""
