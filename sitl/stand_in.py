"""What the controllers of rotors and joints do by themselves while no command comes.

Assumed of the vehicle: a microcontroller with an inertial unit of its own drives the rotors, as on
every flight controller, and each joint's servo has an encoder. So a flight software that is
suspended on its computer leaves no attitude uncontrolled. Without a command for ``STALE_S`` the
rotors level the vehicle at the mean thrust of the last commands, and the joints hold their angles.
No position is known there: the vehicle drifts at the speed that it had, and with the wind.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sitl.plant.parameters import effectiveness
from sitl.sensors.exact import SensorReadings
from sitl.simulation import STEP_US, Controls
from vehicles.description import Vehicle

STALE_S: Final = 0.02  # ten steps; lost or late datagrams are fewer
_MEAN_S: Final = 0.1  # of commands; what corrects a disturbance of this moment is left out
_LEVELLING: Final = 120.0  # 1/s^2, of the tilt
_DAMPING: Final = 18.0  # 1/s, of the rates; with the rotors' lag it is still well damped
_YAW_SHARE: Final = 0.3  # of that about z, where rotors have little torque
_STIFFNESS: Final = 1.0  # of a joint's full torque for a radian
_JOINT_DAMPING: Final = 0.05  # of a joint's full torque for 1 rad/s


class StandIn:
    """Stands in for commands that do not come, on one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        # Share of full thrust of every rotor for 1 rad/s^2 about each axis, and no lift.
        effect = effectiveness(vehicle)
        xx, yy, zz = vehicle.base.inertia[:3]
        wanted = np.vstack([np.zeros(3), np.diag([max(xx, yy), max(xx, yy), _YAW_SHARE * zz])])
        full = np.array([rotor.thrust_max for rotor in vehicle.rotors])
        self._turn = (np.linalg.pinv(effect[2:]) @ wanted) / full[:, None]
        self._mean: Controls | None = None
        self._angles: tuple[float, ...] = ()  # rad, of the joints when commands stopped

    def applied(self, controls: Controls, held_s: float, readings: SensorReadings) -> Controls:
        """What takes effect of ``controls`` that came ``held_s`` [s] ago; once a step.

        Of the ``readings`` gyro, attitude to the vertical and joints are measured there too.
        """
        if not controls.armed:
            self._mean = None
            return controls
        if held_s <= STALE_S or self._mean is None:
            self._mean, self._angles = self._with(controls), readings.q_arm
            return controls
        mean = self._mean
        wx, wy, wz = readings.gyro_B
        qw, qx, qy, qz = readings.q_WB
        ahead, right = 2.0 * (qx * qz - qw * qy), 2.0 * (qy * qz + qw * qx)  # of down, in B
        x = -(_LEVELLING * right + _DAMPING * wx)
        y = _LEVELLING * ahead - _DAMPING * wy
        more = self._turn @ (x, y, -_DAMPING * wz)
        thrust = tuple(np.clip(mean.thrust + more, 0.0, 1.0).tolist())
        torque = tuple(
            min(max(t + _STIFFNESS * (a - q) - _JOINT_DAMPING * w, -1.0), 1.0)
            for t, a, q, w in zip(
                mean.torque, self._angles, readings.q_arm, readings.qd_arm, strict=True
            )
        )
        return Controls(thrust, torque, armed=True)

    def _with(self, controls: Controls) -> Controls:
        """The mean of the last thrusts, and the last torques."""
        if self._mean is None:
            return controls
        share = 1e-6 * STEP_US / _MEAN_S
        thrust = tuple(
            old + share * (new - old)
            for old, new in zip(self._mean.thrust, controls.thrust, strict=True)
        )
        return Controls(thrust, controls.torque, armed=True)
