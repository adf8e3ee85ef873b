"""What the controllers of rotors and joints do by themselves while no command comes.

Assumed of the vehicle: a microcontroller with an inertial unit of its own drives the rotors, as on
every flight controller, and each joint's servo has an encoder. So a flight software that is
suspended on its computer leaves no attitude uncontrolled. Without a command for ``STALE_S`` the
rotors level the vehicle at the mean thrust of the last commands, and the joints hold their angles.
No position is known there: the vehicle drifts at the speed that it had, and with the wind.
"""

from __future__ import annotations

from typing import Final

from sitl.plant.parameters import Vehicle
from sitl.sensors.exact import SensorReadings
from sitl.simulation import STEP_US, Controls

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
        rotors, size = vehicle.rotors, vehicle.base_inertia
        full = rotors.thrust_max
        # Share of full thrust of a rotor for 1 rad/s^2 about x and y, and about z.
        self._level = max(size[0], size[1]) / (2.0 * rotors.arm * full)
        self._yaw = _YAW_SHARE * size[2] / (4.0 * rotors.yaw_ratio * full)
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
        x = -self._level * (_LEVELLING * right + _DAMPING * wx)
        y = self._level * (_LEVELLING * ahead - _DAMPING * wy)
        z = -self._yaw * _DAMPING * wz
        f1, f2, f3, f4 = mean.thrust
        # As in ``rotor_torque``: 1 rear, 2 left, 3 front, 4 right.
        thrust = (_share(f1 - y + z), _share(f2 + x - z), _share(f3 + y + z), _share(f4 - x - z))
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
        a, b, c, d = (
            old + share * (new - old)
            for old, new in zip(self._mean.thrust, controls.thrust, strict=True)
        )
        return Controls((a, b, c, d), controls.torque, armed=True)


def _share(thrust: float) -> float:
    return min(max(thrust, 0.0), 1.0)
