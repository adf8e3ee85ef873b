"""Force and torque on the tool: what acts on it from outside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.ranges import V3
from sitl.sensors.channel import SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import ForceTorque
from sitl.sensors.noise import anywhere, digits, normal


class WrenchMeasurement(NamedTuple):
    """What acts on the tool from outside, about the end-effector, in the axes of the last link."""

    t_us: int
    force: V3  # N
    torque: V3  # N·m


class ForceTorqueSensor(SensorModel):
    """The force/torque sensor of one flight."""

    kind = ForceTorque
    says = WrenchMeasurement

    def __init__(self, keys: ForceTorque, random: np.random.Generator) -> None:
        self._keys = keys
        self._random = random
        self._offset = np.array(
            normal(random, keys.force_bias_n, 3) + normal(random, keys.torque_bias_n_m, 3)
        )

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> WrenchMeasurement:
        """Force and torque; an outlier is a force in any direction, as where a cable is pulled."""
        keys, random = self._keys, self._random
        noise = normal(random, keys.force_n, 3) + normal(random, keys.torque_n_m, 3)
        felt = (np.array(exact.wrench) + self._offset + noise).tolist()
        force, torque = _three(felt[:3]), _three(felt[3:])
        if outlier:
            force = _three(np.add(force, anywhere(random, keys.outlier_n)).tolist())
        force = digits(force, (keys.force_resolution_n,) * 3)
        torque = digits(torque, (keys.torque_resolution_n_m,) * 3)
        return WrenchMeasurement(stamp_us, force, torque)


def _three(values: list[float]) -> V3:
    x, y, z = values
    return (x, y, z)
