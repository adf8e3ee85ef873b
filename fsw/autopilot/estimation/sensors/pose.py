"""Position and attitude from motion capture or visual odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from fsw.autopilot.estimation.error_state import BG, DELAY, TH, Filter, Law, V
from fsw.autopilot.estimation.faults.residuals import Aid
from fsw.autopilot.estimation.faults.sensor_fault import Health
from fsw.autopilot.estimation.faults.sources import Source
from fsw.autopilot.estimation.fusion import (
    POSE,
    believable,
    clear,
    forget,
    judged,
    position_rows,
    set_place,
)
from fsw.autopilot.estimation.fusion_memory import NO_TURN, FusionMemory
from fsw.autopilot.estimation.sensors.base import (
    CREEPS,
    PLACE_LIMIT,
    AidingSensor,
    LogField,
    LogTopic,
    Ratios,
    attitude_of,
    chi_square,
)
from fsw.autopilot.geometry.quaternion import (
    conjugate,
    multiply,
    normalised,
    rotation_vector,
    turned,
)
from fsw.autopilot.geometry.vectors import ZERO, four, norm, put_four, three
from fsw.autopilot.measurements import PoseSample, Sensor
from fsw.autopilot.signals import Vec3, Vec4
from fsw.compiled import compilable, kernel, machine_code

_KNOWN_VELOCITY = 0.05  # m/s, a standard deviation
# How fast a vehicle moves between two poses.
_SPEED: Final = 2.0  # m/s
_RATE: Final = 2.0  # rad/s
_FINE: Vec3 = (1e-4, 1e-4, 1e-4)
_UNKNOWN: Vec3 = (math.inf, math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class PoseTuning:
    """What a pose is taken for."""

    # The least standard deviations that it is believed, or its own where it states none.
    position_floor: float = 2e-3  # m; no motion capture is better while it flies
    attitude_floor: float = 1e-3  # rad
    # Times its deviation that its place may be noisy at the start, until innovations have told: two
    # poses 8 ms apart make a velocity of their noise.
    noise_at_start: float = 3.0
    gate: float = 5.0  # standard deviations; farther from what is expected is not fused
    delay: float = 0.0  # s, that it takes longer than its time stamp says
    delay_sigma: float = 0.0  # s, known so well at the start; 0: not estimated in flight
    delay_walk: float = 1e-4  # s/sqrt(s)


class Pose(AidingSensor[PoseSample, PoseTuning]):
    """Two parts: position, attitude."""

    sensor = Sensor.POSE
    sample = PoseSample
    measures = ("position", "attitude")
    at_rest = PoseSample(0.0, ZERO, NO_TURN, _FINE, _FINE)
    of_an_axis = 1
    source = Source.POSE | Source.ATTITUDE
    noise_scales = slice(POSE, POSE + 2)
    gates = ("gate", "gate")
    changes = (CREEPS, CREEPS)
    status_bit = 0x80
    ratios = (("place", "height"), ("heading",))
    innovations = (("ev_hpos", 2, "m"), ("ev_vpos", 0, "m"), ("ev_attitude", 3, "rad, body"))
    topic = LogTopic(
        "vehicle_visual_odometry",
        "Pose from motion capture or visual odometry",
        (
            LogField("position", "m, NED", 3),
            LogField("q", "[w, x, y, z], body to NED", 4),
            LogField("position_variance", "m^2", 3),
            LogField("orientation_variance", "rad^2", 3),
            LogField("reset_counter", "", kind="uint32_t"),
            LogField("drifts", "its frame does, as the variances say", kind="bool"),
            LogField("timestamp_sample", "us; `time` again, as PX4 writes it", kind="uint64_t"),
        ),
    )
    parameters = (
        ("EKF2_EV_DELAY", "delay", "ms", 0.0, 200.0,
         "Pose: delay beyond what its time stamp says", 1e-3),
        ("EST_EV_DELAY_SD", "delay_sigma", "ms", 0.0, 100.0,
         "Pose: standard deviation of EKF2_EV_DELAY, which is then estimated in flight; 0: exact",
         1e-3),
        ("EKF2_EVP_NOISE", "position_floor", "m", 0.0001, 10.0,
         "Pose: least standard deviation of the position"),
        ("EKF2_EVA_NOISE", "attitude_floor", "rad", 0.0001, 1.0,
         "Pose: least standard deviation of the attitude"),
        ("EKF2_EVP_GATE", "gate", "SD", 1.0, 20.0, "Pose: gate of position and attitude"),
    )  # fmt: skip

    def is_plausible(self, sample: PoseSample) -> bool:
        """An attitude, at a place that is not far."""
        w, x, y, z = sample.attitude
        squared = w * w + x * x + y * y + z * z
        return 0.8 < squared < 1.25 and norm(sample.position) < PLACE_LIMIT

    def fuse(self, memory: FusionMemory, sample: PoseSample, half: bool) -> Ratios:
        """As position and attitude."""
        place, about = self.noise(memory, sample)
        return fuse_pose(
            memory.numbers,
            self.law,
            chi_square(self.tuning.gate, 3),
            sample.time,
            sample.position,
            normalised(sample.attitude),
            place,
            _UNKNOWN if half else about,
        )

    def measured_at(self, memory: FusionMemory, sample: PoseSample) -> float:
        """Earlier by the delay that is known, or estimated."""
        delay = float(memory.numbers["pose_delay"][0])
        return sample.time - (delay if memory.started else self.tuning.delay)

    def stated(self, sample: PoseSample) -> tuple[Vec3, Vec3]:
        """Variances of position [m^2, NED] and attitude [rad^2, FRD], at least the floors."""
        return (
            believable(sample.position_variance, self.tuning.position_floor**2),
            believable(sample.attitude_variance, self.tuning.attitude_floor**2),
        )

    def noise(self, memory: FusionMemory, sample: PoseSample) -> tuple[Vec3, Vec3]:
        """The same of a pose in its own frame."""
        if sample.drifts:
            return memory.frame.place_noise, memory.frame.attitude_noise
        return self.stated(sample)

    def take(
        self, memory: FusionMemory, sample: PoseSample, time: float, ratio: Ratios
    ) -> FusionMemory:
        """Be where it says of ``time`` [s]."""
        x, place, turn = memory.numbers, ZERO, NO_TURN
        about_place, about = self.noise(memory, sample)
        if ratio[0] > 1.0:
            place = set_place(x, time, sample.position, about_place)
        if 1.0 < ratio[1] < math.inf:
            before = attitude_of(x[0])
            after = normalised(sample.attitude)
            set_attitude(x, after, about)
            turn = multiply(after, conjugate(before))
        return memory.jumped(place, ZERO, turn)

    def aid(self, memory: FusionMemory, sample: PoseSample) -> Aid:
        """Place and attitude."""
        time, q = self.measured_at(memory, sample), normalised(sample.attitude)
        sigma, angle = self.deviations(memory, self.noise(memory, sample))
        return True, time, sample.position, q, sigma, angle

    def agree(self, one: PoseSample, other: PoseSample) -> bool:
        """Whether two poses say the same, but for their noise and what a vehicle moves."""
        place, about = self.stated(one)
        apart = abs(one.time - other.time)
        gate = self.tuning.gate * math.sqrt(2.0)
        turn = rotation_vector(
            multiply(conjugate(normalised(one.attitude)), normalised(other.attitude))
        )
        step = gate * math.sqrt(sum(place)) + _SPEED * apart
        angle = gate * math.sqrt(sum(about)) + _RATE * apart
        return math.dist(one.position, other.position) <= step and norm(turn) <= angle


def is_attitude_stuck(health: Health) -> bool:
    """Whether of the last pose the attitude repeats itself, and the place does not."""
    return health.sensor is Sensor.POSE and not any(health.repeats[:3])


@compilable
def attitude_rows(x: Any, z: Vec4, variance: Vec3, dt: float, delayed: float) -> None:
    """Rows of an attitude ``z`` [1] of ``variance`` [rad^2, FRD], ``dt`` [s] after the state.

    ``delayed`` [1] is 1 where its delay is estimated, else 0.
    """
    clear(x, 3)
    w = three(x.rate, 0)
    there = turned(four(x.q), dt * w[0], dt * w[1], dt * w[2])
    residual = rotation_vector(multiply(conjugate(there), z))
    for i in range(3):
        x.residual[i] = residual[i]
        x.H[i, TH + i] = 1.0
        x.H[i, BG + i] = -dt
        x.H[i, DELAY] = -delayed * w[i]
        x.variance[i] = variance[i]
    # The rotation between the state and the measurement turns the error's axes, to first order.
    x.H[0, TH + 1], x.H[0, TH + 2] = dt * w[2], -dt * w[1]
    x.H[1, TH + 0], x.H[1, TH + 2] = -dt * w[2], dt * w[0]
    x.H[2, TH + 0], x.H[2, TH + 1] = dt * w[1], -dt * w[0]


@machine_code
@kernel
def fuse_pose(
    filters: Filter,
    laws: Law,
    gate: float,
    time: float,
    position: Vec3,
    attitude: Vec4,
    position_variance: Vec3,
    attitude_variance: Vec3,
) -> tuple[float, float]:
    """Fuse a pose stamped ``time`` [s]: chi-square over gate of its two halves.

    ``gate`` [1] is a chi-square, ``position`` [m, NED], ``attitude`` [1], ``position_variance``
    [m^2, NED] and ``attitude_variance`` [rad^2, FRD]. An attitude of infinite variance says
    nothing: infinite.
    """
    x, law = filters[0], laws[0]
    delayed = 1.0 if law.delay_sigma > 0.0 else 0.0
    for i in range(V, V + 3):
        # A delay is seen by the velocity that it is multiplied with. While that is not known, the
        # two explain each other's errors, and run away together.
        if x.covariance[i, i] > _KNOWN_VELOCITY * _KNOWN_VELOCITY:
            delayed = 0.0
    dt = time - x.pose_delay - x.time
    position_rows(x, position, position_variance, dt, delayed)
    first = judged(x, 3, gate, 0, POSE)
    if not attitude_variance[0] < math.inf:
        for i in range(3):
            x.innovation[1, i] = 0.0
        return first, math.inf
    dt = time - x.pose_delay - x.time
    attitude_rows(x, attitude, attitude_variance, dt, delayed)
    return first, judged(x, 3, gate, 1, POSE + 1)


@machine_code
@kernel
def set_attitude(x: Filter, q: Vec4, variance: Vec3) -> None:
    """Take an attitude ``q`` [1] of ``variance`` [rad^2, FRD] as it is."""
    s = x[0]
    put_four(s.q, q)
    forget(s, TH, variance)
