"""What PX4 is told by a simulator, and what it answers; wire order, see messages.frames.

Only messages of the common dialect that PX4's SimulatorMavlink reads: with a private one on this
link it stops answering now and then. It takes no stamp but that of HIL_SENSOR, which is its clock,
and what comes before it for measured at the step before.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, cast

from messages import message_ids
from messages.frames import Frame, FrameWriter
from messages.message_ids import SIMULATOR, SYSTEM_ID
from sitl.earth import Place
from sitl.link.encode_sensors import (
    BAROMETRIC,
    INERTIAL,
    MAGNETIC,
    VIO,
    about_pose,
    distance_values,
    gps_values,
    pressure_values,
)
from sitl.sensors.barometer import PressureMeasurement
from sitl.sensors.channel import Measurement
from sitl.sensors.gnss import GnssMeasurement
from sitl.sensors.imu import ImuMeasurement
from sitl.sensors.magnetometer import MagneticMeasurement
from sitl.sensors.motion_capture import PoseMeasurement
from sitl.sensors.rangefinder import RangeMeasurement
from vehicles.description import Vehicle

# MAV_ESTIMATOR_TYPE: motion capture (6) is read and used by nothing in EKF2, vision is.
_VISION: Final = 2
_ARMED: Final = 128  # MAV_MODE_FLAG in the mode of HIL_ACTUATOR_CONTROLS
_WARM_C: Final = 15.0


class Px4Answer(NamedTuple):
    """HIL_ACTUATOR_CONTROLS."""

    t_us: int  # of the HIL_SENSOR that it answers
    thrust: tuple[float, ...]  # (r,) fraction of full thrust
    joints: tuple[float, ...]  # (j,) -1…1, positions
    armed: bool


class Px4Encoder:
    """Builds what is sent for one step."""

    def __init__(self, origin: Place) -> None:
        """Begin the local frame at ``origin``."""
        self._writer = FrameWriter(SYSTEM_ID, SIMULATOR)
        self._origin = origin

    def step(self, t_us: int, measurements: list[Measurement]) -> bytes:
        """All that has arrived from the sensors since the last step, HIL_SENSOR last.

        PX4 takes one sample of the inertial unit a step: the mean of those there were, as a driver
        integrates them. Nothing of it is said where there was none.
        """
        frames, updated = [], 0
        force = rate = field = (0.0, 0.0, 0.0)
        air = (0.0, 0.0, 0.0, _WARM_C)
        inertial = [one for one in measurements if isinstance(one, ImuMeasurement)]
        if inertial:
            updated |= INERTIAL
            force = _mean([one.accel_B for one in inertial])
            rate = _mean([one.gyro_B for one in inertial])
        for one in measurements:
            if isinstance(one, PoseMeasurement):
                about = about_pose(one, VIO if one.from_cameras_on_board else _VISION)
                values = (max(one.t_us, 0), *one.p_WB, *one.q_WB, *about)
                frames.append(self._writer.frame(message_ids.ODOMETRY, *values))
            elif isinstance(one, GnssMeasurement):
                gps = gps_values(self._origin, one)
                frames.append(self._writer.frame(message_ids.HIL_GPS, max(one.t_us, 0), *gps))
            elif isinstance(one, RangeMeasurement):
                ray = distance_values(one)
                frames.append(self._writer.frame(message_ids.DISTANCE_SENSOR, *ray))
            elif isinstance(one, MagneticMeasurement):
                updated |= MAGNETIC
                field = one.field_B
            elif isinstance(one, PressureMeasurement):
                updated |= BAROMETRIC
                air = pressure_values(one)
        values = (t_us, *force, *rate, *field, *air, updated, 0)
        frames.append(self._writer.frame(message_ids.HIL_SENSOR, *values))
        return b"".join(frames)


def _mean(vectors: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return (x, y, z)


def read_answer(frame: Frame, vehicle: Vehicle) -> Px4Answer | None:
    """What PX4 answers to a ``vehicle``; None of any other message.

    A control that is no number is one of an output that is off.
    """
    if frame.message_id != message_ids.HIL_ACTUATOR_CONTROLS:
        return None
    t_us, _, *controls, mode = cast("tuple[float, ...]", frame.payload_values)
    finite = [one if math.isfinite(one) else 0.0 for one in controls]
    rotors = len(vehicle.rotors)
    positions = tuple(finite[rotors : rotors + len(vehicle.joints)])
    return Px4Answer(int(t_us), tuple(finite[:rotors]), positions, bool(int(mode) & _ARMED))
