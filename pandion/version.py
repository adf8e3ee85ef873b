"""Which version this is."""

from __future__ import annotations


def version() -> str:
    """Version of the installed distribution."""
    # Imported here: it reads package metadata, which only two places ask for.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("pandion")
    except PackageNotFoundError:
        return "0 (source tree, not installed)"
