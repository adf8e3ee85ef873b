"""A flight that several files look at: it is flown once."""

from __future__ import annotations

import pytest

from tests.cli.heard_flight import Flight, flown


@pytest.fixture(scope="session")
def lockstep(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Three seconds of ``walls``, exact and disturbed."""
    arguments = ("walls", "--seed", "2", "--duration", "3")
    return flown(tmp_path_factory.mktemp("lockstep"), *arguments)
