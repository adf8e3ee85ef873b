"""Position and velocity from satellites."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from fsw.autopilot.estimation.error_state import Filter, V
from fsw.autopilot.estimation.faults.residuals import Aid
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.faults.sources import Source
from fsw.autopilot.estimation.fusion import (
    GNSS,
    believable,
    clear,
    forget,
    judged,
    position_rows,
    set_place,
)
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.sensors.base import (
    CREEPS,
    PLACE_LIMIT,
    AidingSensor,
    LogField,
    LogTopic,
    Ratios,
    chi_square,
)
from fsw.autopilot.geometry.vectors import ZERO, norm, put_three, subtract, three
from fsw.autopilot.measurements import GnssSample, Sensor
from fsw.autopilot.signals import Vec2, Vec3
from fsw.compiled import compilable, kernel, machine_code

_FASTEST: Final = 50.0  # m/s
_FINE: Vec3 = (1e-4, 1e-4, 1e-4)
_MAKES = 0.5  # s: a place that is off by no more than its velocity makes meanwhile has not jumped


@dataclass(frozen=True, slots=True)
class GnssTuning:
    """What a receiver is taken for."""

    # The least standard deviations that it is believed, or its own where it states none.
    position_floor: float = 0.01  # m
    velocity_floor: float = 0.1  # m/s
    # Standard deviations; farther from what is expected is not fused.
    position_gate: float = 5.0
    velocity_gate: float = 5.0
    delay: float = 0.0  # s, that it takes longer than its time stamp says


class Gnss(AidingSensor[GnssSample, GnssTuning]):
    """Two parts: position, velocity."""

    sensor = Sensor.GNSS
    sample = GnssSample
    measures = ("position", "velocity")
    at_rest = GnssSample(0.0, ZERO, ZERO, _FINE, _FINE)
    of_an_axis = 2
    source = Source.GNSS
    noise_scales = slice(GNSS, GNSS + 2)
    gates = ("position_gate", "velocity_gate")
    changes = (CREEPS, 2.0)  # m/s, m/s^2
    status_bit = 0x20
    ratios = (("place", "height"), ("velocity",))
    innovations = (
        ("gps_hpos", 2, "m"), ("gps_vpos", 0, "m"), ("gps_hvel", 2, "m/s"), ("gps_vvel", 0, "m/s"),
    )  # fmt: skip
    topic = LogTopic(
        "gnss_local",
        "Position and velocity from satellites, in the local frame",
        (
            LogField("position", "m, NED", 3),
            LogField("velocity", "m/s, NED", 3),
            LogField("position_variance", "m^2", 3),
            LogField("velocity_variance", "m^2/s^2", 3),
            LogField("fix_type", "GPS_FIX_TYPE", kind="uint32_t"),
            LogField("satellites_used", "255: not said", kind="uint32_t"),
        ),
    )
    parameters = (
        ("EKF2_GPS_DELAY", "delay", "ms", 0.0, 200.0,
         "GNSS: delay beyond what its time stamp says", 1e-3),
        ("EKF2_GPS_P_NOISE", "position_floor", "m", 0.001, 10.0,
         "GNSS: least standard deviation of the position"),
        ("EKF2_GPS_V_NOISE", "velocity_floor", "m/s", 0.01, 5.0,
         "GNSS: least standard deviation of the velocity"),
        ("EKF2_GPS_P_GATE", "position_gate", "SD", 1.0, 20.0, "GNSS: gate of the position"),
        ("EKF2_GPS_V_GATE", "velocity_gate", "SD", 1.0, 20.0, "GNSS: gate of the velocity"),
    )  # fmt: skip

    def is_plausible(self, sample: GnssSample) -> bool:
        """Slow enough, and not far."""
        return norm(sample.velocity) < _FASTEST and norm(sample.position) < PLACE_LIMIT

    def fault_of(self, sample: GnssSample, numbers: tuple[float, ...]) -> SensorFault:
        """Without a fix the rest says nothing."""
        return super().fault_of(sample, numbers) if sample.has_fix else SensorFault.NO_FIX

    def measured_at(self, memory: FusionMemory, sample: GnssSample) -> float:
        """Earlier by the delay that is known."""
        return sample.time - self.tuning.delay

    def stated(self, sample: GnssSample) -> tuple[Vec3, Vec3]:
        """Variances of position [m^2, NED] and velocity [m^2/s^2, NED], at least the floors."""
        return (
            believable(sample.position_variance, self.tuning.position_floor**2),
            believable(sample.velocity_variance, self.tuning.velocity_floor**2),
        )

    def fuse(self, memory: FusionMemory, sample: GnssSample, half: bool) -> Ratios:
        """As position and velocity."""
        gates = chi_square(self.tuning.position_gate, 3), chi_square(self.tuning.velocity_gate, 3)
        time, variances = self.measured_at(memory, sample), self.stated(sample)
        return fuse_gnss(memory.numbers, gates, time, sample.position, sample.velocity, *variances)

    def take(
        self, memory: FusionMemory, sample: GnssSample, time: float, ratio: Ratios
    ) -> FusionMemory:
        """Be where it says of ``time`` [s], and move so."""
        x, place, velocity = memory.numbers, ZERO, ZERO
        about_place, about_speed = self.stated(sample)
        if ratio[0] > 1.0:
            place = set_place(x, time, sample.position, about_place)
        if ratio[1] > 1.0:
            velocity = set_velocity(x, sample.velocity, about_speed)
        return memory.jumped(place, velocity)

    def aid(self, memory: FusionMemory, sample: GnssSample) -> Aid:
        """Place and velocity."""
        time = self.measured_at(memory, sample)
        sigma, fast = self.deviations(memory, self.stated(sample))
        return True, time, sample.position, (*sample.velocity, 0.0), sigma, fast


@compilable
def velocity_rows(x: Any, z: Vec3, variance: Vec3, dt: float) -> None:
    """Rows of a velocity ``z`` [m/s, NED], ``variance`` [m^2/s^2, NED], ``dt`` [s] after x."""
    clear(x, 3)
    for i in range(3):
        x.residual[i] = z[i] - (x.v[i] + dt * x.acceleration[i])
        x.H[i, V + i] = 1.0
        x.variance[i] = variance[i]


@machine_code
@kernel
def fuse_gnss(
    filters: Filter,
    gates: Vec2,
    time: float,
    position: Vec3,
    velocity: Vec3,
    position_variance: Vec3,
    velocity_variance: Vec3,
) -> tuple[float, float]:
    """Fuse position and velocity of ``time`` [s]: chi-square over gate of each.

    ``gates`` [1] are chi-squares, ``position`` [m, NED], ``velocity`` [m/s, NED],
    ``position_variance`` [m^2, NED], ``velocity_variance`` [m^2/s^2, NED].
    """
    x = filters[0]
    dt = time - x.time
    position_rows(x, position, position_variance, dt, 0.0)
    first = judged(x, 3, gates[0], 0, GNSS)
    velocity_rows(x, velocity, velocity_variance, dt)
    jumped = norm(three(x.innovation[0], 0)) > _MAKES * norm(three(x.residual, 0))
    return first, judged(x, 3, gates[1], 1, GNSS + 1, first > 1.0 and jumped)


@machine_code
@kernel
def set_velocity(x: Filter, v: Vec3, variance: Vec3) -> Vec3:
    """Take ``v`` [m/s, NED] as it is, ``variance`` [m^2/s^2, NED]; by how much it has jumped."""
    s = x[0]
    jump = subtract(v, s.v)
    put_three(s.v, 0, v)
    forget(s, V, variance)
    return jump
