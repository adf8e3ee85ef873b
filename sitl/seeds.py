"""Every random number of a run descends from one seed."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, *path: str) -> np.random.Generator:
    """The random stream of one named consumer.

    The stream depends on the seed and the name only, so adding a disturbance or a noisy
    sensor leaves every other draw as it was.

    Raises:
        ValueError: Negative seed.
    """
    key = tuple(zlib.crc32(word.encode()) for word in path)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
