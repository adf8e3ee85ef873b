"""What the simulated sensors say as the flight software's samples, without a link between them.

What the messages would round stays exact, but for what a sensor itself rounds; variances are stated
as the link's decoder states them.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Final, get_args

from fsw.autopilot.measurements import GnssSample, ImuSample, PressureSample, Sample
from sitl.sensors.barometer import PressureMeasurement, standard_altitude
from sitl.sensors.channel import Measurement
from sitl.sensors.gnss import GnssMeasurement
from sitl.sensors.imu import ImuMeasurement

_NOT_STATED: Final = 0.0  # a variance that the message has no field for
# By the name that a kind has on both sides, and how many fields; where nothing else is said, in the
# same order.
_KINDS: Final[dict[str, tuple[Any, int]]] = {
    kind.__name__.removesuffix("Sample"): (kind, len(fields(kind))) for kind in get_args(Sample)
}


def sample(said: Measurement) -> Sample:
    """One measurement, of a frame whose origin lies at sea level."""
    time = 1e-6 * said.t_us
    match said:
        case ImuMeasurement():
            return ImuSample(time, said.accel_B, said.gyro_B)
        case GnssMeasurement():
            level, down = said.horizontal_deviation**2, said.vertical_deviation**2
            speed = (_NOT_STATED,) * 3
            return GnssSample(
                time,
                said.p_WB,
                said.v_WB,
                (level, level, down),
                speed,
                said.fix_type,
                said.satellites,
            )
        case PressureMeasurement():
            return PressureSample(time, standard_altitude(said.pressure_pa), _NOT_STATED)
    values: Any = said
    kind, count = _KINDS.get(type(said).__name__.removesuffix("Measurement"), (None, 0))
    if kind is None:
        raise TypeError(f"{said} is nothing that the flight software takes in")
    found: Sample = kind(time, *values[1:count])
    return found
