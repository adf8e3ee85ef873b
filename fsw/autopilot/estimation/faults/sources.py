"""Who says something of how the vehicle moves, and what each two of them may differ by."""

from __future__ import annotations

from enum import IntFlag
from typing import Final


class Source(IntFlag):
    """What says something of how the vehicle moves."""

    GYRO = 1
    ACCELEROMETER = 2
    MODEL = 4
    POSE = 8
    GNSS = 16
    COMPASS = 32
    ATTITUDE = 64  # of a pose; of a ``POSE`` that is wrong it is too


_NAMES: Final = {
    Source.GYRO: "gyro",
    Source.ACCELEROMETER: "accelerometer",
    Source.MODEL: "rotors",
    Source.POSE: "pose",
    Source.GNSS: "GNSS",
    Source.COMPASS: "magnetometer",
    Source.ATTITUDE: "attitude of the pose",
}


def names(sources: Source) -> str:
    """What an operator reads."""
    return " or ".join([name for source, name in _NAMES.items() if source & sources])


NOBODY: Final = Source(0)
G, A, M, P, N, B, Q = Source
# Residuals, each with who it is of. Where no pose holds the attitude, what turns an acceleration
# into the world is the gyro's and the magnetometer's as well: see ``verdict.py``.
# The last two are of one alone: a bias that is larger than a sensor of its kind has.
GM, GP, GB, AM, AP, MP_TURN, MP_FORCE, AN, MN, NN, MB, AA, GG = range(13)
_PQ: Final = P | Q
OF: Final = (G | M, G | _PQ, G | B, A | M, A | P, M | _PQ, M | P, A | N, M | N, N, M | B, A, G)
COUNT: Final = len(OF)
