"""A pure function (state, inputs) → (state, outputs); read ``flight/autopilot.py`` first."""
