"""What the estimator takes sensors for: noises, delays and limits of what is plausible."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import gammainccinv


@dataclass(frozen=True, slots=True)
class EstimatorTuning:
    """Densities are of white noise, one sided, as data sheets give them."""

    # IMU. More than a data sheet's: what rotors shake, and errors of scale, are in it.
    accel_noise: float = 0.03  # m/s^2/sqrt(Hz)
    gyro_noise: float = 1.5e-3  # rad/s/sqrt(Hz)
    accel_bias_walk: float = 3e-3  # m/s^3/sqrt(Hz)
    gyro_bias_walk: float = 2e-4  # rad/s^2/sqrt(Hz)
    accel_range: float = 160.0  # m/s^2; beyond it, a reading is none
    # m/s^2: what the accelerometer can say, +-16 g (TDK InvenSense, ICM-42688-P data sheet). The
    # filter has no use for it: readings at its end are counted and told.
    accel_full_scale: float = 156.9
    gyro_range: float = 35.0  # rad/s
    # From one reading to the next. The rotors turn the body by 17 rad/s^2 and accelerate it by
    # 10 m/s^2 more than gravity; the rest is vibration. With `vio` a gyro off by 2 rad/s that is
    # believed ends a flight, one off by 1 rad/s does not.
    accel_jump: float = 30.0  # m/s^2
    gyro_jump: float = 1.0  # rad/s
    imu_gap: float = 0.006  # s; longer without a reading, the IMU was lost meanwhile
    # While the IMU is stuck or silent, what it reads is taken for the truth plus a bias that moves
    # as quickly as the vehicle does: the pose then gives acceleration and rate.
    lost_accel_walk: float = 10.0  # m/s^3/sqrt(Hz)
    lost_gyro_walk: float = 6.0  # rad/s^2/sqrt(Hz)
    # Where it goes on as the rotors' commands make it: faults/redundancy.py.

    # What is not known when the filter starts.
    accel_bias: float = 0.3  # m/s^2
    gyro_bias: float = 0.03  # rad/s
    velocity: float = 0.5  # m/s
    tilt: float = 0.02  # rad, where the accelerometer gives it, besides its bias
    start_heading: float = 1.0  # rad, before the magnetometer gives it
    baro_bias: float = 3.0  # m
    baro_bias_walk: float = 0.03  # m/s/sqrt(Hz)

    # How much longer than its time stamp says a reading takes.
    gnss_delay: float = 0.0  # s
    pose_delay: float = 0.0  # s
    pose_delay_sigma: float = 0.0  # s, known so well at the start; 0: not estimated in flight
    pose_delay_walk: float = 1e-4  # s/sqrt(s)

    # How far the filter stays behind: as long as measurements have lately taken to come, at most
    # this; older ones are of no use.
    longest_delay: float = 0.4  # s; a receiver whose solutions queue
    delay_decay: float = 0.01  # s/s, by which it is forgotten how long they took
    # The least standard deviations that sensors are believed, or theirs where they state none.
    position_floor: float = 2e-3  # m, of a pose; no motion capture is better while it flies
    attitude_floor: float = 1e-3  # rad
    # Times its deviation that a pose's place may be noisy at the start, until innovations have
    # told: two poses 8 ms apart make a velocity of their noise.
    pose_noise_at_start: float = 3.0
    gnss_position_floor: float = 0.01  # m
    gnss_velocity_floor: float = 0.1  # m/s
    pressure_floor: float = 0.2  # m: noise of a small barometer, 0.1 m, and gusts
    range_floor: float = 0.01  # m
    range_share: float = 0.05  # of the distance, besides: EKF2_RNG_SFE of PX4
    mag_noise: float = 0.01  # Gauss
    # What stays of each axis: 0.01 Gauss that a calibration leaves of hard iron, and 2 % of the
    # field's level part, 0.2 Gauss, of soft iron.
    mag_offset: float = 0.011  # Gauss
    declination: float = math.radians(2.9)  # rad, at the default origin (World Magnetic Model 2020)
    ground: float = 0.0  # m, NED z of what the rangefinder measures against

    # Readings farther from what is expected are not fused [standard deviations].
    pose_gate: float = 5.0
    gnss_position_gate: float = 5.0
    gnss_velocity_gate: float = 5.0
    pressure_gate: float = 5.0
    heading_gate: float = 5.0
    range_gate: float = 5.0

    encoder_noise: float = 4.4e-4  # rad; 12 bit a turn are 1.5 mrad
    joint_disturbance_walk: float = 50.0  # rad/s^3/sqrt(Hz): 135 rad/s of bandwidth

    reset_time: float = 0.5  # s; aiding that was refused for so long is taken as it is
    stale_time: float = 0.5  # s without a reading
    speed_limit: float = 50.0  # m/s
    place_limit: float = 1000.0  # m from the origin

    @property
    def gates(self) -> Gates:
        """Chi-square of each kind of measurement, at its gate."""
        return Gates(
            pose=chi_square(self.pose_gate, 3),
            gnss_position=chi_square(self.gnss_position_gate, 3),
            gnss_velocity=chi_square(self.gnss_velocity_gate, 3),
            pressure=chi_square(self.pressure_gate, 1),
            heading=chi_square(self.heading_gate, 1),
            range=chi_square(self.range_gate, 1),
        )


def chi_square(sigmas: float, readings: int) -> float:
    """Chi-square of so many ``readings`` exceeded as seldom as ``sigmas`` [1] are by one."""
    return 2.0 * float(gammainccinv(0.5 * readings, math.erfc(sigmas / math.sqrt(2.0))))


@dataclass(frozen=True, slots=True)
class Gates:
    """Chi-square beyond which a measurement is not fused."""

    pose: float  # of position, and of attitude
    gnss_position: float
    gnss_velocity: float
    pressure: float
    heading: float
    range: float


@dataclass(frozen=True, slots=True)
class EstimatorLaw:
    """Everything the kernels need that does not change in flight."""

    tuning: EstimatorTuning
    gates: Gates
