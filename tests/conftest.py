"""Settings for every test."""

from hypothesis import settings

# The same examples on every machine and in every run: a failure on one is a failure on all. No
# deadline per example, because the first one may compile a kernel or wait for a busy core.
settings.register_profile("reproducible", derandomize=True, deadline=None)
settings.load_profile("reproducible")
