"""Joint encoders: angles in steps. There is no tachometer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.sensors.channel import Aboard, SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import Encoders
from sitl.sensors.noise import normal

_BLOCK = 250  # numbers drawn at once


class JointMeasurement(NamedTuple):
    """Angles of the joints."""

    t_us: int
    angles: tuple[float, ...]  # (j,) rad


class EncoderSensor(SensorModel):
    """The encoders of one flight."""

    kind = Encoders
    says = JointMeasurement

    def __init__(self, keys: Encoders, random: np.random.Generator, joints: int) -> None:
        self._keys = keys
        self._random = random
        self._offset = tuple(normal(random, keys.offset_rad, joints))
        self._rest: list[float] = []  # of the numbers drawn, too few for all joints
        # With the noise, of the samples to come, the next one last.
        self._offsets: list[tuple[float, ...]] = []

    @classmethod
    def aboard(cls, keys: Encoders, random: np.random.Generator, where: Aboard) -> EncoderSensor:
        """Those of all joints of its vehicle."""
        return cls(keys, random, len(where.vehicle.joints))

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> JointMeasurement:
        """All angles; an outlier has a wrong bit, in the first joint."""
        offset = self._offset
        if self._keys.noise_rad > 0.0:
            if not self._offsets:
                self._offsets = self._drawn()
            offset = self._offsets.pop()
        if outlier:
            offset = (offset[0] + self._keys.outlier_rad, *offset[1:])
        grid = self._keys.resolution_rad
        pairs = zip(exact.q_arm, offset, strict=True)
        if grid > 0.0:
            return JointMeasurement(
                stamp_us, tuple([grid * round((a + b) / grid) for a, b in pairs])
            )
        return JointMeasurement(stamp_us, tuple([angle + more for angle, more in pairs]))

    def _drawn(self) -> list[tuple[float, ...]]:
        """Offset and noise of the samples to come: as many numbers as fill them, joint by joint."""
        joints = len(self._offset)
        # The last number of a block is taken first.
        drawn = self._rest + normal(self._random, self._keys.noise_rad, _BLOCK)[::-1]
        filled = len(drawn) // joints * joints
        self._rest = drawn[filled:]
        samples = np.reshape(drawn[:filled], (-1, joints)) + self._offset
        return list(map(tuple, samples[::-1].tolist()))
