"""Which version this is."""

from __future__ import annotations

import os


def version() -> str:
    """Version of the installed distribution."""
    # Imported here: it reads package metadata, which only two places ask for.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("pandion")
    except PackageNotFoundError:
        return "0 (source tree, not installed)"


def version_and_machine() -> str:
    """The first line of a measurement."""
    return f"Pandion {version()}: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
