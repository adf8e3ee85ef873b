"""What the estimator takes sensors for: noises, delays and limits of what is plausible."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.autopilot.estimation.sensors.barometer import BarometerTuning
from fsw.autopilot.estimation.sensors.gnss import GnssTuning
from fsw.autopilot.estimation.sensors.magnetometer import MagnetometerTuning
from fsw.autopilot.estimation.sensors.pose import PoseTuning
from fsw.autopilot.estimation.sensors.rangefinder import RangefinderTuning


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
    # Where it goes on as the rotors' commands make it: faults/residuals.py.

    # What is not known when the filter starts.
    accel_bias: float = 0.3  # m/s^2
    gyro_bias: float = 0.03  # rad/s
    velocity: float = 0.5  # m/s
    tilt: float = 0.02  # rad, where the accelerometer gives it, besides its bias
    start_heading: float = 1.0  # rad, before the magnetometer gives it

    # How far the filter stays behind: as long as measurements have lately taken to come, at most
    # this; older ones are of no use.
    longest_delay: float = 0.4  # s; a receiver whose solutions queue
    delay_decay: float = 0.01  # s/s, by which it is forgotten how long they took
    encoder_noise: float = 4.4e-4  # rad; 12 bit a turn are 1.5 mrad
    joint_disturbance_walk: float = 50.0  # rad/s^3/sqrt(Hz): 135 rad/s of bandwidth

    reset_time: float = 0.5  # s; aiding that was refused for so long is taken as it is
    stale_time: float = 0.5  # s without a reading

    # What sensors that aid the filter are taken for; see the file of each.
    pose: PoseTuning = field(default_factory=PoseTuning)
    gnss: GnssTuning = field(default_factory=GnssTuning)
    barometer: BarometerTuning = field(default_factory=BarometerTuning)
    magnetometer: MagnetometerTuning = field(default_factory=MagnetometerTuning)
    rangefinder: RangefinderTuning = field(default_factory=RangefinderTuning)
