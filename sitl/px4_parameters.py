"""What PX4 must be told about the simulated vehicle and its sensors; names and units are PX4's.

The only place that turns constants of the vehicle into PX4's parameters. The values that are not
read off the vehicle were measured with PX4 v1.17 (a70a558393) in SITL, flying the paper's vehicle.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sitl.plant.parameters import GRAVITY, effectiveness
from sitl.sensors.keys import MeasuredSensors
from vehicles.description import Vehicle

_MOTOR, _ACTUATOR_SET = 101, 301  # output functions: Motor 1, Offboard Actuator Set 1
_UP: Final = (0.0, 0.0, -1.0)  # PX4's default of a rotor's axis
_RATE_GAIN: Final = 25.0  # 1/s, from an error of roll and pitch rates to angular acceleration
_RATE_DAMPING: Final = 0.85  # of those loops with the rotors' lag
_YAW_BANDWIDTH: Final = 5.0  # rad/s, of the yaw rate: below the 12.6 at which PX4 cuts its torque
_YAW_INTEGRAL: Final = 0.5  # 1/s, share of the gain: PX4's default
# Off, its default, PX4 gives up thrust for torque that the rotors cannot give: a step of 11 deg in
# tilt left 40 % of the thrust, and the vehicle fell. On, thrust stays and torque is cut.
_AIRMODE: Final = 1  # of roll and pitch
_NO_MAGNETOMETER: Final = 5  # EKF2_MAG_TYPE
_VISION: Final = 3  # EKF2_HGT_REF
_POSE: Final = 11  # EKF2_EV_CTRL: horizontal and vertical position, yaw; no velocity is measured
_ACC_NOISE: Final = (0.35, 1.0)  # m/s², PX4's default and most
AIRFRAME: Final = 10016  # SYS_AUTOSTART: a quadrotor at an external simulator
MODEL: Final = "none_iris"


def px4_parameters(
    vehicle: Vehicle, sensors: MeasuredSensors, rate_hz: int
) -> dict[str, int | float]:
    """Every parameter that PX4 needs, whole numbers where PX4 has them.

    The exchange with the plant has ``rate_hz`` [Hz].
    """
    return {
        **_geometry(vehicle),
        **_outputs(vehicle),
        **_control(vehicle),
        **_estimation(sensors),
        **_inertial_unit(sensors, rate_hz),
    }


def _geometry(vehicle: Vehicle) -> dict[str, int | float]:
    """Rotors with the meanings that they have in the vehicle's file; KM is above 0 of "ccw"."""
    found: dict[str, int | float] = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": len(vehicle.rotors)}
    for k, rotor in enumerate(vehicle.rotors):
        sign = 1.0 if rotor.spin == "ccw" else -1.0
        values = dict(zip(("PX", "PY", "PZ"), rotor.position, strict=True))
        if rotor.axis != _UP:
            values |= dict(zip(("AX", "AY", "AZ"), rotor.axis, strict=True))
        values["KM"] = sign * rotor.torque_per_thrust
        found |= {f"CA_ROTOR{k}_{name}": value for name, value in values.items()}
    return found


def _outputs(vehicle: Vehicle) -> dict[str, int | float]:
    """Motors first, then the joints' servos, which MAV_CMD_DO_SET_ACTUATOR moves."""
    functions = [_MOTOR + k for k in range(len(vehicle.rotors))]
    functions += [_ACTUATOR_SET + k for k in range(len(vehicle.joints))]
    return {f"PWM_MAIN_FUNC{k}": function for k, function in enumerate(functions, start=1)}


def _control(vehicle: Vehicle) -> dict[str, int | float]:
    """Hover thrust, and gains that carry over to other sizes.

    A rate loop has torque / inertia times its gain, with the torque that PX4's mixer makes of a 1
    on that axis. Of roll and pitch it is with the rotors' lag T, and D for gain and derivative,
    T s^2 + (1 + D) s + gain, whose damping is chosen. PX4's own gain of the yaw rate would be one
    of 0.4 rad/s here, and the yaw swings by 0.3 rad.
    """
    full = np.array([rotor.thrust_max for rotor in vehicle.rotors])
    effect = effectiveness(vehicle) * full
    # As its ControlAllocationPseudoInverse scales the columns of roll, pitch and yaw.
    mix = np.linalg.pinv(effect[2:])[:, 1:4]
    mix[np.abs(mix) < 1e-9 * np.abs(mix).max(axis=0)] = 0.0
    tilts = mix[:, :2]
    mix[:, :2] /= np.sqrt(2.0 * (tilts**2).sum(axis=0) / np.count_nonzero(tilts, axis=0)).max()
    mix[:, 2] /= mix[:, 2].max()
    torques = (effect[3:] @ mix).diagonal()
    lag = max(rotor.lag for rotor in vehicle.rotors)
    hover = vehicle.mass * GRAVITY / full.sum()
    found: dict[str, int | float] = {
        "MPC_THR_HOVER": round(float(hover), 3),
        "MPC_XY_P": 1.8,
        "MPC_XY_VEL_P_ACC": 5.0,
        "MPC_XY_VEL_D_ACC": 0.6,
        "MPC_VELD_LP": 15.0,
        "MPC_XY_VEL_I_ACC": 1.0,
        "MPC_Z_P": 1.5,
        "MPC_Z_VEL_P_ACC": 8.0,
        "MC_AIRMODE": _AIRMODE,
    }
    derivative = max(2.0 * _RATE_DAMPING * math.sqrt(lag * _RATE_GAIN) - 1.0, 0.0) / _RATE_GAIN
    both = zip(("ROLL", "PITCH"), vehicle.base.inertia[:2], torques[:2].tolist(), strict=True)
    for axis, inertia, torque in both:
        gain = round(_RATE_GAIN * inertia / torque, 3)
        found |= {
            f"MC_{axis}_P": 7.0,
            f"MC_{axis}RATE_P": gain,
            f"MC_{axis}RATE_D": round(gain * derivative, 4),
        }
    gain = round(float(_YAW_BANDWIDTH * vehicle.base.inertia[2] / torques[2]), 3)
    return found | {
        "MC_YAW_P": 1.5,
        "MC_YAWRATE_P": gain,
        "MC_YAWRATE_I": round(_YAW_INTEGRAL * gain, 3),
    }


def _estimation(sensors: MeasuredSensors) -> dict[str, int | float]:
    """What there is to fuse, and how late poses are, which their stamps do not say to PX4."""
    pose = sensors.motion_capture or sensors.visual_odometry
    found: dict[str, int | float] = {
        "SYS_HAS_MAG": int(sensors.magnetometer is not None),
        "SYS_HAS_BARO": int(sensors.barometer is not None),
        "SYS_HAS_GPS": int(sensors.gnss is not None),
    }
    if sensors.magnetometer is None:
        found["EKF2_MAG_TYPE"] = _NO_MAGNETOMETER
    if sensors.gnss is None:
        found["EKF2_GPS_CTRL"] = 0
    else:
        found["EKF2_GPS_DELAY"] = sensors.gnss.latency_ms
    if pose is not None:
        found |= {
            "EKF2_EV_CTRL": _POSE,
            "EKF2_EV_DELAY": pose.latency_ms,
            # The least that PX4 takes: poses count with the variances that they state. With its
            # default of 0.1 m the same hover is twice as unsteady.
            "EKF2_EVP_NOISE": 0.01,
            "EKF2_HGT_REF": _VISION,
        }
    return found


def _inertial_unit(sensors: MeasuredSensors, rate_hz: int) -> dict[str, int | float]:
    """The noise of a sample is the vibration that is left of it where several are averaged.

    Without the two rates PX4 answers every second step at 500 Hz.
    """
    imu = sensors.imu
    noise = imu.vibration_m_s2 * math.sqrt(min(rate_hz / imu.rate_hz, 1.0))
    least, most = _ACC_NOISE
    found: dict[str, int | float] = {"EKF2_ACC_NOISE": round(min(max(noise, least), most), 2)}
    if rate_hz > 250:
        found |= {"IMU_GYRO_RATEMAX": 2000, "IMU_INTEG_RATE": rate_hz}
    return found
