"""Measurements of Pandion, run from a checkout: ``python -m benchmarks NAME …``."""
