"""Which version this is."""

from __future__ import annotations


def version() -> str:
    """Version of the installed distribution; 0.0.0 in a source tree that is not installed."""
    # Imported here: reading package metadata takes time, and few ask for it.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("pandion")
    except PackageNotFoundError:
        return "0.0.0"
